//! Where the cameras should have seen the tip, for a robot file and what it says about the observation.
//!
//! A tip stamped `t` is where the robot had it at `t - latency`. There the joints rest where the cables hold them,
//!
//! ```text
//! q = q_rigid(q_m) - (1 + C)^-1 x / r_l,   gamma(x) = (1 + C)'^-1 (G(q) + F_c tanh(qd / v_s)) / r_l
//! ```
//!
//! with the motors' direction of motion for the friction's. Leaving out inertia and cable damping costs 1e-4 rad rms and 6 um on
//! motions of 0.8 rad/s. The prediction is then moved as the registration is off, `p_seen = R' (p - p_hs - translation) + p_hs`, so
//! that it meets the sighting, and the sighting's covariance, in the frame in which they were recorded.

use nalgebra::{Matrix3, Rotation3, Vector3};
use raven::Result;
use raven::robot::{LinkModel, Observation, Robot, STICTION_SPEED};

use crate::motion::Motion;

/// Predicts sightings from motors.
#[derive(Debug, Clone)]
pub struct Predictor {
    model: LinkModel,
    latency_s: f64,
    seen_from_true: Rotation3<f64>,
    translation_m: Vector3<f64>,
    tip_at_hard_stop_m: Vector3<f64>,
}

impl Predictor {
    /// For a robot file.
    ///
    /// # Errors
    /// If it describes no arm.
    pub fn new(robot: &Robot) -> Result<Self> {
        let arm = robot.arm()?;
        let Observation { latency, rotation, translation } = robot.observation;
        Ok(Self {
            latency_s: latency,
            seen_from_true: Rotation3::new(Vector3::from(rotation)).inverse(),
            translation_m: Vector3::from(translation),
            tip_at_hard_stop_m: arm.kinematics.forward(&arm.hard_stop),
            model: LinkModel::new(arm),
        })
    }

    /// Joint positions [rad, rad, m] at a time of the robot.
    #[must_use]
    pub fn joints(&self, motion: &Motion, time_s: f64) -> Vector3<f64> {
        let transmission = &self.model.arm().transmission;
        let rate = transmission.joint_rate_from_motor(&motion.rate_rad_s(time_s));
        let direction = Vector3::from_fn(|j, _| (rate[j] / STICTION_SPEED[j]).tanh());
        self.model.settled(&motion.angle_rad(time_s), &direction)
    }

    /// Where the tip with stamp `time_s` should have been seen [m].
    #[must_use]
    pub fn seen_m(&self, motion: &Motion, time_s: f64) -> Vector3<f64> {
        let tip = self.model.arm().kinematics.forward(&self.joints(motion, time_s - self.latency_s));
        self.seen_from_true * (tip - self.tip_at_hard_stop_m - self.translation_m) + self.tip_at_hard_stop_m
    }

    /// How that moves with the joints, 3x3 [m/rad, m/rad, 1].
    #[must_use]
    pub fn seen_from_joints(&self, motion: &Motion, time_s: f64) -> Matrix3<f64> {
        self.seen_from_true * self.model.arm().kinematics.jacobian(&self.joints(motion, time_s - self.latency_s))
    }
}
