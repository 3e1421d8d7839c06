//! Tracks the coloured marker on the tool in both cameras and triangulates the tip.
//!
//! Each frame is searched around where the robot's own kinematics put the marker, a ball is fitted to what is found there, the cameras are
//! brought to one time, and the tip comes with a covariance and a status.

pub mod appearance;
pub mod batches;
pub mod bits;
pub mod centre;
pub mod colour;
mod correlated;
mod cosines;
pub mod html;
pub mod interpolate;
pub mod learn;
pub mod lock;
pub mod look;
pub mod marker;
pub mod marker_position;
mod model;
mod normal;
pub mod outline;
pub mod output;
pub mod pace;
pub mod patch;
pub mod perspective;
mod pixels;
mod plane;
pub mod predict;
pub mod reason;
mod refine;
pub mod report;
pub mod response;
mod sandwich;
pub mod shaft;
pub mod shared;
pub mod sieve;
mod spectrum;
mod squares;
pub mod stereo;
mod surroundings;
pub mod tips;
pub mod tracker;

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Parser, Subcommand};
use raven::camera::Cameras;
use raven::cli::{self, Outcome};
use raven::log::{LogWriter, MotorSource, Recording, Side};
use raven::robot::Robot;
use raven::{Error, Result, files};

use crate::appearance::{Appearance, Size, number};
use crate::html::{Album, Page};
use crate::marker::Centre;
use crate::predict::Predictor;
use crate::report::Report;
use crate::tracker::{Followed, Record, Sighting, Tracker};

const EXAMPLES: &str = "Examples:
  raven-track sinusoid.mcap --robot robot.yaml --cameras cameras.yaml -o tracked.mcap
  raven-track colour hardstop.mcap --cameras cameras.yaml";

/// Track the coloured marker on the tool and write the tip's position.
#[derive(Debug, Clone, Parser)]
#[command(name = "raven-track", version, after_help = EXAMPLES, arg_required_else_help = true, args_conflicts_with_subcommands = true)]
#[command(subcommand_negates_reqs = true)]
pub struct Args {
    /// Something else than tracking.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Tracking.
    #[command(flatten)]
    pub track: Option<Track>,
    /// What the marker looks like.
    #[command(flatten)]
    pub appearance: Appearance,
}

/// What else the program does.
#[derive(Debug, Clone, Subcommand)]
pub enum Command {
    /// Learn the marker's colour from a recording in which it rests.
    Colour(Colour),
}

