//! Where the cameras are, from the marker at the hard stop (the paper's eq. 1).
//!
//! The rotation is that of the mount. At the hard stop the joints are where the encoders are set, so the tip is known:
//!
//! ```text
//! t = p_hs - R p_left
//! ```

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use raven::camera::Cameras;
use raven::cli;
use raven::log::{MotorSource, RAVEN_STATE_TYPE, Recording, Side, Survey};
use raven::robot::{Arm, Robot};
use raven::{Error, Result};
use raven_track::batches;
use raven_track::look::Marker;
use raven_track::marker_position::{Gathered, Place, the_only};

/// Upper bounds of how far each joint is from where the encoders believe it at the hard stop [rad, rad, m]: the public controller takes its
/// zero when the motors reach their homing current, with cables stretched by up to this much at the published stiffness.
pub const HOMING_STRETCH: [f64; 3] = [0.06 * std::f64::consts::PI / 180.0, 0.58 * std::f64::consts::PI / 180.0, 4.1e-3];
/// A tip that the motors put farther than this from the hard stop is not there [m]: more than stretch and a wrong radius can do.
const AT_HARD_STOP_M: f64 = 0.01;
/// A tip that the motors move by more than this is not at rest [m].
const AT_REST_M: f64 = 0.0005;

/// A registration at the hard stop.
#[derive(Debug, Clone)]
pub struct AtHardStop {
    /// `x_0 = R x_left + t`.
    pub base_from_left: Isometry3<f64>,
    /// Covariance of the tip there as the cameras see it, in frame 0 [m^2]: frames, calibration, tolerances, and what homing may stretch.
    pub covariance: Matrix3<f64>,
    /// The same without what homing may stretch [m^2].
    pub covariance_rigid: Matrix3<f64>,
    /// The marker, in the left camera's frame [m].
    pub place: Place,
    /// Pairs of frames at the hard stop.
    pub frames: usize,
    /// Frames that were cut off, could not be decoded or have another size than was calibrated.
    pub lost: usize,
}

/// Registers cameras that are mounted with `rotation` (`x_0 = R x_left + t`) from a recording at the hard stop.
///
/// # Errors
/// If a camera is missing, motors are recorded but cannot be read, the robot is not at its hard stop in the recording, or the marker is not
/// the only thing of its kind in view.
pub fn register(log: &Path, robot: &Robot, cameras: &Cameras, marker: &Marker, rotation: &Rotation3<f64>) -> Result<AtHardStop> {
    let arm = robot.arm()?;
    let recording = Recording::read(log, &MotorSource::from(robot))?;
    require_recorded_motors(&recording, robot)?;
    let stop = HardStop::new(&arm, &recording);
    let (mut gathered, mut usable) = (Gathered::default(), [0_usize; 2]);
    let counts = batches::for_each(log, cameras, f64::INFINITY, |frames| {
        for (usable, frame) in usable.iter_mut().zip(frames) {
            *usable += usize::from(frame.is_some());
        }
        if let [Some(left), Some(right)] = frames
            && stop.holds_at(left.stamp.seconds_since(recording.start))
        {
            gathered.add(cameras, marker, [&left.image, &right.image]);
        }
    })?;
    require_both_cameras(&recording, usable)?;
    stop.check(log, gathered.frames())?;
    let place = the_only(log, &gathered.places(), || {
        format!(
            "the marker was seen by both cameras at once in none of {} pairs of frames: no two blobs of its colour meet in space with its size. \
             Check --hue, --min-saturation, --min-value, --marker-radius and that it is visible.",
            gathered.frames()
        )
    })?;
    let translation = stop.tip - rotation * place.point_left;
    let seen = seen_covariance(cameras, &place, rotation);
    Ok(AtHardStop {
        base_from_left: Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::from_rotation_matrix(rotation)),
        covariance: seen + stop_covariance(robot, &arm, &HOMING_STRETCH),
        covariance_rigid: seen + stop_covariance(robot, &arm, &[0.0; 3]),
        place,
        frames: gathered.frames(),
        lost: counts.lost(),
    })
}

/// Refuses a log whose motors cannot be read, or are where the robot file does not look: what they say of the hard stop is not passed over.
fn require_recorded_motors(recording: &Recording, robot: &Robot) -> Result<()> {
    let named = recording.topics.get(&robot.source.topic).is_some_and(|&messages| messages > 0);
    if named || has_motors(&Survey::of(&recording.path)?) {
        recording.motor_track()?;
    }
    Ok(())
}

/// Whether a log has motors of any kind.
fn has_motors(survey: &Survey) -> bool {
    let of_robot = survey.topics.iter().any(|topic| topic.schema == RAVEN_STATE_TYPE && topic.quality.messages > 0);
    of_robot || survey.motor_source().is_some()
}

