//! What all tips of a recording share: a registration that is off moves every one of them, and no filter averages that away.
//!
//! A bias that may be degrees follows the cameras wherever they see the joints, so that what moves all tips alike moves the joints by as much:
//!
//! ```text
//! P + J^-1 [X 1] C [X 1]' J^-T
//! ```
//!
//! with `C` the covariance of the registration's pose and `[X 1]` how it moves a tip ([`moved_by_pose`]); unknowns that are considered and not
//! estimated (Schmidt 1966), here with the gain that the cameras have over seconds.

use nalgebra::{Matrix3, Matrix6, Vector3};

use super::{FilterRun, JointTrack};
use crate::observation::moved_by_pose;
use crate::robot::Arm;

impl FilterRun {
    /// With deviations in which the registration is unknown by so much of its pose [rad^2, rad m, m^2], of a run that follows the cameras. Where the
    /// tip says nothing of a joint, at the remote centre, they stay as they are.
    #[must_use]
    pub fn with_registration(mut self, arm: &Arm, pose: &Matrix6<f64>) -> Self {
        widen(&mut self.smoothed, arm, pose);
        let variances = widen(&mut self.filtered, arm, pose);
        let mean = variances.iter().sum::<Vector3<f64>>() / variances.len() as f64;
        self.registration_std = (!variances.is_empty()).then(|| mean.map(f64::sqrt));
        self
    }
}

/// Puts the registration into a track's deviations; its variances wherever that could be [rad^2, rad^2, m^2].
fn widen(track: &mut JointTrack, arm: &Arm, pose: &Matrix6<f64>) -> Vec<Vector3<f64>> {
    let widened = track.joints.iter().zip(&mut track.factor).filter_map(|(joints, factor)| {
        let shared = of_registration(arm, pose, joints)?;
        *factor = (*factor * factor.transpose() + shared).cholesky()?.l();
        Some(shared.diagonal())
    });
    widened.collect()
}

/// Covariance of joints [rad, rad, m] that follow the cameras, of what is unknown of the registration.
fn of_registration(arm: &Arm, pose: &Matrix6<f64>, joints: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let tip_from_pivot_m = arm.kinematics.forward(joints) - arm.kinematics.forward(&arm.hard_stop);
    let moved = arm.kinematics.jacobian(joints).try_inverse()? * moved_by_pose(&tip_from_pivot_m);
    Some(moved * pose * moved.transpose())
}
