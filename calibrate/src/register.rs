//! `raven-calibrate register`: where the cameras are in the robot's frame 0.
//!
//! The marker at the hard stop gives the place, with the rotation of the mount ([`crate::hard_stop`], the paper's eq. 1). A motion gives the
//! rotation too, the latency and the offset between the cameras ([`crate::from_motion`]), from a mount that is known roughly or from nothing
//! ([`crate::anywhere`]).

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use nalgebra::Matrix3;
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::log::{Moments, MotorSource, Recording};
use raven::robot::Robot;
use raven::{Error, Result, files};
use raven_track::appearance::{Appearance, number};
use raven_track::look::Marker;
use raven_track::marker::Centre;

use crate::anywhere::{self, Found};
use crate::from_motion::{self, Before};
use crate::hard_stop::{self, AtHardStop};
use crate::mount::Mount;
use crate::moving::Moving;
use crate::registration::{Report, contradiction, unknown_latency};

/// What `--rotation` says where the rotation is to be found out.
const ESTIMATE: &str = "estimate";

/// Register the cameras to the robot from a recording at the hard stop, and from recordings of motion if there are any.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n  \
                        raven-calibrate register hardstop.mcap --motion sinusoid.mcap --robot robot.yaml --cameras cameras.yaml -o cameras.yaml\n  \
                        raven-calibrate register sinusoid.mcap --rotation estimate --robot robot.yaml --cameras cameras.yaml -o cameras.yaml")]
pub struct RegisterArgs {
    /// A recording with the robot at its hard stop and the marker in both images. With `--rotation estimate` and without `--motion`: the
    /// moving recording.
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
    /// How the left camera is mounted: each axis of frame 0 as an axis of the camera (x right, y down, z along the view). `estimate`: nobody
    /// knows; the motion has to tell.
    #[arg(long, value_name = "AXES", default_value = "x0=-y y0=z z0=-x")]
    pub rotation: String,
    /// How well a given mount is set about each axis, one sigma [deg]. By hand and eye it is about a degree.
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = degrees, allow_negative_numbers = true)]
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

