//! `raven-calibrate register`: where the cameras are in the robot's frame 0.
//!
//! The marker at the hard stop gives the place, with the rotation of the mount ([`crate::hard_stop`], the paper's eq. 1). A motion gives the
//! rotation too, the latency and the offset between the cameras ([`crate::from_motion`]).

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::{Isometry3, Matrix3};
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::robot::Robot;
use raven::{Error, Result};
use raven_track::appearance::{Appearance, number};
use raven_track::marker::Centre;
use serde::Serialize;

use crate::from_motion::{self, Before, FromMotion};
use crate::hard_stop::{self, AtHardStop};
use crate::mount::Mount;
use crate::moving::Moving;

/// Register the cameras to the robot from a recording at the hard stop, and from recordings of motion if there are any.
///
/// Example: raven-calibrate register hardstop.mcap --motion sinusoid.mcap --robot robot.yaml --cameras cameras.yaml -o cameras.yaml
#[derive(Debug, Clone, Args)]
pub struct RegisterArgs {
    /// A recording with the robot at its hard stop and the marker in both images.
    pub log: PathBuf,
    /// Moving recordings: the cameras' turn, their latency and the offset between them are then estimated too, with the robot's own numbers
    /// free.
    #[arg(long, value_name = "LOG")]
    pub motion: Vec<PathBuf>,
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
    /// What the marker looks like.
    #[command(flatten)]
    pub appearance: Appearance,
}

fn degrees(text: &str) -> Result<f64, String> {
    number(text, 0.0..=30.0, "deg")
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
    /// What a motion tells beside.
    pub motion: Option<MotionReport>,
    /// Marker in the left camera's frame [m].
    pub marker_left_m: [f64; 3],
    /// Frames in which the marker was seen.
    pub frames_seen: usize,
    /// Pairs of frames at the hard stop.
    pub frames: usize,
}

/// What a motion tells.
#[derive(Debug, Clone, Serialize)]
pub struct MotionReport {
    /// How much later than a left image the nearest right one is taken in the first recording, median [s].
    pub right_minus_left_s: f64,
    /// Its standard deviation [s].
    pub right_minus_left_std_s: f64,
    /// The same by the stamps alone [s].
    pub stamps_apart_s: f64,
    /// By how much more a right image shows the past than a left one of the same stamp [s]: the difference.
    pub right_latency_beyond_left_s: f64,
    /// Standard deviation of the tip as the cameras see it in the middle of the motion [m].
    pub workspace_std_m: [f64; 3],
    /// By how much the motion moves the tip at the hard stop, in frame 0 [m].
    pub hard_stop_moved_m: [f64; 3],
    /// The same as joints [rad, rad, m], and its standard deviation if the hard stop were rigid.
    pub hard_stop_joints: [[f64; 2]; 3],
    /// What each joint does beyond the model, one sigma [rad, rad, m].
    pub misfit: [f64; 3],
    /// The robot's numbers that were estimated along.
    pub robot: Vec<NumberReport>,
    /// Sightings of the tip used.
    pub sightings: usize,
    /// Left frames of the motion.
    pub frames: usize,
}

/// One number of the robot.
#[derive(Debug, Clone, Serialize)]
pub struct NumberReport {
    /// As `raven-identify` names it.
    pub name: String,
    /// Value, SI.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Value in the robot file.
    pub prior: f64,
}

/// A rotation and a shift.
#[derive(Debug, Clone, Serialize)]
pub struct PoseReport {
    /// Row by row.
    pub rotation: [f64; 9],
    /// [m].
    pub translation: [f64; 3],
}

/// Deviations by which a motion must contradict the hard stop to be worth a sentence.
const CONTRADICTS: f64 = 3.0;

