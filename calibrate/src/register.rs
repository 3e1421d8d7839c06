//! `raven-calibrate register`: where the cameras are in the robot's frame 0, from the marker at the hard stop (the paper's eq. 1).
//!
//! The rotation is that of the mount. At the hard stop the joints are where the encoders are set, so the tip is known:
//!
//! ```text
//! t = p_hs - R p_left
//! ```
//!
//! The standard deviation of `t` is that of the tip with the rotation as it is; an error of the rotation turns the rig about that tip.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::log::{MotorSource, Recording};
use raven::robot::{Arm, Robot};
use raven::{Error, Result};
use raven_track::batches;
use raven_track::colour::MarkerColour;
use raven_track::look::Marker;
use raven_track::marker::Centre;
use serde::Serialize;

use crate::marker_position::{Gathered, Place};
use crate::mount::Mount;

/// Register the cameras to the robot from a recording at the hard stop.
///
/// Example: raven-calibrate register hardstop.mcap --robot robot.yaml --cameras cameras.yaml -o cameras.yaml
#[derive(Debug, Clone, Args)]
pub struct RegisterArgs {
    /// A recording with the robot at its hard stop and the marker in both images.
    pub log: PathBuf,
    /// The robot file.
    #[arg(long, value_name = "FILE")]
    pub robot: PathBuf,
    /// The calibrated cameras.
    #[arg(long, value_name = "FILE")]
    pub cameras: PathBuf,
    /// How the left camera is mounted: each axis of frame 0 as an axis of the camera (x right, y down, z along the view).
    #[arg(long, value_name = "AXES", default_value = "x0=-y y0=z z0=-x")]
    pub rotation: String,
    /// How well the mount is set about each axis, one sigma [deg]. By hand and eye it is about a degree.
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = degrees)]
    pub rotation_std_deg: f64,
    /// Where to write the registered cameras.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Hue of the marker [deg]: 90..150 is green, 340..20 red.
    #[arg(long, value_name = "FROM..TO", default_value = "90..150", value_parser = hue)]
    pub hue: [f64; 2],
    /// Radius of the marker [m].
    #[arg(long, value_name = "M", default_value_t = 0.005, value_parser = radius)]
    pub marker_radius: f64,
}

fn within(text: &str, range: std::ops::RangeInclusive<f64>, what: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| format!("`{text}` is no number"))?;
    if range.contains(&value) { Ok(value) } else { Err(format!("{value} is not between {} and {} {what}", range.start(), range.end())) }
}

fn degrees(text: &str) -> Result<f64, String> {
    within(text, 0.0..=30.0, "deg")
}

fn radius(text: &str) -> Result<f64, String> {
    within(text, 5e-4..=0.1, "m; is it in millimetres?")
}

fn hue(text: &str) -> Result<[f64; 2], String> {
    let (from, to) = text.split_once("..").ok_or_else(|| format!("`{text}` is no range of degrees such as 90..150"))?;
    Ok([within(from, 0.0..=360.0, "deg")?, within(to, 0.0..=360.0, "deg")?])
}

/// The result as scripts read it.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// `x_0 = R x_left + t`.
    pub base_from_left: PoseReport,
    /// Standard deviation of the tip at the hard stop as the cameras see it [m].
    pub translation_std_m: [f64; 3],
    /// Standard deviation of the rotation about each axis of frame 0 [rad].
    pub rotation_std_rad: [f64; 3],
    /// By how much images show the past [s]; a robot at rest does not tell.
    pub latency_s: Option<f64>,
    /// Standard deviation of the latency [s].
    pub latency_std_s: Option<f64>,
    /// Marker in the left camera's frame [m].
    pub marker_left_m: [f64; 3],
    /// Frames in which the marker was seen.
    pub frames_seen: usize,
    /// Pairs of frames at the hard stop.
    pub frames: usize,
}

/// A rotation and a shift.
#[derive(Debug, Clone, Serialize)]
pub struct PoseReport {
    /// Row by row.
    pub rotation: [f64; 9],
    /// [m].
    pub translation: [f64; 3],
}

/// Upper bounds of how far each joint is from where the encoders believe it at the hard stop [rad, rad, m]: the public controller takes its
/// zero when the motors reach their homing current, with cables stretched by up to this much at the published stiffness.
const HOMING_STRETCH: [f64; 3] = [0.06 * std::f64::consts::PI / 180.0, 0.58 * std::f64::consts::PI / 180.0, 4.1e-3];
/// A tip that the motors put farther than this from the hard stop is not there [m]: more than stretch and a wrong radius can do.
const AT_HARD_STOP_M: f64 = 0.01;
/// A tip that the motors move by more than this is not at rest [m].
const AT_REST_M: f64 = 0.0005;

