//! Where the robot's own kinematics put the marker in an image: motor angles at the frame's time, transmission, forward kinematics,
//! projection.

use nalgebra::{Point3, Vector2, Vector3};
use raven::camera::Cameras;
use raven::log::{JointSeries, Recording, Side, Stamp};
use raven::robot::{Arm, Robot};
use raven::{Error, Result};

/// The tip in frame 0 as the motors have it.
#[derive(Debug)]
pub struct Predictor<'r> {
    motor: &'r JointSeries,
    start: Stamp,
    latency_s: f64,
    arm: Arm,
}

impl<'r> Predictor<'r> {
    /// For one recording; `latency_s` is by how much an image shows the past of its stamp.
    ///
    /// # Errors
    /// If the robot is no arm or the log lacks its motors.
    pub fn new(recording: &'r Recording, robot: &Robot, latency_s: f64) -> Result<Self> {
        let arm = robot.arm()?;
        let motor = recording.require_motor()?;
        if motor.position.len() < 3 {
            let message = format!("the log has {} motors on `{}`, expected three.", motor.position.len(), robot.source.topic);
            return Err(Error::file(&recording.path, message));
        }
        Ok(Self { motor, start: recording.start, latency_s, arm })
    }

    /// Tip [m, frame 0] at the exposure of a frame; `None` where the log has no motor angles.
    #[must_use]
    pub fn tip(&self, frame: Stamp) -> Option<Vector3<f64>> {
        let time_s = frame.seconds_since(self.start) - self.latency_s;
        let [a, b, c] = [0, 1, 2].map(|joint| self.motor.interpolate(joint, time_s));
        let motor = Vector3::new(a?, b?, c?);
        Some(self.arm.kinematics.forward(&self.arm.transmission.joint_from_motor(&motor)))
    }

    /// The tip where the encoders are set [m, frame 0].
    #[must_use]
    pub fn hard_stop_tip(&self) -> Vector3<f64> {
        self.arm.kinematics.forward(&self.arm.hard_stop)
    }

    /// Time of a frame since the start of the recording [s].
    #[must_use]
    pub fn seconds(&self, frame: Stamp) -> f64 {
        frame.seconds_since(self.start)
    }

    /// Name of the arm's frame 0.
    #[must_use]
    pub fn frame_id(&self) -> &'static str {
        self.arm.kinematics.arm.frame0()
    }
}

/// A ball in one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Its centre [px].
    pub pixel: Vector2<f64>,
    /// Pixels per metre across the line of sight at its depth [px/m].
    pub px_per_m: f64,
}

/// How a camera sees a point of frame 0; `None` without registration, behind the camera or more than an image's width outside the image.
#[must_use]
pub fn view(cameras: &Cameras, side: Side, tip: &Vector3<f64>) -> Option<View> {
    let left = cameras.base_from_left?.inverse_transform_point(&Point3::from(*tip));
    let (camera, point) = match side {
        Side::Left => (&cameras.left, left.coords),
        Side::Right => (&cameras.right, (cameras.right_from_left * left).coords),
    };
    let pixel = camera.project(&point)?;
    let near = camera.contains(&pixel, -f64::from(camera.width));
    near.then(|| View { pixel, px_per_m: (camera.fx * camera.fy).sqrt() / point.z })
}
