//! Pose of the cameras before the robot, and their latency, from a moving tip: the whole of `p_0 = R p_left + t`.
//!
//! The motors put the tip at `p(t)` in frame 0. Each camera, at its own stamp `s`, sees it at
//!
//! ```text
//! pixel = pi_c(T_c T (p(s - d))),   T = left_from_base
//! ```
//!
//! Seven numbers: `T` and the latency `d`. The two cameras need not be synchronised. What the motors do not know of the tip (cables, radii)
//! is the noise, of some pixels and alike for seconds: Huber's loss, and standard deviations by leaving out stretches of time.

use nalgebra::{Isometry3, Matrix3, Point3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};
use raven::camera::Cameras;
use raven::stats::median;

use crate::tip_path::TipPath;

/// One camera's view of the marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// 0 left, 1 right.
    pub camera: usize,
    /// Stamp since the start of the recording [s].
    pub time_s: f64,
    /// Centre of the marker [px].
    pub pixel: Vector2<f64>,
}

/// What is solved for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandEye {
    /// `x_left = left_from_base x_0`.
    pub left_from_base: Isometry3<f64>,
    /// By how much an image shows the past of its stamp [s].
    pub latency_s: f64,
}

/// The solution and how well it is known.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The solution.
    pub hand_eye: HandEye,
    /// Covariance of a rotation vector and a shift of `left_from_base` from the left, and of the latency, 7x7.
    pub covariance: SMatrix<f64, 7, 7>,
    /// Reprojection RMS [px].
    pub rms_px: f64,
}

type Normal = (SVector<f64, 7>, SMatrix<f64, 7, 7>);

/// From so many robust standard deviations on a sighting is an outlier.
const OUTLIER_SIGMAS: f64 = 3.0;
/// Errors of the motors' tip are alike for about so long [s].
const STRETCH_S: f64 = 2.0;
/// Latency of a camera is between nothing and this [s]; clocks may also be off by as much.
const LARGEST_LATENCY_S: f64 = 0.5;

/// Rotation and shift that take points to their partners best, by least squares (Kabsch 1976).
#[must_use]
pub fn align(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<Isometry3<f64>> {
    let count = pairs.len() as f64;
    let (from, to) = pairs.iter().fold((Vector3::zeros(), Vector3::zeros()), |(a, b), (p, q)| (a + p / count, b + q / count));
    let spread: Matrix3<f64> = pairs.iter().map(|(p, q)| (q - to) * (p - from).transpose()).sum();
    let svd = spread.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    // Points on a line leave the turn about it open.
    if svd.singular_values[1] < 1e-6 * svd.singular_values[0].max(f64::MIN_POSITIVE) {
        return None;
    }
    let sign = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v_t).determinant().signum()));
    let rotation = UnitQuaternion::from_matrix(&(u * sign * v_t));
    Some(Isometry3::from_parts((to - rotation * from).into(), rotation))
}

impl HandEye {
    /// Where a camera sees the tip that it shows at a stamp [px].
    #[must_use]
    pub fn expected(&self, cameras: &Cameras, path: &TipPath<'_>, camera: usize, time_s: f64) -> Option<Vector2<f64>> {
        let left = self.left_from_base * Point3::from(path.at(time_s - self.latency_s)?);
        let point = if camera == 0 { left } else { cameras.right_from_left * left };
        [&cameras.left, &cameras.right][camera].project(&point.coords)
    }

