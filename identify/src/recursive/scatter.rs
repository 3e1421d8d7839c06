//! What the innovations say about the model while the log goes by: each joint's misfit, and how alike neighbours are.
//!
//! The misfit starts at what rigid cables leave unexplained and is learned anew whenever the sightings have doubled, from the later
//! half of them, with the filter's own uncertainty as part of their covariance (see [`crate::misfit`]).
//!
//! Innovations of a right model are white. Those of hysteresis and late images are alike for seconds, and the information that the
//! filter counts is too large by
//!
//! ```text
//! tempering = sum_b |sum_(i in b) w_i|^2 / (3 n),   w_i the whitened innovations of the blocks b
//! ```

use nalgebra::{Matrix3, Vector3};
use raven::filter::Innovation;

use crate::misfit::{Residual, misfit};
use crate::problem::{BLOCK_S, MISFIT_START};

/// Sightings after which the misfit is learned for the first time.
const FIRST: usize = 30;

/// Innovations so far, and what they say.
pub struct Scatter {
    misfit: Vector3<f64>,
    residuals: Vec<Residual>,
    next: usize,
    blocks: Vec<Block>,
}

/// Whitened innovations of two seconds.
struct Block {
    place: (usize, f64),
    sum: Vector3<f64>,
    count: usize,
}

impl Scatter {
    /// Before any sighting.
    pub fn new() -> Self {
        Self { misfit: MISFIT_START, residuals: Vec::new(), next: FIRST, blocks: Vec::new() }
    }

    /// With a misfit [rad, rad, m] that is known and stays.
    pub fn knowing(misfit: Vector3<f64>) -> Self {
        Self { misfit, next: usize::MAX, ..Self::new() }
    }

    /// What each joint does beside the model, one standard deviation [rad, rad, m].
    pub fn misfit(&self) -> Vector3<f64> {
        self.misfit
    }

    /// Covariance of a seen tip [m^2] from the misfit of the joints.
    pub fn covariance_m2(&self, seen_from_joints: &Matrix3<f64>) -> Matrix3<f64> {
        seen_from_joints * Matrix3::from_diagonal(&self.misfit.component_mul(&self.misfit)) * seen_from_joints.transpose()
    }

    /// Takes in an innovation of session `session`, whose covariance [m^2] has the misfit in it.
    pub fn take_in(&mut self, innovation: &Innovation<3>, seen_from_joints: Matrix3<f64>, session: usize, time_s: f64) {
        let own = innovation.factor * innovation.factor.transpose() - self.covariance_m2(&seen_from_joints);
        self.residuals.push(Residual { error: -innovation.residual, covariance: own, from_joints: seen_from_joints });
        if self.residuals.len() >= self.next {
            self.next *= 2;
            self.misfit = misfit(&self.residuals[self.residuals.len() / 2..], &self.misfit);
        }
        let whitened = innovation.factor.solve_lower_triangular(&innovation.residual);
        let Some(whitened) = whitened.filter(|_| innovation.accepted) else { return };
        let place = (session, (time_s / BLOCK_S).floor());
        match self.blocks.last_mut().filter(|block| block.place == place) {
            Some(block) => {
                block.sum += whitened;
                block.count += 1;
            }
            None => self.blocks.push(Block { place, sum: whitened, count: 1 }),
        }
    }

    /// By how much innovations within two seconds are alike; at least 1.
    pub fn tempering(&self) -> f64 {
        let count: usize = self.blocks.iter().map(|block| block.count).sum();
        let squares: f64 = self.blocks.iter().map(|block| block.sum.norm_squared()).sum();
        (squares / (3.0 * count.max(1) as f64)).max(1.0)
    }
}