/// Runs the command; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is missing, or why the recording does not determine the registration.
pub fn run(args: &RegisterArgs, out: &mut dyn Write) -> Result<Outcome> {
    if args.rotation.trim() == "estimate" {
        return Err(Error::Argument(
            "--rotation estimate is not available: give the mount's rotation, such as 'x0=-y y0=z z0=-x', to within 30 deg, with \
             --rotation-std-deg, and a moving recording with --motion."
                .to_owned(),
        ));
    }
    let mount: Mount = args.rotation.parse().map_err(|e| Error::Argument(format!("--rotation: {e}.")))?;
    let robot = Robot::read(&args.robot)?;
    let mut cameras = Cameras::read(&args.cameras)?;
    let marker = args.appearance.marker(Centre::Ball);
    let stop = hard_stop::register(&args.log, &robot, &cameras, &marker, &mount.base_from_left)?;
    let mut lost = stop.lost;
    let before = Before {
        base_from_left: stop.base_from_left,
        rotation_std_rad: [args.rotation_std_deg.to_radians(); 3],
        translation_std_m: deviations(&stop.covariance),
    };
    let mut report = report(&stop, &before);
    cameras.base_from_left = Some(before.base_from_left);
    if !args.motion.is_empty() {
        // What these were is found out anew.
        (cameras.latency_s, cameras.right_minus_left_s) = (0.0, 0.0);
        let follow = |log: &PathBuf| Moving::follow(log, &robot, &cameras, marker);
        let moving: Vec<Moving> = args.motion.iter().map(follow).collect::<Result<_>>()?;
        lost += moving.iter().map(|moving| moving.lost).sum::<usize>();
        let found = from_motion::register(&robot, &cameras, &before, &moving)?;
        report.take(&found, motion_report(&robot, &stop, &found, &moving)?, &stop);
        cameras.base_from_left = Some(found.base_from_left);
        (cameras.latency_s, cameras.right_minus_left_s) = (found.latency_s[0], found.right_minus_left_s[0]);
        cameras.quality.latency_std_s = Some(found.latency_s[1]);
        cameras.quality.right_minus_left_std_s = Some(found.right_minus_left_s[1]);
    }
    cameras.quality = Quality {
        registration_rotation_std_rad: Some(report.rotation_std_rad),
        registration_translation_std_m: Some(report.translation_std_m),
        ..cameras.quality
    };
    if let Some(output) = &args.output {
        cameras.write(output)?;
    }
    out.write_all(text(&report, &stop, args).as_bytes()).map_err(|e| Error::io(Path::new("-"), "write", e))?;
    report.motion.iter().filter_map(|motion| contradiction(motion, &robot)).for_each(|sentence| cli::warn(&sentence));
    if let Some(json) = &args.json {
        cli::write_json(json, &report)?;
    }
    Ok(if lost > 0 { Outcome::DataLost } else { Outcome::Done })
}

fn deviations(covariance: &Matrix3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|i| covariance[(i, i)].sqrt())
}

fn report(stop: &AtHardStop, before: &Before) -> Report {
    Report {
        base_from_left: PoseReport::of(&before.base_from_left),
        translation_std_m: before.translation_std_m,
        rotation_std_rad: before.rotation_std_rad,
        latency_s: None,
        latency_std_s: None,
        motion: None,
        marker_left_m: stop.place.point_left.into(),
        frames_seen: stop.place.frames,
        frames: stop.frames,
    }
}

impl PoseReport {
    fn of(pose: &Isometry3<f64>) -> Self {
        let rotation = pose.rotation.to_rotation_matrix();
        Self { rotation: std::array::from_fn(|i| rotation[(i / 3, i % 3)]), translation: pose.translation.vector.into() }
    }
}

impl Report {
    fn take(&mut self, found: &FromMotion, motion: MotionReport, stop: &AtHardStop) {
        self.base_from_left = PoseReport::of(&found.base_from_left);
        self.translation_std_m = found.std_at(&stop.tip, &stop.tip);
        self.rotation_std_rad = found.rotation_std_rad();
        (self.latency_s, self.latency_std_s) = (Some(found.latency_s[0]), Some(found.latency_s[1]));
        self.motion = Some(motion);
    }
}

