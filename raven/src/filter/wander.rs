//! How the transmission bias wanders: with time, as cables creep and warm, and with the cable's travel, as hysteresis, friction and
//! eccentric pulleys act only while something moves.
//!
//! ```text
//! var(b_j) grows by  a_j^2 dt + c_j^2 ds_j,     s_j: path that cable j has travelled, at the joint
//! ```

use std::ops::AddAssign;

use nalgebra::Vector3;

use crate::robot::{MotorTrack, Transmission};

/// Random walk of the bias of three joints, over time and over travel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wander {
    /// [rad, rad, m per sqrt(s)].
    pub with_time: Vector3<f64>,
    /// [rad, rad, m per sqrt of the joint's travel in rad, rad, m].
    pub with_travel: Vector3<f64>,
}

impl Wander {
    /// A wander with time alone.
    #[must_use]
    pub fn over_time(with_time: Vector3<f64>) -> Self {
        Self { with_time, with_travel: Vector3::zeros() }
    }

    /// Variances [rad^2, rad^2, m^2] that gather in `step_s` and over a path of `travel` [rad, rad, m].
    #[must_use]
    pub fn variance(&self, step_s: f64, travel: &Vector3<f64>) -> Vector3<f64> {
        self.with_time.component_mul(&self.with_time) * step_s + self.with_travel.component_mul(&self.with_travel).component_mul(travel)
    }
}

/// Path of each cable, expressed at its joint [rad, rad, m], while the motors turn by `turned` [rad] without turning round.
#[must_use]
pub fn travel(transmission: &Transmission, turned: &Vector3<f64>) -> Vector3<f64> {
    turned.component_div(&transmission.ratio).abs()
}

/// What gathers from the start of a track to each of its samples, where motors that turn by so much [rad] add `of` it.
pub(super) fn gathered<T: Copy + AddAssign>(motor: &MotorTrack, of: impl Fn(&Vector3<f64>) -> T) -> Vec<T> {
    let mut sum = of(&Vector3::zeros());
    let mut last = motor.angle.first().copied();
    let step = |angle: &Vector3<f64>| {
        if let Some(before) = last.replace(*angle) {
            sum += of(&(angle - before));
        }
        sum
    };
    motor.angle.iter().map(step).collect()
}
