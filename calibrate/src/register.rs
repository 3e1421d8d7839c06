//! `raven-calibrate register`: where the cameras are in the robot's frame 0.
//!
//! With the rotation of the mount and the robot at its hard stop, see [`crate::hard_stop`]; all of it and the latency from a moving
//! recording, see [`crate::moving`].

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::Isometry3;
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::log::{MotorSource, Recording};
use raven::robot::Robot;
use raven::{Error, Result};
use raven_track::colour::MarkerColour;
use raven_track::look::Marker;
use raven_track::marker::Centre;
use serde::Serialize;

use crate::mount::Mount;
use crate::tip_path::TipPath;
use crate::{hard_stop, moving};

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
    /// How the left camera is mounted: each axis of frame 0 as an axis of the camera (x right, y down, z along the view). With `estimate`
    /// rotation, place and latency come from a recording in which the robot moves.
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

/// Where the cameras are, and how well that is known.
#[derive(Debug, Clone)]
pub struct Registration {
    /// `x_0 = base_from_left x_left`.
    pub base_from_left: Isometry3<f64>,
    /// Standard deviation of where the cameras put a tip at the hard stop, in frame 0 [m].
    pub translation_std_m: [f64; 3],
    /// Standard deviation of the rotation about the axes of frame 0 [rad].
    pub rotation_std_rad: [f64; 3],
    /// Latency and its standard deviation, where the recording tells [s].
    pub latency_s: Option<(f64, f64)>,
    /// Pairs of frames in which the marker was seen.
    pub frames_seen: usize,
    /// Pairs of frames looked at.
    pub frames: usize,
    /// Frames that could not be decoded.
    pub undecodable: usize,
}

/// Runs the command; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is missing, or why the recording does not determine the registration.
pub fn run(args: &RegisterArgs, out: &mut dyn Write) -> Result<Outcome> {
    let mount: Option<Mount> = match args.rotation.trim() {
        "estimate" => None,
        axes => Some(axes.parse().map_err(|e| Error::Argument(format!("--rotation: {e}.")))?),
    };
    let robot = Robot::read(&args.robot)?;
    let arm = robot.arm()?;
    let mut cameras = Cameras::read(&args.cameras)?;
    let recording = Recording::read(&args.log, &MotorSource::from(&robot))?;
    let path = TipPath { arm: &arm, recording: &recording };
    let colour = MarkerColour { hue_deg: args.hue, ..MarkerColour::default() };
    let marker = Marker { colour, radius_m: args.marker_radius, centre: Centre::Ball };
    let found = match mount {
        Some(mount) => {
            let std_rad = args.rotation_std_deg.to_radians();
            hard_stop::register(&args.log, &robot, &cameras, &path, &marker, &mount.base_from_left, std_rad)?
        }
        None => moving::register(&args.log, &cameras, &path, &marker)?,
    };
    cameras.base_from_left = Some(found.base_from_left);
    cameras.quality = Quality {
        registration_rotation_std_rad: Some(found.rotation_std_rad),
        registration_translation_std_m: Some(found.translation_std_m),
        ..cameras.quality
    };
    if let Some((latency_s, std_s)) = found.latency_s {
        cameras.latency_s = latency_s;
        cameras.quality.latency_std_s = Some(std_s);
    }
    if let Some(output) = &args.output {
        cameras.write(output)?;
    }
    out.write_all(text(&found).as_bytes()).map_err(|e| Error::io(Path::new("-"), "write", e))?;
    if let Some(json) = &args.json {
        cli::write_json(json, &report(&found))?;
    }
    if found.undecodable > 0 {
        cli::warn(&format!("{} frames were cut off or could not be decoded.", found.undecodable));
        return Ok(Outcome::DataLost);
    }
    Ok(Outcome::Done)
}

fn report(found: &Registration) -> Report {
    let rotation = found.base_from_left.rotation.to_rotation_matrix();
    Report {
        base_from_left: PoseReport {
            rotation: std::array::from_fn(|i| rotation[(i / 3, i % 3)]),
            translation: found.base_from_left.translation.vector.into(),
        },
        translation_std_m: found.translation_std_m,
        rotation_std_rad: found.rotation_std_rad,
        latency_s: found.latency_s.map(|(latency, _)| latency),
        latency_std_s: found.latency_s.map(|(_, std)| std),
        frames_seen: found.frames_seen,
        frames: found.frames,
    }
}

fn text(found: &Registration) -> String {
    let row = |values: [f64; 3], scale: f64, digits: usize| values.map(|v| format!("{:.digits$}", scale * v)).join(", ");
    let rotation = found.base_from_left.rotation.to_rotation_matrix();
    let rows = [0, 1, 2].map(|r| row([rotation[(r, 0)], rotation[(r, 1)], rotation[(r, 2)]], 1.0, 5));
    let latency = match found.latency_s {
        Some((latency, std)) => format!("latency         {:.1} ms +- {:.1} ms\n", 1e3 * latency, 1e3 * std),
        None => "latency         unknown: a robot at rest does not tell\n".to_owned(),
    };
    format!(
        "marker seen in {} of {} pairs of frames\n\
         base_from_left  R ({}; {}; {})\n                t ({}) mm\n\
         one sigma       tip at the hard stop ({}) mm, rotation about it ({}) deg\n{latency}",
        found.frames_seen,
        found.frames,
        rows[0],
        rows[1],
        rows[2],
        row(found.base_from_left.translation.vector.into(), 1e3, 2),
        row(found.translation_std_m, 1e3, 2),
        row(found.rotation_std_rad, 180.0 / std::f64::consts::PI, 3),
    )
}
