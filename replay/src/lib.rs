//! `raven-replay`: transmission kinematics, camera and filter side by side against the reference encoders.

pub mod chain;
pub mod errors;
pub mod estimate;
pub mod over_time;
pub mod paper;
mod report;
pub mod tour;

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Parser, Subcommand, ValueEnum};
use raven::camera::Cameras;
use raven::cli::{self, Outcome};
use raven::log::{CAMERAS_FILE, LogWriter, Moments, Recording};
use raven::robot::Robot;
use raven::{Error, Result, files};

use crate::errors::JointErrors;
use crate::estimate::Settings;

/// Replays a log through transmission kinematics, camera and filter.
///
/// Compares all three with the reference encoders of the log, if it has them.
///
///   raven-replay tracked.mcap --robot identified.yaml --cameras cameras.yaml -o estimated.mcap
#[derive(Debug, Parser)]
#[command(name = "raven-replay", version, verbatim_doc_comment, args_conflicts_with_subcommands = true)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Logs with motor angles and tips.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Robot file, nominal or identified.
    #[arg(long, required = true)]
    robot: Option<PathBuf>,
    /// Cameras the tips were tracked with; held against those that the log says it was tracked with.
    #[arg(long)]
    cameras: Option<PathBuf>,
    /// States of the filter: the paper's six, or twelve with a slow bias per joint and what persists of the cameras' errors.
    #[arg(long, value_enum, default_value_t = FilterKind::Bias)]
    pub filter: FilterKind,
    /// Share of the time in which the marker is hidden from the filter, in blocks of 2 s.
    #[arg(long, default_value_t = 0.0, value_parser = share, allow_negative_numbers = true)]
    pub occlude: f64,
    /// What the filter makes of a hidden marker: nothing, or as in the paper the tip that transmission kinematics computes.
    #[arg(long, value_enum, default_value_t = Occlusion::Skip)]
    pub occlusion: Occlusion,
    /// Writes the estimates to a log, for one input log; a log cannot go to standard output.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Writes the result as JSON; `-` is standard output.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Writes plots of estimates and errors over time as SVG; `-` is standard output.
    #[arg(long)]
    plot: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Simulates a lab session and runs the whole chain on it; results are left in a folder.
    Tour(tour::Args),
    /// Repeats the founding paper's experiments A to D on a simulated session; tables and figures are left in a folder.
    Paper(paper::Args),
}

/// Which states the filter has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FilterKind {
    /// Positions and velocities.
    Paper,
    /// And a slow transmission bias per joint.
    Bias,
}

/// What the filter makes of a hidden marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Occlusion {
    /// Nothing: it goes on by its model.
    Skip,
    /// The paper's switch: the tip that transmission kinematics computes is taken for seen, as well as the camera typically sees.
    Kinematics,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..1.0).contains(&value) => Ok(value),
        _ => Err(format!("`{text}` is no share; expected a number from 0 to below 1")),
    }
}

/// Runs the program.
///
/// # Errors
/// If a file cannot be read or written, or the logs lack motor angles.
pub fn run(args: Args, out: &mut dyn Write) -> Result<Outcome> {
    match &args.command {
        Some(Command::Tour(tour)) => return tour::run(tour, out),
        Some(Command::Paper(paper)) => return paper::run(paper, out),
        None => {}
    }
    let started = Instant::now();
    let Some(robot_path) = &args.robot else { return Err(Error::Argument("--robot is needed.".to_owned())) };
    let outputs = [("-o", args.output.as_deref()), ("--json", args.json.as_deref()), ("--plot", args.plot.as_deref())];
    files::apart(args.logs.iter().chain(&args.robot).chain(&args.cameras), &outputs)?;
    let has_table = cli::is_left_for_words(&outputs[1..])?;
    if let Some(output) = &args.output {
        if output.as_os_str() == cli::STANDARD_OUTPUT {
            return Err(Error::Argument("-o -: a log is no text and cannot go to standard output; name a file.".to_owned()));
        }
        LogWriter::require_computed(output)?;
    }
    let robot = Robot::read(robot_path)?;
    robot.arm()?;
    let cameras_text = args.cameras.as_deref().map(files::read_text).transpose()?;
    let cameras = args.cameras.as_deref().zip(cameras_text.as_deref());
    let cameras = cameras.map(|(path, text)| Cameras::parse(path, text).map(|cameras| (path, cameras))).transpose()?;
    for (option, is_given) in [("-o", args.output.is_some()), ("--plot", args.plot.is_some())] {
        if is_given && args.logs.len() > 1 {
            return Err(Error::Argument(format!("{option} takes the estimates of one log; give one log or leave {option} away.")));
        }
    }
    let settings = Settings { filter: args.filter, occlude: args.occlude, occlusion: args.occlusion, tuning: None };
    let bar = cli::progress(args.logs.len() as u64, "replaying");
    let mut errors: [Vec<JointErrors>; 3] = Default::default();
    let mut summaries = Vec::new();
    let mut moments = Moments::default();
    for path in &args.logs {
        let recording = Recording::of_robot(path, &robot)?;
        moments = moments.with(&recording)?;
        let doubts = Cameras::doubts(cameras.as_ref().map(|(path, cameras)| (cameras, *path)), &robot, &recording)?;
        doubts.into_iter().chain(Cameras::latency_counts_twice(&robot, &recording)).for_each(|sentence| cli::warn(&sentence));
        let (estimates, filter) = estimate::estimate(&recording, &robot, &settings)?;
        if let Some(reference) = &recording.joint_encoders {
            raven::observation::three_joints(reference, &recording)?;
            for (j, errors) in errors.iter_mut().enumerate() {
                errors.push(JointErrors::new(&estimates, reference, j));
            }
        }
        if let Some(output) = &args.output {
            let tracked_with = || recording.attachments.get(CAMERAS_FILE).map(Vec::as_slice);
            report::write_log(output, &recording, &robot, cameras_text.as_deref().map(str::as_bytes).or_else(tracked_with), &estimates)?;
        }
        if let Some(plot) = &args.plot {
            cli::write_text(plot, &report::plot(&recording, &robot, &estimates)?, out)?;
        }
        summaries.push(report::LogSummary::new(&recording, &filter, estimates.tuning.as_ref()));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let result = report::Report::new(&robot, &errors, summaries, started.elapsed().as_secs_f64());
    let table = if has_table { result.to_string() } else { String::new() };
    cli::results(out, &table, args.json.as_deref(), &result)?;
    result.lost().for_each(|sentence| cli::warn(sentence));
    Ok(if result.lost().next().is_none() { Outcome::Done } else { Outcome::DataLost })
}