fn motion_report(robot: &Robot, stop: &AtHardStop, found: &FromMotion, moving: &[Moving]) -> Result<MotionReport> {
    let arm = robot.arm()?;
    let into_joints = arm.kinematics.jacobian(&arm.hard_stop).try_inverse().unwrap_or_else(Matrix3::zeros);
    let moved = into_joints * found.moved_m;
    let covariance = into_joints * (stop.covariance_rigid + found.covariance.fixed_view::<3, 3>(3, 3)) * into_joints.transpose();
    let number =
        |(name, value, std, prior): &(String, f64, f64, f64)| NumberReport { name: name.clone(), value: *value, std: *std, prior: *prior };
    let stamps_apart_s = moving.first().map_or(f64::NAN, Moving::stamps_apart_s);
    Ok(MotionReport {
        right_minus_left_s: stamps_apart_s - found.right_minus_left_s[0],
        stamps_apart_s,
        right_latency_beyond_left_s: found.right_minus_left_s[0],
        right_minus_left_std_s: found.right_minus_left_s[1],
        workspace_std_m: found.std_at(&found.middle_m, &stop.tip),
        hard_stop_moved_m: found.moved_m.into(),
        hard_stop_joints: [0, 1, 2].map(|j| [moved[j], covariance[(j, j)].sqrt()]),
        misfit: found.misfit.into(),
        robot: found.robot.iter().map(number).collect(),
        sightings: found.sightings,
        frames: moving.iter().map(|moving| moving.frames).sum(),
    })
}

/// A sentence, if the motion puts the tip at the hard stop elsewhere than a rigid stop allows.
fn contradiction(motion: &MotionReport, robot: &Robot) -> Option<String> {
    let shown = |(j, [moved, std]): (usize, &[f64; 2])| {
        let joint = robot.joints.get(j).filter(|_| moved.abs() > CONTRADICTS * std)?;
        let (scale, unit) = if j == 2 { (1e3, "mm") } else { (180.0 / std::f64::consts::PI, "deg") };
        Some(format!("{} by {:.2} {unit} +- {:.2}", joint.name, scale * moved, scale * std))
    };
    let all: Vec<String> = motion.hard_stop_joints.iter().enumerate().filter_map(shown).collect();
    (!all.is_empty()).then(|| {
        format!(
            "hard stop and motion disagree: seen from the motion, the hard stop is off in {}. A stop that gives way or cables that homing \
             stretches do that; the motion is believed.",
            all.join(" and ")
        )
    })
}

fn text(report: &Report, stop: &AtHardStop, args: &RegisterArgs) -> String {
    let row = |values: [f64; 3], scale: f64, digits: usize| values.map(|x| format!("{:.digits$}", scale * x)).join(", ");
    let mut text = format!(
        "marker seen in {} of {} pairs of frames at ({}) mm before the left camera\n\
         tip at the hard stop   ({}) mm in frame 0\n\
         base_from_left: t      ({}) mm, one sigma ({}) mm with the rotation as it is\n",
        report.frames_seen,
        report.frames,
        row(report.marker_left_m, 1e3, 2),
        row(stop.tip.into(), 1e3, 2),
        row(report.base_from_left.translation, 1e3, 2),
        row(report.translation_std_m, 1e3, 2),
    );
    let Some(motion) = &report.motion else {
        text += &format!("rotation {}, one sigma {} deg about the tip at the hard stop\n", args.rotation.trim(), args.rotation_std_deg);
        return text;
    };
    let of_mount = args.rotation.parse::<Mount>().map(|mount| mount.base_from_left).unwrap_or_default();
    let turned = (nalgebra::Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&report.base_from_left.rotation))
        * of_mount.inverse())
    .scaled_axis();
    let degrees = 180.0 / std::f64::consts::PI;
    text += &format!(
        "rotation               {} and ({}) deg about the axes of frame 0, one sigma ({}) deg\n\
         seen in the motion     in {} of {} frames; one sigma of the tip in its middle ({}) mm\n\
         latency                {:.2} +- {:.2} ms\n\
         right minus left       {:.2} ms by the stamps, {:.2} +- {:.2} ms in truth\n",
        args.rotation.trim(),
        row(turned.into(), degrees, 3),
        row(report.rotation_std_rad, degrees, 3),
        motion.sightings,
        motion.frames,
        row(motion.workspace_std_m, 1e3, 2),
        1e3 * report.latency_s.unwrap_or(f64::NAN),
        1e3 * report.latency_std_s.unwrap_or(f64::NAN),
        1e3 * motion.stamps_apart_s,
        1e3 * motion.right_minus_left_s,
        1e3 * motion.right_minus_left_std_s,
    );
    text
}