/// Runs the command; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is missing, or why the recording does not determine the registration.
pub fn run(args: &RegisterArgs, out: &mut dyn Write) -> Result<Outcome> {
    let axes = args.rotation.trim();
    let mount: Option<Mount> = match axes {
        ESTIMATE => None,
        axes => Some(axes.parse().map_err(|e| Error::Argument(format!("--rotation: {e}, or `{ESTIMATE}`.")))?),
    };
    // Registered cameras may take the place of those that were not.
    let recordings = || args.motion.iter().chain([&args.log, &args.robot]);
    files::apart(recordings(), &[("-o", args.output.as_deref()), ("--json", args.json.as_deref())])?;
    files::apart([&args.cameras], &[("--json", args.json.as_deref())])?;
    let robot = Robot::read(&args.robot)?;
    let mut cameras = Cameras::read(&args.cameras)?;
    let is_alone = mount.is_none() && args.motion.is_empty();
    let moves = if is_alone { std::slice::from_ref(&args.log) } else { &args.motion };
    let motion = moves.iter().map(|log| Recording::read(log, &MotorSource::from(&robot))).collect::<Result<Vec<_>>>()?;
    Moments::distinct(&motion)?;
    let marker = args.appearance.marker(Centre::Ball);
    // What these were is found out anew where something moves.
    if !motion.is_empty() {
        (cameras.latency_s, cameras.right_minus_left_s) = (0.0, 0.0);
    }
    let Begun { stop, before, moving } = match &mount {
        Some(mount) => begin(args, motion, &robot, &cameras, marker, mount)?,
        None => begin_anywhere((!is_alone).then_some(&args.log), motion, &robot, &cameras, marker)?,
    };
    let lost = stop.iter().map(|stop| stop.lost).chain(moving.iter().map(|moving| moving.lost)).sum::<usize>();
    let mut report = Report::new(stop.as_ref(), &before);
    cameras.base_from_left = Some(before.base_from_left);
    if !moving.is_empty() {
        let found = from_motion::register(&robot, &cameras, &before, &moving).map_err(|error| advised(args, error))?;
        report.take(&robot, stop.as_ref(), &found, &moving)?;
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
    let text = report.text(&robot, mount.as_ref().map(|mount| (axes, mount)), args.rotation_std_deg);
    cli::results(out, &text, args.json.as_deref(), &report)?;
    report.motion.iter().filter_map(|motion| contradiction(motion, &robot)).for_each(|sentence| cli::warn(&sentence));
    let latency_s = report.latency_s.zip(report.latency_std_s);
    latency_s.and_then(|(value, std)| unknown_latency([value, std])).iter().for_each(|sentence| cli::warn(sentence));
    if lost > 0 {
        cli::warn(&format!(
            "{lost} frames were left out: they could not be decoded, or have not the size that the cameras were calibrated with."
        ));
        return Ok(Outcome::DataLost);
    }
    Ok(Outcome::Done)
}

/// What helps where the estimation did not settle.
fn advised(args: &RegisterArgs, error: Error) -> Error {
    let Error::Unsettled { .. } = error else { return error };
    let or_given = if args.rotation.trim() == ESTIMATE { ", or give the mount's rotation with --rotation" } else { "" };
    Error::file(args.motion.first().unwrap_or(&args.log), format!("{error} Record a longer motion that moves all joints{or_given}."))
}

/// What is known when the motion is to be taken in.
struct Begun {
    stop: Option<AtHardStop>,
    before: Before,
    moving: Vec<Moving>,
}

/// By the mount's rotation and the hard stop.
fn begin(args: &RegisterArgs, motion: Vec<Recording>, robot: &Robot, cameras: &Cameras, marker: Marker, mount: &Mount) -> Result<Begun> {
    let stop = hard_stop::register(&args.log, robot, cameras, &marker, &mount.base_from_left)?;
    let before = Before {
        base_from_left: stop.base_from_left,
        rotation_std_rad: [args.rotation_std_deg.to_radians(); 3],
        translation_std_m: deviations(&stop.covariance),
    };
    let cameras = Cameras { base_from_left: Some(before.base_from_left), ..cameras.clone() };
    let moving = motion.into_iter().map(|recording| Moving::follow(recording, robot, &cameras, marker)).collect::<Result<_>>()?;
    Ok(Begun { stop: Some(stop), before, moving })
}

/// By the motion alone, and the hard stop where there is a recording of its own.
fn begin_anywhere(stop: Option<&PathBuf>, motion: Vec<Recording>, robot: &Robot, cameras: &Cameras, marker: Marker) -> Result<Begun> {
    let Found { moving, aligned } = anywhere::find(motion, robot, cameras, marker)?;
    let turn = aligned.base_from_left.rotation.to_rotation_matrix();
    let stop = stop.map(|log| hard_stop::register(log, robot, cameras, &marker, &turn)).transpose()?;
    let before = Before {
        base_from_left: stop.as_ref().map_or(aligned.base_from_left, |stop| stop.base_from_left),
        rotation_std_rad: [anywhere::ROTATION_STD_RAD; 3],
        translation_std_m: stop.as_ref().map_or([anywhere::TRANSLATION_STD_M; 3], |stop| deviations(&stop.covariance)),
    };
    Ok(Begun { stop, before, moving })
}

fn deviations(covariance: &Matrix3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|i| covariance[(i, i)].sqrt())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::Command;

    #[test]
    fn advice_is_for_this_program() {
        let said = |more: &[&str]| {
            let words = ["raven-calibrate", "register", "first.mcap", "--robot", "r.yaml", "--cameras", "c.yaml"];
            let Command::Register(args) = crate::Args::parse_from(words.iter().chain(more)).command else { panic!("register") };
            advised(&args, Error::Unsettled { unknowns: 26, steps: 60 }).to_string()
        };
        let anywhere = said(&["--rotation", "estimate"]);
        assert!(anywhere.starts_with("first.mcap: the estimation of 26 unknowns had not settled after 60 steps. Record"), "{anywhere}");
        assert!(anywhere.contains("with --rotation") && !anywhere.contains("--parameters"), "{anywhere}");
        let mounted = said(&["--motion", "sinusoid.mcap"]);
        assert!(mounted.starts_with("sinusoid.mcap: ") && !mounted.contains("--rotation"), "{mounted}");
    }
}
