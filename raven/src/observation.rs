//! From a log to what models and filters take in: motor angles, and tips at the robot's own times and in its own frame.

use nalgebra::{Rotation3, Vector3};

use crate::filter::TipAt;
use crate::log::{JointSeries, Recording, TipStatus};
use crate::robot::{Arm, MotorTrack, Observation};
use crate::{Error, Result};

impl Recording {
    /// Motor angles of the first three joints.
    ///
    /// # Errors
    /// If the log has no motor angles, or not of three joints.
    pub fn motor_track(&self) -> Result<MotorTrack> {
        let motor = self.require_motor()?;
        Ok(MotorTrack { time_s: motor.time_s.clone(), angle: three_joints(motor, self)? })
    }

    /// Tips that were seen, with latency and registration as `observation` corrects them, sorted by time.
    ///
    /// # Errors
    /// If the log has no tips.
    pub fn tips(&self, arm: &Arm, observation: &Observation) -> Result<Vec<TipAt>> {
        let correction = TipCorrection::new(arm, observation);
        let seen = self.require_tip()?.iter().filter(|tip| tip.status == TipStatus::Seen);
        let mut tips: Vec<TipAt> = seen
            .map(|tip| {
                let time_s = tip.stamp.seconds_since(self.start);
                correction.apply(&TipAt { time_s, position: tip.position_m, covariance: tip.covariance_m2 })
            })
            .filter(|tip| tip.position.iter().chain(tip.covariance.iter()).all(|v| v.is_finite()))
            .collect();
        tips.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok(tips)
    }
}

/// The first three joints of a series, sample by sample [rad, rad, m or rad].
///
/// # Errors
/// If the series has fewer joints.
pub fn three_joints(series: &JointSeries, recording: &Recording) -> Result<Vec<Vector3<f64>>> {
    let [first, second, third, ..] = series.position.as_slice() else {
        let message = format!("has {} joints in its joint messages, expected shoulder, elbow and insertion.", series.position.len());
        return Err(Error::file(&recording.path, message));
    };
    Ok((0..series.len()).map(|k| Vector3::new(first[k], second[k], third[k])).collect())
}

/// Takes latency and registration error out of observed tips.
#[derive(Debug, Clone, Copy)]
pub struct TipCorrection {
    latency_s: f64,
    rotation: Rotation3<f64>,
    translation: Vector3<f64>,
    pivot: Vector3<f64>,
}

impl TipCorrection {
    /// The correction that `observation` asks for; it turns about the tip at the hard stop.
    #[must_use]
    pub fn new(arm: &Arm, observation: &Observation) -> Self {
        Self {
            latency_s: observation.latency,
            rotation: Rotation3::new(Vector3::from(observation.rotation)),
            translation: Vector3::from(observation.translation),
            pivot: arm.kinematics.forward(&arm.hard_stop),
        }
    }

    /// The tip as the robot had it.
    #[must_use]
    pub fn apply(&self, tip: &TipAt) -> TipAt {
        let turn = self.rotation.matrix();
        TipAt {
            time_s: tip.time_s - self.latency_s,
            position: turn * (tip.position - self.pivot) + self.pivot + self.translation,
            covariance: turn * tip.covariance * turn.transpose(),
        }
    }

    /// Where cameras with these errors see a tip that the robot has at `position` [m]: the inverse of [`Self::apply`].
    #[must_use]
    pub fn seen_m(&self, position: &Vector3<f64>) -> Vector3<f64> {
        self.seen_from_true() * (position - self.pivot - self.translation) + self.pivot
    }

    /// How directions of frame 0 [1] look to the cameras: 3x3.
    #[must_use]
    pub fn seen_from_true(&self) -> Rotation3<f64> {
        self.rotation.inverse()
    }

    /// By how much an image shows the past of its stamp [s].
    #[must_use]
    pub fn latency_s(&self) -> f64 {
        self.latency_s
    }
}
