//! What of the cameras' errors stays as it is while the tip stays where it is: a marker's centre is off by the same light and shade, and by the same
//! place among the pixels, in every image of a tip at rest. A filter that takes it for noise averages it away and claims too much.
//!
//! ```text
//! e_k = L_k (sqrt(1 - p) w_k + sqrt(p) o_k),   <o_k o_l'> = exp(-s_kl / s_p) I
//! ```
//!
//! with `L_k L_k'` the covariance that a sighting claims, `w` white noise of unit variance, and `s_kl` the path of the tip in between (Gauss-Markov along
//! the path; Bryson, Henrikson 1968, for filters with noise that is not white).

use nalgebra::Vector3;
use serde::Serialize;

use crate::robot::Arm;

/// How much of a sighting's error persists, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Persistence {
    /// Of the variance that a sighting claims, 0 to 1.
    pub part: f64,
    /// Path of the tip over which the error falls to 1/e of what it was [m].
    pub path_m: f64,
}

impl Persistence {
    /// Of sightings whose errors are new in each image.
    pub const NONE: Self = Self { part: 0.0, path_m: 1.0 };

    /// What is left of an error after a path of the tip [m], 1 to 0.
    #[must_use]
    pub fn kept(&self, path_m: f64) -> f64 {
        (-path_m / self.path_m).exp()
    }

    /// Deviations of what is new in each sighting and of what persists, as parts of the deviation that it claims.
    #[must_use]
    pub fn new_and_persistent(&self) -> [f64; 2] {
        [1.0 - self.part, self.part].map(f64::sqrt)
    }
}

/// How far the tip goes while motors turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct TipPath {
    /// Of each motor alone, with the tip in the middle of its ranges [m/rad].
    m_per_rad: Vector3<f64>,
}

impl TipPath {
    /// Of an arm.
    #[must_use]
    pub(super) fn of(arm: &Arm) -> Self {
        let middle = Vector3::from_fn(|j, _| 0.5 * (arm.limits[j][0] + arm.limits[j][1]));
        let lever_m = arm.kinematics.forward(&middle).norm();
        Self { m_per_rad: Vector3::new(lever_m, lever_m, 1.0).component_div(&arm.transmission.ratio).abs() }
    }

    /// Path [m] while the motors turn by `turned` [rad] without turning round.
    #[must_use]
    pub(super) fn m(&self, turned: &Vector3<f64>) -> f64 {
        self.m_per_rad.component_mul(turned).norm()
    }
}
