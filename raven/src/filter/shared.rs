//! What all tips of a recording share: a registration that is off moves every one of them, and no filter averages that away.
//!
//! A bias that may be degrees follows the cameras wherever they see the joints, so that what moves all tips alike moves the joints by as much:
//!
//! ```text
//! P + J^-1 C J^-T
//! ```
//!
//! with `C` the covariance that all tips near one share; unknowns that are considered and not estimated (Schmidt 1966), here with the gain that the
//! cameras have over seconds.

use nalgebra::{Matrix3, Vector3};

use super::{FilterRun, JointTrack};
use crate::robot::Kinematics;

impl FilterRun {
    /// With deviations that hold the covariance which all tips near one [m] share [m^2, frame 0], of a run that follows the cameras. Where nothing is
    /// known of it, or the tip says nothing of a joint, at the remote centre, they stay as they are.
    #[must_use]
    pub fn with_shared(mut self, kinematics: &Kinematics, shared_m2: impl Fn(&Vector3<f64>) -> Option<Matrix3<f64>>) -> Self {
        widen(&mut self.smoothed, kinematics, &shared_m2);
        let variances = widen(&mut self.filtered, kinematics, &shared_m2);
        let mean = variances.iter().sum::<Vector3<f64>>() / variances.len() as f64;
        self.shared_std = (!variances.is_empty()).then(|| mean.map(f64::sqrt));
        self
    }
}

/// Puts what tips share into a track's deviations; its variances wherever that could be [rad^2, rad^2, m^2].
fn widen(track: &mut JointTrack, kinematics: &Kinematics, shared_m2: impl Fn(&Vector3<f64>) -> Option<Matrix3<f64>>) -> Vec<Vector3<f64>> {
    let widened = track.joints.iter().zip(&mut track.factor).filter_map(|(joints, factor)| {
        let per_tip = kinematics.jacobian(joints).try_inverse()?;
        let shared = per_tip * shared_m2(&kinematics.forward(joints))? * per_tip.transpose();
        *factor = (*factor * factor.transpose() + shared).cholesky()?.l();
        Some(shared.diagonal())
    });
    widened.collect()
}
