//! How well a calibration knows its parameters: the delete-one-board jackknife, to first order.
//!
//! Corners of one board share what went wrong with it: its bow, its blur, its motion between two exposures. Treating them as independent
//! makes standard deviations 1.5 to 3 times too small on real boards. Boards are independent of one another, and what the answer does
//! when each in turn is left out is known from the normal equations at the optimum, where `s_b` and `S_b` are the share of board `b`:
//!
//! ```text
//! d_b = (S - S_b)^-1 s_b,    cov = (n - 1) / n  sum_b d_b d_b'
//! ```
//!
//! This is the cluster-robust covariance CR3 (Bell and McCaffrey 2002), which also makes up for how few boards there are.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector3};
use raven::camera::{Cameras, Quality};

use crate::bundle::{Free, hold};
use crate::linear::{Block, Rig, SHARED};

/// Covariance of the shared parameters at the optimum, 26x26, zero for fixed ones; `None` if some board alone determines a parameter.
#[must_use]
pub fn covariance(blocks: &[Block], free: Free) -> Option<SMatrix<f64, SHARED, SHARED>> {
    let reduced: Vec<(SVector<f64, SHARED>, SMatrix<f64, SHARED, SHARED>)> =
        blocks.iter().map(|b| b.reduced(0.0)).collect::<Option<_>>()?;
    let mut all = SMatrix::<f64, SHARED, SHARED>::zeros();
    reduced.iter().for_each(|(_, curvature)| all += curvature);
    hold(&mut all, free);
    let count = blocks.len() as f64;
    let mut covariance = SMatrix::zeros();
    for (gradient, curvature) in &reduced {
        let change = (all - curvature).cholesky()?.solve(gradient);
        covariance += change * change.transpose() * ((count - 1.0) / count);
    }
    Some(covariance)
}

/// Two-sided 95 % quantile of Student's t with one degree of freedom less than `boards`: how many standard deviations make 95 %.
///
/// Cornish and Fisher's expansion about the normal quantile (Abramowitz and Stegun 26.7.5), good to 3 % from three boards on.
#[must_use]
pub fn t95(boards: usize) -> f64 {
    let freedom = boards.saturating_sub(1).max(1) as f64;
    let z: f64 = 1.959_963_985;
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    let terms = [(z3 + z) / 4.0, (5.0 * z5 + 16.0 * z3 + 3.0 * z) / 96.0, (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / 384.0];
    z + terms[0] / freedom + terms[1] / freedom.powi(2) + terms[2] / freedom.powi(3)
}

/// Covariance of a point seen by both cameras [m^2] that comes from the calibration alone, in the left camera's frame.
///
/// The pixels stay, the cameras move: slopes by differences of a tenth of each parameter's standard deviation.
#[must_use]
pub fn point_covariance(rig: &Rig, covariance: &SMatrix<f64, SHARED, SHARED>, point_left: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let pixels = cameras_of(rig).project(point_left)?;
    let mut slope = SMatrix::<f64, 3, SHARED>::zeros();
    for index in (0..SHARED).filter(|&i| covariance[(i, i)] > 0.0) {
        let mut step = SVector::<f64, SHARED>::zeros();
        step[index] = 0.1 * covariance[(index, index)].sqrt();
        let at = |step: &SVector<f64, SHARED>| {
            let moved = cameras_of(&rig.moved(step, &[]));
            Some(moved.triangulate(&pixels, &[Matrix2::identity(); 2])?.point_left)
        };
        slope.set_column(index, &((at(&step)? - at(&-step)?) / (2.0 * step[index])));
    }
    Some(slope * covariance * slope.transpose())
}

/// The rig as the cameras that everything else computes with.
#[must_use]
pub fn cameras_of(rig: &Rig) -> Cameras {
    let [left, right] = rig.cameras;
    let right_from_left = rig.right_from_left;
    Cameras { left, right, right_from_left, base_from_left: None, latency_s: 0.0, quality: Quality::default() }
}
