//! By how much more a right image shows the past than a left one of the same stamp, from a marker that moves.
//!
//! Pixels `l` and `r` of one point at one time lie on each other's epipolar line. With `E` the essential matrix and `x` normalised
//! coordinates, the distance from it is, to first order (Sampson 1982),
//!
//! ```text
//! eps = x_r' E x_l / |d (x_r' E x_l) / d (l, r)|    [px]
//! ```
//!
//! An offset `d` moves the right pixel by its velocity, so `eps = -d (d eps / d r) v_r`. What the calibration has wrong depends on the place
//! in the image and not on the velocity, and is estimated along: a constant, both coordinates and the disparity. Residuals of two seconds
//! may be alike (sandwich over blocks); false sightings weigh less (Huber).

use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector4};
use raven::camera::Cameras;
use raven_track::interpolate::Interpolated;

/// An offset between the cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Desync {
    /// By how much more a right image shows the past than a left one of the same stamp [s].
    pub right_minus_left_s: f64,
    /// Its standard deviation [s].
    pub std_s: f64,
}

/// A marker seen by both cameras at one time of the left one's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Time [s].
    pub time_s: f64,
    /// Left and right.
    pub both: [Interpolated; 2],
}

/// Fewest sightings to tell an offset from.
const FEWEST: usize = 30;
/// Length of the blocks within which residuals may be alike [s].
const BLOCK_S: f64 = 2.0;
/// Standard deviation of the offset before anything is seen: a webcam's latency may differ from its twin's by a frame [s].
const PRIOR_S: f64 = 0.03;
/// Where a residual ceases to count by its square, in standard deviations.
const HUBER: f64 = 1.345;
const ROUNDS: usize = 10;

/// The offset that sightings in the order of time show; `None` of too few. One that the motion does not show comes with the deviation
/// that it has beforehand.
#[must_use]
pub fn desync(cameras: &Cameras, seen: &[Seen]) -> Option<Desync> {
    let rows: Vec<Row> = seen.iter().filter_map(|seen| row(cameras, seen)).collect();
    if rows.len() < FEWEST {
        return None;
    }
    let design = DMatrix::from_fn(rows.len(), 5, |i, k| rows[i].slopes[k] / rows[i].std_px);
    let target = DVector::from_fn(rows.len(), |i, _| rows[i].miss_px / rows[i].std_px);
    let mut prior = DMatrix::zeros(5, 5);
    prior[(0, 0)] = PRIOR_S.powi(-2);
    let mut weight = DVector::repeat(rows.len(), 1.0);
    let (mut found, mut inverse, mut residual) = (DVector::zeros(5), DMatrix::zeros(5, 5), target.clone());
    for _ in 0..ROUNDS {
        let weighed = DMatrix::from_fn(rows.len(), 5, |i, k| weight[i] * design[(i, k)]);
        // A tiny ridge holds what the image does not show at all, such as the height of a marker that moves on a level line.
        inverse = (design.tr_mul(&weighed) + &prior + DMatrix::identity(5, 5) * 1e-9).cholesky()?.inverse();
        found = &inverse * weighed.tr_mul(&target);
        residual = &target - &design * &found;
        let scale = raven::stats::robust_std(residual.as_slice())?.max(1.0);
        weight = residual.map(|r| (HUBER * scale / r.abs()).min(1.0));
    }
    let mut scatter = DMatrix::zeros(5, 5);
    let mut start = 0;
    while start < rows.len() {
        let end = (start..rows.len())
            .find(|&i| (rows[i].time_s / BLOCK_S).floor() != (rows[start].time_s / BLOCK_S).floor())
            .unwrap_or(rows.len());
        let score: DVector<f64> = (start..end).map(|i| design.row(i).transpose() * (weight[i] * residual[i])).sum();
        scatter.ger(1.0, &score, &score, 1.0);
        start = end;
    }
    let variance = (&inverse * (scatter + prior) * &inverse)[(0, 0)];
    Some(Desync { right_minus_left_s: found[0], std_s: variance.sqrt() })
}

struct Row {
    time_s: f64,
    miss_px: f64,
    std_px: f64,
    /// Of the miss with the offset [px/s], and what the calibration may have wrong.
    slopes: [f64; 5],
}

fn row(cameras: &Cameras, seen: &Seen) -> Option<Row> {
    let [left, right] = seen.both;
    let (x_left, x_right) = (cameras.left.undistort(&left.pixel)?, cameras.right.undistort(&right.pixel)?);
    let essential: Matrix3<f64> =
        cameras.right_from_left.translation.vector.cross_matrix() * cameras.right_from_left.rotation.to_rotation_matrix().matrix();
    let (on_left, on_right) = (essential.tr_mul(&x_right.push(1.0)), essential * x_left.push(1.0));
    // By pixels rather than normalised coordinates.
    let by_pixel = |slope: Vector2<f64>, camera: &raven::camera::Pinhole, normal: &Vector2<f64>| {
        Some(camera.pixel_slope(normal).try_inverse()?.tr_mul(&slope))
    };
    let (by_left, by_right) = (by_pixel(on_left.xy(), &cameras.left, &x_left)?, by_pixel(on_right.xy(), &cameras.right, &x_right)?);
    let gradient = Vector4::new(by_left.x, by_left.y, by_right.x, by_right.y);
    let length = gradient.norm();
    let (by_left, by_right) = (by_left / length, by_right / length);
    let variance = by_left.dot(&(left.covariance * by_left)) + by_right.dot(&(right.covariance * by_right));
    // The sign of the gradient is that of the baseline; a constant sign keeps the places' slopes comparable.
    let place = [1.0, x_left.x, x_left.y, x_left.x - x_right.x];
    let slope = -by_right.dot(&right.velocity);
    let slopes = [slope, place[0], place[1], place[2], place[3]];
    (variance > 0.0).then(|| Row {
        time_s: seen.time_s,
        miss_px: x_right.push(1.0).dot(&on_right) / length,
        std_px: variance.sqrt(),
        slopes,
    })
}
