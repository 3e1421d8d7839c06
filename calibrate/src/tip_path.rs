//! Where the motors put the tip over time, as if no cable stretched.

use nalgebra::Vector3;
use raven::log::Recording;
use raven::robot::Arm;

/// The tip's path in frame 0 by the motors of a recording.
#[derive(Debug, Clone, Copy)]
pub struct TipPath<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// Its recording.
    pub recording: &'a Recording,
}

/// Half of the interval over which the speed is taken [s].
const STEP_S: f64 = 0.005;

impl TipPath<'_> {
    /// The tip [m] at a time since the start of the recording [s]; `None` where the motors are not recorded.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Vector3<f64>> {
        let motor = self.recording.motor.as_ref()?;
        let angles = Vector3::new(motor.interpolate(0, time_s)?, motor.interpolate(1, time_s)?, motor.interpolate(2, time_s)?);
        Some(self.arm.kinematics.forward(&self.arm.transmission.joint_from_motor(&angles)))
    }

    /// The tip [m] and its velocity [m/s].
    #[must_use]
    pub fn with_velocity(&self, time_s: f64) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let (before, after) = (self.at(time_s - STEP_S)?, self.at(time_s + STEP_S)?);
        Some((self.at(time_s)?, (after - before) / (2.0 * STEP_S)))
    }

    /// The tip with the joints where the encoders are set [m].
    #[must_use]
    pub fn at_hard_stop(&self) -> Vector3<f64> {
        self.arm.kinematics.forward(&self.arm.hard_stop)
    }
}