/// Refuses a log with a camera of which no frame can be used; `usable` counts the others, left and right.
fn require_both_cameras(recording: &Recording, usable: [usize; 2]) -> Result<()> {
    let Some(side) = Side::BOTH.into_iter().find(|&side| usable[side as usize] == 0) else { return Ok(()) };
    let (topic, count) = recording.require_images(side)?;
    let message = format!(
        "none of the {count} images of the {} camera on `{topic}` is whole, can be decoded and has the size that was calibrated; both cameras \
         are needed.",
        side.name()
    );
    Err(Error::file(&recording.path, message))
}

/// What the motors say about the hard stop.
struct HardStop<'a> {
    arm: &'a Arm,
    recording: &'a Recording,
    tip: Vector3<f64>,
}

impl<'a> HardStop<'a> {
    fn new(arm: &'a Arm, recording: &'a Recording) -> Self {
        Self { arm, recording, tip: arm.kinematics.forward(&arm.hard_stop) }
    }

    /// How far the motors put the tip from the hard stop at a time since the start [m]; `None` where they are not recorded.
    fn distance_m(&self, time_s: f64) -> Option<f64> {
        let motor = self.recording.motor.as_ref()?;
        let angles = Vector3::new(motor.interpolate(0, time_s)?, motor.interpolate(1, time_s)?, motor.interpolate(2, time_s)?);
        let joints = self.arm.transmission.joint_from_motor(&angles);
        Some((self.arm.kinematics.forward(&joints) - self.tip).norm())
    }

    /// Whether the robot is at the hard stop, as far as the motors say.
    fn holds_at(&self, time_s: f64) -> bool {
        self.recording.motor.is_none() || self.distance_m(time_s).is_some_and(|d| d < AT_HARD_STOP_M)
    }

    /// Refuses a recording without a pair of frames at the hard stop, and warns of one that moves or has no motors.
    fn check(&self, log: &Path, frames: usize) -> Result<()> {
        let times = self.recording.motor.iter().flat_map(|motor| &motor.time_s);
        let distances: Vec<f64> = times.filter_map(|&t| self.distance_m(t)).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let farthest = distances.iter().copied().fold(0.0, f64::max);
        if frames == 0 {
            let sentence = if (AT_HARD_STOP_M..f64::INFINITY).contains(&nearest) {
                let nearest_mm = 1e3 * nearest;
                format!(
                    "the robot is never at its hard stop in this recording: its motors put the tip {nearest_mm:.1} mm away at the nearest. Record \
                     at the hard stop after homing, or check joints.*.hard_stop in the robot file."
                )
            } else {
                "no left and right image were taken together while the robot was at its hard stop; record both cameras for a second or more \
                 while it rests there."
                    .to_owned()
            };
            return Err(Error::file(log, sentence));
        }
        if self.recording.motor.is_none() {
            cli::warn("the log has no motor positions: that the robot stood at its hard stop is taken for granted.");
        }
        let at_stop = distances.iter().copied().filter(|&d| d < AT_HARD_STOP_M).fold(0.0, f64::max);
        if at_stop - nearest > AT_REST_M {
            let moved_mm = 1e3 * (at_stop - nearest);
            cli::warn(&format!("the motors move the tip by {moved_mm:.1} mm while it should rest at the hard stop."));
        } else if farthest > AT_HARD_STOP_M {
            cli::warn(&format!(
                "the robot leaves its hard stop in this recording; {frames} pairs of frames before or after that are used."
            ));
        }
        Ok(())
    }
}

/// Covariance of the marker as the cameras see it, in frame 0 [m^2]: scatter of the frames, and the calibration's focal length, principal
/// point and baseline.
fn seen_covariance(cameras: &Cameras, place: &Place, rotation: &Rotation3<f64>) -> Matrix3<f64> {
    let depth = place.point_left.z;
    let [fx, fy, cx, cy] = cameras.quality.left_std.unwrap_or_default();
    let baseline = cameras.quality.baseline_std_m.unwrap_or_default() / cameras.baseline_m();
    let (focal, focal_v) = (fx / cameras.left.fx, fy / cameras.left.fy);
    let along = place.point_left * (focal * focal + baseline * baseline).sqrt();
    let across = Vector3::new(depth * cx / cameras.left.fx, depth * cy.hypot(focal_v * place.point_left.y / depth) / cameras.left.fy, 0.0);
    let calibration = along * along.transpose() + Matrix3::from_diagonal(&across.component_mul(&across));
    rotation.matrix() * (place.covariance + calibration) * rotation.matrix().transpose()
}

/// Covariance of the tip at the hard stop [m^2]: what the robot file's hard stops are good for, and joints that homing stretches, uniform up
/// to `stretch` either way.
fn stop_covariance(robot: &Robot, arm: &Arm, stretch: &[f64; 3]) -> Matrix3<f64> {
    let jacobian = arm.kinematics.jacobian(&arm.hard_stop);
    let variance = Vector3::from_fn(|j, _| {
        let nominal = robot.joints.get(j).map_or(0.0, |joint| robot.tolerances.hard_stop_of(joint.kind));
        nominal * nominal + stretch[j] * stretch[j] / 3.0
    });
    jacobian * Matrix3::from_diagonal(&variance) * jacobian.transpose()
}
