//! How well a calibration knows its parameters: a covariance robust to what the corners of one board share.
//!
//! Corners of one board share what went wrong with it: its bow, its blur, its motion between two exposures. Treating them as independent
//! makes standard deviations 1.5 to 3 times too small on real boards. Boards are independent of one another. With `s_b` and `S_b` the share
//! of board `b` in the reduced normal equations `S = sum_b S_b = L L'` at the optimum, and `M_b = L^-1 S_b L^-T`,
//!
//! ```text
//! d_b = L^-T (1 - M_b)^-1/2 L^-1 s_b,    cov = sum_b d_b d_b'
//! ```
//!
//! This is the cluster-robust covariance CR2 (Bell and McCaffrey 2002). The root makes up for how far each board drew the solution to
//! itself. How far 95 % reaches with so few boards is a matter of the degrees of freedom of that sum, by Satterthwaite's rule and as if the
//! corners were independent (same source): for a combination `c' theta`, with `u = L^-1 c`,
//!
//! ```text
//! O_bb' = [b = b'] u' M_b (1 - M_b)^-1 u - w_b' w_b',    w_b = M_b (1 - M_b)^-1/2 u,    freedom = (tr O)^2 / |O|^2
//! ```

use nalgebra::{DMatrix, Matrix2, Matrix3, SMatrix, SVector, Vector3};
use raven::camera::{Cameras, Quality};
use raven::stats::student_quantile;

use crate::bundle::{Free, hold};
use crate::linear::{Block, Rig, SHARED};

type Square = SMatrix<f64, SHARED, SHARED>;

/// Covariance of the shared parameters, and what says how far its intervals reach.
#[derive(Debug, Clone)]
pub struct Deviations {
    /// 26x26, zero for fixed parameters.
    pub covariance: Square,
    /// `L^-1`.
    whitener: Square,
    /// `M_b`, one per board.
    shares: Vec<Square>,
}

/// A board that holds more of what is known about a combination of parameters is the only one to know it.
const LARGEST_SHARE: f64 = 1.0 - 1e-6;

impl Deviations {
    /// At the optimum; `None` if some board alone determines a parameter.
    #[must_use]
    pub fn of(blocks: &[Block], free: Free) -> Option<Self> {
        let reduced: Vec<(SVector<f64, SHARED>, Square)> = blocks.iter().map(|b| b.reduced(0.0)).collect::<Option<_>>()?;
        let mut all = reduced.iter().fold(Square::zeros(), |sum, (_, curvature)| sum + curvature);
        hold(&mut all, free);
        let whitener = all.cholesky()?.l().try_inverse()?;
        let mut covariance = Square::zeros();
        let mut shares = Vec::with_capacity(reduced.len());
        for (gradient, curvature) in &reduced {
            let share = whitener * curvature * whitener.transpose();
            let change = whitener.transpose() * rest_to(&share, -0.5)? * whitener * gradient;
            covariance += change * change.transpose();
            shares.push(share);
        }
        Some(Self { covariance, whitener, shares })
    }

    /// How many standard deviations of `direction' theta` make 95 %, two-sided.
    #[must_use]
    pub fn t95(&self, direction: &SVector<f64, SHARED>) -> f64 {
        let u = self.whitener * direction;
        let parts: Option<Vec<(f64, SVector<f64, SHARED>)>> = self
            .shares
            .iter()
            .map(|share| {
                let root = rest_to(share, -0.5)? * u;
                Some((root.dot(&(share * root)), share * root))
            })
            .collect();
        let Some(parts) = parts else { return f64::INFINITY };
        let of = |i: usize, j: usize| if i == j { parts[i].0 } else { 0.0 } - parts[i].1.dot(&parts[j].1);
        let matrix = DMatrix::from_fn(parts.len(), parts.len(), of);
        let freedom = matrix.trace().powi(2) / matrix.norm_squared();
        student_quantile(freedom.max(1.0), 0.975).unwrap_or(f64::INFINITY)
    }

    /// As [`Self::t95`], of one parameter.
    #[must_use]
    pub fn t95_of(&self, parameter: usize) -> f64 {
        let mut direction = SVector::zeros();
        direction[parameter] = 1.0;
        self.t95(&direction)
    }
}

/// `(1 - share)^power`; `None` where nothing is left without this board.
fn rest_to(share: &Square, power: f64) -> Option<Square> {
    let eigen = share.symmetric_eigen();
    if eigen.eigenvalues.max() > LARGEST_SHARE {
        return None;
    }
    let scale = eigen.eigenvalues.map(|value| (1.0 - value).powf(power));
    Some(eigen.eigenvectors * Square::from_diagonal(&scale) * eigen.eigenvectors.transpose())
}

/// Covariance of a point seen by both cameras [m^2] that comes from the calibration alone, in the left camera's frame.
#[must_use]
pub fn point_covariance(rig: &Rig, covariance: &SMatrix<f64, SHARED, SHARED>, point_left: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let slope = point_slope(rig, covariance, point_left)?;
    Some(slope * covariance * slope.transpose())
}

/// Slope of a point seen by both cameras with the shared parameters, 3x26 [m]: the pixels stay, the cameras move.
///
/// By differences of a tenth of each parameter's standard deviation; zero for parameters that have none.
#[must_use]
pub fn point_slope(rig: &Rig, covariance: &SMatrix<f64, SHARED, SHARED>, point_left: &Vector3<f64>) -> Option<SMatrix<f64, 3, SHARED>> {
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
    Some(slope)
}

/// The rig as the cameras that everything else computes with.
#[must_use]
pub fn cameras_of(rig: &Rig) -> Cameras {
    let [left, right] = rig.cameras;
    let right_from_left = rig.right_from_left;
    Cameras { left, right, right_from_left, base_from_left: None, latency_s: 0.0, right_minus_left_s: 0.0, quality: Quality::default() }
}