    /// Residual of a sighting [px] and its slope, 2x7.
    fn slope(&self, cameras: &Cameras, path: &TipPath<'_>, seen: &Seen) -> Option<(Vector2<f64>, SMatrix<f64, 2, 7>)> {
        let (tip, velocity) = path.with_velocity(seen.time_s - self.latency_s)?;
        let turned = self.left_from_base.rotation * tip;
        let left = turned + self.left_from_base.translation.vector;
        let (pixel, by_left) = if seen.camera == 0 {
            cameras.left.project_with_slope(&left)?
        } else {
            let right = cameras.right_from_left * Point3::from(left);
            let (pixel, by_right) = cameras.right.project_with_slope(&right.coords)?;
            (pixel, by_right * cameras.right_from_left.rotation.to_rotation_matrix())
        };
        let mut slope = SMatrix::<f64, 2, 7>::zeros();
        slope.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-by_left * turned.cross_matrix()));
        slope.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_left);
        slope.set_column(6, &(-by_left * (self.left_from_base.rotation * velocity)));
        Some((pixel - seen.pixel, slope))
    }

    fn moved(&self, step: &SVector<f64, 7>) -> Self {
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        let shift = self.left_from_base.translation.vector + step.fixed_rows::<3>(3);
        let latency_s = (self.latency_s + step[6]).clamp(-LARGEST_LATENCY_S, LARGEST_LATENCY_S);
        Self { left_from_base: Isometry3::from_parts(shift.into(), turn * self.left_from_base.rotation), latency_s }
    }
}

/// Improves a start until it rests; `None` if the sightings do not determine it.
#[must_use]
pub fn solve(start: HandEye, cameras: &Cameras, path: &TipPath<'_>, seen: &[Seen]) -> Option<Solved> {
    let mut hand_eye = start;
    for _ in 0..50 {
        let (gradient, curvature) = total(&normals(&hand_eye, cameras, path, seen)?);
        let step = -curvature.cholesky()?.solve(&gradient);
        hand_eye = hand_eye.moved(&step);
        if step.fixed_rows::<3>(0).norm() < 1e-8 && step.fixed_rows::<3>(3).norm() < 1e-9 && step[6].abs() < 1e-7 {
            break;
        }
    }
    let stretches = normals(&hand_eye, cameras, path, seen)?;
    let (_, all) = total(&stretches);
    let count = stretches.len() as f64;
    let mut covariance = SMatrix::zeros();
    for (gradient, curvature) in &stretches {
        let change = (all - curvature).cholesky()?.solve(gradient);
        covariance += change * change.transpose() * ((count - 1.0) / count);
    }
    let squares: Vec<f64> = residuals(&hand_eye, cameras, path, seen).iter().map(|(r, _, _)| r.norm_squared()).collect();
    Some(Solved { hand_eye, covariance, rms_px: (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() })
}

fn residuals(hand_eye: &HandEye, cameras: &Cameras, path: &TipPath<'_>, seen: &[Seen]) -> Vec<(Vector2<f64>, SMatrix<f64, 2, 7>, f64)> {
    let one = |s: &Seen| hand_eye.slope(cameras, path, s).map(|(residual, slope)| (residual, slope, s.time_s));
    seen.iter().filter_map(one).collect()
}

/// Gradient and curvature of Huber's loss by stretches of time.
fn normals(hand_eye: &HandEye, cameras: &Cameras, path: &TipPath<'_>, seen: &[Seen]) -> Option<Vec<Normal>> {
    let all = residuals(hand_eye, cameras, path, seen);
    let distances: Vec<f64> = all.iter().map(|(r, _, _)| r.norm()).collect();
    // The median of the length of a two-dimensional normal deviate is 1.1774 standard deviations.
    let threshold = OUTLIER_SIGMAS * (median(&distances)? / 1.1774).max(1e-9);
    let mut stretches: Vec<(i64, Normal)> = Vec::new();
    for (residual, slope, time_s) in &all {
        let weight = (threshold / residual.norm()).min(1.0);
        let index = (time_s / STRETCH_S).floor() as i64;
        let at = stretches.iter().position(|(i, _)| *i == index).unwrap_or_else(|| {
            stretches.push((index, (SVector::zeros(), SMatrix::zeros())));
            stretches.len() - 1
        });
        let (gradient, curvature) = &mut stretches[at].1;
        *gradient += slope.tr_mul(residual) * weight;
        *curvature += slope.tr_mul(slope) * weight;
    }
    Some(stretches.into_iter().map(|(_, normal)| normal).collect())
}

fn total(stretches: &[Normal]) -> Normal {
    stretches.iter().fold((SVector::zeros(), SMatrix::zeros()), |(g, c), (gradient, curvature)| (g + gradient, c + curvature))
}
