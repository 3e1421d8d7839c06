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
//! may be alike (sandwich over blocks, of whose scatter the fit takes one block's worth per number); few blocks show no scatter, and the deviation is no
//! smaller than by single residuals. False sightings weigh less (Huber).

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
/// The offset, and what the calibration may have wrong.
const NUMBERS: usize = 5;
const ROUNDS: usize = 10;

/// The offset that sightings in the order of time show; `None` of too few. One that the motion does not show comes with the deviation
/// that it has beforehand.
#[must_use]
pub fn desync(cameras: &Cameras, seen: &[Seen]) -> Option<Desync> {
    let rows: Vec<Row> = seen.iter().filter_map(|seen| row(cameras, seen)).collect();
    if rows.len() < FEWEST {
        return None;
    }
    let design = DMatrix::from_fn(rows.len(), NUMBERS, |i, k| rows[i].slopes[k] / rows[i].std_px);
    let target = DVector::from_fn(rows.len(), |i, _| rows[i].miss_px / rows[i].std_px);
    let mut prior = DMatrix::zeros(NUMBERS, NUMBERS);
    prior[(0, 0)] = PRIOR_S.powi(-2);
    let mut weight = DVector::repeat(rows.len(), 1.0);
    let (mut found, mut inverse, mut residual) = (DVector::zeros(NUMBERS), DMatrix::zeros(NUMBERS, NUMBERS), target.clone());
    for _ in 0..ROUNDS {
        let weighed = DMatrix::from_fn(rows.len(), NUMBERS, |i, k| weight[i] * design[(i, k)]);
        // A tiny ridge holds what the image does not show at all, such as the height of a marker that moves on a level line.
        inverse = (design.tr_mul(&weighed) + &prior + DMatrix::identity(NUMBERS, NUMBERS) * 1e-9).cholesky()?.inverse();
        found = &inverse * weighed.tr_mul(&target);
        residual = &target - &design * &found;
        let scale = raven::stats::robust_std(residual.as_slice())?.max(1.0);
        weight = residual.map(|r| (HUBER * scale / r.abs()).min(1.0));
    }
    let of_offset = |scatter: &DMatrix<f64>| (&inverse * scatter * &inverse)[(0, 0)];
    let [mut by_blocks, mut single] = [(); 2].map(|()| DMatrix::zeros(NUMBERS, NUMBERS));
    let (all, mut count) = ((0..rows.len()).collect::<Vec<usize>>(), 0);
    let block = |i: usize| (rows[i].time_s / BLOCK_S).floor();
    for of_block in all.chunk_by(|&a, &b| block(a) == block(b)) {
        let mut score = DVector::zeros(NUMBERS);
        for &i in of_block {
            let own = design.row(i).transpose() * (weight[i] * residual[i]);
            single.ger(1.0, &own, &own, 1.0);
            score += own;
        }
        by_blocks.ger(1.0, &score, &score, 1.0);
        count += 1;
    }
    let left = if count > NUMBERS { count as f64 / (count - NUMBERS) as f64 } else { 0.0 };
    let variance = of_offset(&single).max(left * of_offset(&by_blocks)) + of_offset(&prior);
    Some(Desync { right_minus_left_s: found[0], std_s: variance.sqrt() })
}

struct Row {
    time_s: f64,
    miss_px: f64,
    std_px: f64,
    /// Of the miss with the offset [px/s], and what the calibration may have wrong.
    slopes: [f64; NUMBERS],
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

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector3};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use raven::robot::nominal;
    use raven::simulation::{Options, Session};

    use super::*;

    const NOISE_PX: f64 = 0.1;
    const OFFSET_S: f64 = 0.005;

    /// A marker that swings in front of the cameras for so long, at 15 frames a second, with noise that is alike for two seconds beside what is not.
    fn swinging(cameras: &Cameras, lasts_s: f64, alike_px: f64, random: &mut ChaCha8Rng) -> Vec<Seen> {
        let place = |t: f64| Vector3::new(0.04 * (2.1 * t).sin(), 0.03 * (1.3 * t + 0.4).cos(), 0.3 + 0.03 * (0.9 * t).sin());
        let pixels = |t: f64| cameras.project(&place(t)).unwrap();
        let mut noise = || -> f64 { Distribution::<f64>::sample(&StandardNormal, random) * NOISE_PX };
        let mut off_px = 0.0;
        let mut at = |k: u32| {
            if k.is_multiple_of(30) {
                off_px = alike_px / NOISE_PX * noise();
            }
            let time_s = f64::from(k) / 15.0;
            let (left, right) = (pixels(time_s), pixels(time_s - OFFSET_S));
            let (before, after) = (pixels(time_s - 1e-4), pixels(time_s + 1e-4));
            let both = [0, 1].map(|side| Interpolated {
                pixel: [left, right][side][side] + Vector2::new(noise(), noise() + off_px * side as f64),
                velocity: (after[side] - before[side]) / 2e-4,
                covariance: Matrix2::identity() * NOISE_PX.powi(2),
                alike_px: 0.0,
            });
            Seen { time_s, both }
        };
        (0..(15.0 * lasts_s) as u32).map(&mut at).collect()
    }

    #[test]
    fn offsets_scatter_as_is_said_however_short_the_motion() {
        const RUNS: usize = 200;
        let session = Session::new(&nominal::gold(), Options::default()).unwrap();
        let cameras = session.cameras().unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        for (lasts_s, alike_px) in [(4.0, 0.0), (6.0, 0.0), (30.0, 0.0), (30.0, 0.1), (60.0, 0.1)] {
            let run = |_| desync(cameras, &swinging(cameras, lasts_s, alike_px, &mut random)).unwrap();
            let found: Vec<Desync> = (0..RUNS).map(run).collect();
            let over: Vec<f64> = found.iter().map(|found| (found.right_minus_left_s - OFFSET_S) / found.std_s).collect();
            let ratio = raven::stats::rms(&over).unwrap();
            eprintln!("{lasts_s} s, alike by {alike_px} px: off by {ratio:.2} stated deviations, {:.2e} s", found[0].std_s);
            assert!((0.7..1.3).contains(&ratio), "{lasts_s} s, {alike_px} px: {ratio}");
        }
    }
}