/// Runs the command; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is missing, or why the recording does not determine the registration.
pub fn run(args: &RegisterArgs, out: &mut dyn Write) -> Result<Outcome> {
    if args.rotation.trim() == "estimate" {
        return Err(Error::Argument(
            "--rotation estimate is not available: give the mount's rotation, such as 'x0=-y y0=z z0=-x', and let raven-identify estimate \
             what is left of rotation and latency together with the robot."
                .to_owned(),
        ));
    }
    let mount: Mount = args.rotation.parse().map_err(|e| Error::Argument(format!("--rotation: {e}.")))?;
    let robot = Robot::read(&args.robot)?;
    let arm = robot.arm()?;
    let mut cameras = Cameras::read(&args.cameras)?;
    let recording = Recording::read(&args.log, &MotorSource::from(&robot))?;
    let stop = HardStop::new(&arm, &recording);
    let marker = Marker {
        colour: MarkerColour { hue_deg: args.hue, ..MarkerColour::default() },
        radius_m: args.marker_radius,
        centre: Centre::Ball,
    };
    let mut gathered = Gathered::default();
    let counts = batches::for_each(
        &args.log,
        &cameras,
        f64::INFINITY,
        |_, _| None,
        |frames| {
            if let [Some(left), Some(right)] = frames
                && stop.holds_at(left.stamp().seconds_since(recording.start))
            {
                gathered.add(&cameras, &marker, [&left.whole(), &right.whole()]);
            }
        },
    )?;
    stop.check(&args.log, gathered.frames())?;
    let place = the_marker(&args.log, &gathered)?;
    let rotation = mount.base_from_left;
    let tip = arm.kinematics.forward(&arm.hard_stop);
    let translation = tip - rotation * place.point_left;
    let covariance = seen_covariance(&cameras, &place, &rotation) + stop_covariance(&robot, &arm);
    let translation_std_m = [0, 1, 2].map(|i| covariance[(i, i)].sqrt());
    let rotation_std_rad = [args.rotation_std_deg.to_radians(); 3];
    cameras.base_from_left = Some(Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::from_rotation_matrix(&rotation)));
    cameras.quality = Quality {
        registration_rotation_std_rad: Some(rotation_std_rad),
        registration_translation_std_m: Some(translation_std_m),
        ..cameras.quality
    };
    if let Some(output) = &args.output {
        cameras.write(output)?;
    }
    let report = Report {
        base_from_left: PoseReport {
            rotation: rotation.matrix().transpose().as_slice().try_into().unwrap_or_default(),
            translation: translation.into(),
        },
        translation_std_m,
        rotation_std_rad,
        latency_s: None,
        latency_std_s: None,
        marker_left_m: place.point_left.into(),
        frames_seen: place.frames,
        frames: gathered.frames(),
    };
    out.write_all(text(&report, &tip, args).as_bytes()).map_err(|e| Error::io(Path::new("-"), "write", e))?;
    if let Some(json) = &args.json {
        cli::write_json(json, &report)?;
    }
    Ok(if counts.undecodable > 0 { Outcome::DataLost } else { Outcome::Done })
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

    /// Refuses a recording that is never at the hard stop, and warns of one that moves or has no motors.
    fn check(&self, log: &Path, frames: usize) -> Result<()> {
        let Some(motor) = &self.recording.motor else {
            cli::warn("the log has no motor positions: that the robot stood at its hard stop is taken for granted.");
            return if frames > 0 { Ok(()) } else { Err(Error::file(log, "no left and right frame lie within one period.")) };
        };
        let distances: Vec<f64> = motor.time_s.iter().filter_map(|&t| self.distance_m(t)).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let farthest = distances.iter().copied().fold(0.0, f64::max);
        if frames == 0 {
            let nearest_mm = 1e3 * nearest;
            let sentence = format!(
                "the robot is never at its hard stop in this recording: its motors put the tip {nearest_mm:.1} mm away at the nearest. Record \
                 at the hard stop after homing, or check joints.*.hard_stop in the robot file."
            );
            return Err(Error::file(log, sentence));
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

/// The one place that can be the marker.
fn the_marker(log: &Path, gathered: &Gathered) -> Result<Place> {
    let places = gathered.places();
    let listed = |place: &Place| {
        let [x, y, z] = (place.point_left * 1e3).into();
        format!("({x:.0}, {y:.0}, {z:.0}) mm in {} frames", place.frames)
    };
    match places.as_slice() {
        [one] => Ok(one.clone()),
        [] => Err(Error::file(
            log,
            format!(
                "the marker was seen by both cameras at once in none of {} pairs of frames: no two blobs of its colour meet in space with its \
                 size. Check --hue, --marker-radius and that it is visible.",
                gathered.frames()
            ),
        )),
        several => {
            let list: Vec<String> = several.iter().map(listed).collect();
            let sentence = format!(
                "several things of the marker's colour and size are in view, at {} before the left camera. Cover all but the marker.",
                list.join(" and at ")
            );
            Err(Error::file(log, sentence))
        }
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

/// Covariance of the tip at the hard stop [m^2]: what the robot file's hard stops are good for, and cables stretched by homing, uniform up
/// to the bound either way.
fn stop_covariance(robot: &Robot, arm: &Arm) -> Matrix3<f64> {
    let jacobian = arm.kinematics.jacobian(&arm.hard_stop);
    let variance = Vector3::from_fn(|j, _| {
        let nominal = robot.joints.get(j).map_or(0.0, |joint| robot.tolerances.hard_stop_of(joint.kind));
        nominal * nominal + HOMING_STRETCH[j] * HOMING_STRETCH[j] / 3.0
    });
    jacobian * Matrix3::from_diagonal(&variance) * jacobian.transpose()
}

fn text(report: &Report, tip: &Vector3<f64>, args: &RegisterArgs) -> String {
    let millimetres = |v: [f64; 3]| v.map(|x| format!("{:.2}", 1e3 * x)).join(", ");
    format!(
        "marker seen in {} of {} pairs of frames at ({}) mm before the left camera\n\
         tip at the hard stop   ({}) mm in frame 0\n\
         base_from_left: t      ({}) mm, one sigma ({}) mm with the rotation as it is\n\
         rotation {}, one sigma {} deg about the tip at the hard stop\n",
        report.frames_seen,
        report.frames,
        millimetres(report.marker_left_m),
        millimetres((*tip).into()),
        millimetres(report.base_from_left.translation),
        millimetres(report.translation_std_m),
        args.rotation.trim(),
        args.rotation_std_deg,
    )
}