/// Arguments of learning a colour.
#[derive(Debug, Clone, clap::Args)]
pub struct Colour {
    /// A recording with images in which the marker is in view and at rest, such as that at the hard stop.
    pub log: PathBuf,
    /// The calibrated cameras.
    #[arg(long, value_name = "FILE")]
    pub cameras: PathBuf,
    /// The marker's size.
    #[command(flatten)]
    pub size: Size,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of tracking.
#[derive(Debug, Clone, clap::Args)]
pub struct Track {
    /// The recording, with images and motors.
    pub log: PathBuf,
    /// The robot file.
    #[arg(long, value_name = "FILE")]
    pub robot: PathBuf,
    /// The calibrated and registered cameras.
    #[arg(long, value_name = "FILE")]
    pub cameras: PathBuf,
    /// The tracked log: the recording without its images, and the tip.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write a page with verdict, tracks, reasons and pictures of the marker as it was found.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Which centre to take: of a ball fitted to the colours, or of the contour.
    #[arg(long, value_enum, default_value_t = Centre::Ball)]
    pub centre: Centre,
    /// Fit every ball until the weights of its pixels settle, under one lamp where there is one: slower, better on raw frames.
    #[arg(long, conflicts_with = "centre")]
    pub refine: bool,
    /// Standard deviation of the frames' stamps [s], which are then taken as they are; by default the cameras' steady pace is found behind
    /// them.
    #[arg(long, value_name = "S", value_parser = jitter, allow_negative_numbers = true)]
    pub stamp_jitter: Option<f64>,
}

fn jitter(text: &str) -> Result<f64, String> {
    number(text, 0.0..=0.1, "s; is it in milliseconds?")
}

/// Runs the program; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is missing in the log, the cameras or the robot file, or what to check if the marker is never seen.
pub fn run(args: Args, out: &mut dyn Write) -> Result<Outcome> {
    match (args.command, args.track) {
        (Some(Command::Colour(colour)), _) => learn::run(&colour, out),
        (None, Some(track)) => self::track(&track, &args.appearance, out),
        (None, None) => Err(Error::Argument("name a recording to track; see `raven-track --help`.".to_owned())),
    }
}

fn track(args: &Track, appearance: &Appearance, out: &mut dyn Write) -> Result<Outcome> {
    let started = Instant::now();
    let outputs = [("-o", Some(args.output.as_path())), ("--json", args.json.as_deref()), ("--html", args.html.as_deref())];
    files::apart([&args.log, &args.robot, &args.cameras], &outputs)?;
    let robot_text = files::read_text(&args.robot)?;
    let robot = Robot::parse(&args.robot, &robot_text)?;
    let cameras_text = files::read_text(&args.cameras)?;
    let cameras = Cameras::parse(&args.cameras, &cameras_text)?;
    let base_from_left = cameras.base_from_left.ok_or_else(|| {
        Error::file(
            &args.cameras,
            "base_from_left is missing: the cameras are not registered to the robot. Run `raven-calibrate register` first.",
        )
    })?;
    LogWriter::require_computed(&args.output)?;
    let recording = Recording::read(&args.log, &MotorSource::from(&robot))?;
    let predictor = Predictor::new(&recording, &robot, cameras.latency_s)?;
    let frames: u64 = Side::BOTH.into_iter().map(|side| Ok(recording.require_images(side)?.1)).sum::<Result<_>>()?;

    let marker = appearance.marker(if args.refine { Centre::Refined } else { args.centre });
    let mut tracker = Tracker::new(&cameras, base_from_left, &predictor, marker);
    let pair_within_s = batches::pair_within_s(&recording);
    let bar = cli::progress(frames, "tracking");
    let mut album = args.html.as_ref().map(|_| Album::new(marker.colour));
    let counts = batches::for_each_encoded(&args.log, &cameras, pair_within_s, |step| {
        let looked = tracker.step(step);
        if let Some(album) = &mut album {
            album.add(step, &looked);
        }
        bar.inc(step.iter().flatten().count() as u64);
    })?;
    bar.finish_and_clear();
    let followed = tracker.finish();
    let records = &followed.records;
    let tips = tips::tips(&cameras, &base_from_left, predictor.frame_id(), records, args.stamp_jitter);
    let metadata = shared::metadata(&cameras, &tips.tips, &predictor.hard_stop_tip());
    let contents = output::Contents {
        tips: &tips.tips,
        metadata: &metadata,
        records,
        robot: &robot_text,
        cameras_text: &cameras_text,
        cameras: &cameras,
    };
    let seconds = started.elapsed().as_secs_f64();
    let report = Report::new(&recording, &tips, &followed, counts, seconds);
    // A run in which nothing was seen is the one of which pictures are wanted most.
    if let (Some(path), Some(album)) = (&args.html, album) {
        let shared = shared::of_tips(&cameras, &tips.tips, &predictor.hard_stop_tip()).filter(|_| report.seen > 0);
        let recording = args.log.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let page = Page {
            recording: &recording,
            report: &report,
            tips: &tips.tips,
            records,
            shared_m2: shared.map(|(covariance, _)| covariance),
            album,
        };
        files::write_atomic(path, html::html(page)?.as_bytes())?;
    }
    if report.seen == 0 {
        return Err(never_seen(args, appearance, &followed, report.frames_undecodable));
    }
    output::write(&args.log, &args.output, contents)?;
    let seconds = started.elapsed().as_secs_f64();

    let report = Report { seconds, pairs_per_second: report.pairs as f64 / seconds.max(1e-9), ..report };
    cli::results(out, &report.to_string(), args.json.as_deref(), &report)?;
    report.unusable.iter().for_each(|sentence| cli::warn(sentence));
    if 2 * report.seen < report.pairs {
        cli::warn(&format!(
            "the marker was seen in {} of {} pairs only. Its colour may be that of something in the background, or not that of the options: look at the \
             pictures of --html, and try another --hue, --min-saturation or --min-value.",
            report.seen, report.pairs
        ));
    }
    Ok(if report.has_lost_data() { Outcome::DataLost } else { Outcome::Done })
}

fn never_seen(args: &Track, appearance: &Appearance, followed: &Followed, undecodable: usize) -> Error {
    let Followed { records, without_motor, out_of_view, .. } = followed;
    let frames = records[0].len() + records[1].len();
    if 2 * without_motor > frames {
        let message = format!(
            "the log has no motor angles at the times of {without_motor} of its {frames} frames, so that the marker could not be looked for. \
             Compare the stamps of images and motors: were they made by one clock?"
        );
        return Error::file(&args.log, message);
    }
    let unseen = |side: &Side| 2 * out_of_view[*side as usize] > records[*side as usize].len();
    if let Some(side) = Side::BOTH.into_iter().find(unseen) {
        let message = format!(
            "the marker could not be looked for in {} of {} frames of the {} camera: by the motors and the registration in {} the tip is behind \
             it, or far outside its image. Did the cameras move or change places since? Register them again with `raven-calibrate register`, and \
             check the robot file.",
            out_of_view[side as usize],
            records[side as usize].len(),
            side.name(),
            args.cameras.display()
        );
        return Error::file(&args.log, message);
    }
    let of = |records: &[Record]| {
        let found = records.iter().filter(|r| !matches!(r.sighting, Sighting::Hidden)).count();
        format!("{found} of {}", records.len())
    };
    Error::file(
        &args.log,
        format!(
            "the marker was never seen by both cameras at once where the robot can have it. A blob of its colour and size was found in {} left \
             and {} right frames; {undecodable} could not be decoded. Check the marker's looks ({}), and the registration in {}.",
            of(&records[0]),
            of(&records[1]),
            appearance.options(),
            args.cameras.display()
        ),
    )
}

#[cfg(test)]
mod tests;
