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
    /// Where the shaft goes from there in the image, unit length; `None` where it goes along the line of sight.
    pub shaft: Option<Vector2<f64>>,
}

/// A step along the shaft [m], and the least part of it that is to be seen across the line of sight.
const STEP_M: f64 = 5e-3;
const ACROSS: f64 = 0.2;

/// How a camera sees a tip in frame 0, whose shaft goes through the remote centre, frame 0's origin; `None` without registration, behind the camera or
/// more than an image's width outside the image.
#[must_use]
pub fn view(cameras: &Cameras, side: Side, tip: &Vector3<f64>) -> Option<View> {
    let left_from_base = cameras.base_from_left?.inverse();
    let (camera, from_base) = match side {
        Side::Left => (&cameras.left, left_from_base),
        Side::Right => (&cameras.right, cameras.right_from_left * left_from_base),
    };
    let [point, centre] = [*tip, Vector3::zeros()].map(|point| (from_base * Point3::from(point)).coords);
    let pixel = camera.project(&point)?;
    let near = camera.contains(&pixel, -f64::from(camera.width));
    let px_per_m = (camera.fx * camera.fy).sqrt() / point.z;
    let along = (centre - point).try_normalize(STEP_M).and_then(|along| camera.project(&(point + STEP_M * along)));
    let shaft = along.and_then(|along_px| (along_px - pixel).try_normalize(ACROSS * STEP_M * px_per_m));
    near.then_some(View { pixel, px_per_m, shaft })
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::Isometry3;
    use raven::camera::{Pinhole, Quality};

    use super::*;

    #[test]
    fn the_shaft_goes_towards_the_remote_centre() {
        let camera = Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, distortion: [0.0; 5] };
        // The remote centre lies 0.4 m before the left camera, 50 mm above its middle.
        let cameras = Cameras {
            left: camera,
            right: camera,
            right_from_left: Isometry3::translation(-0.05, 0.0, 0.0),
            base_from_left: Some(Isometry3::translation(0.0, 0.05, -0.4)),
            latency_s: 0.0,
            right_minus_left_s: 0.0,
            quality: Quality::default(),
        };
        let shaft = |side: Side, tip: [f64; 3]| view(&cameras, side, &Vector3::from(tip)).unwrap().shaft;
        let below = [0.0, 0.08, -0.02];
        assert_relative_eq!(shaft(Side::Left, below).unwrap(), Vector2::new(0.0, -1.0), epsilon = 1e-9);
        // Seen from the right, what is nearer lies farther left.
        let centre_px = cameras.project_base(&Vector3::zeros()).unwrap()[1];
        let tip_px = cameras.project_base(&Vector3::from(below)).unwrap()[1];
        assert_relative_eq!(shaft(Side::Right, below).unwrap(), (centre_px - tip_px).normalize(), epsilon = 1e-6);
        // Along the line of sight, and at the remote centre.
        assert_eq!([[0.0, 0.005, -0.04], [0.0; 3]].map(|tip| shaft(Side::Left, tip)), [None; 2]);
    }
}
