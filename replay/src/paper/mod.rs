//! `raven-replay paper DIR`: the experiments of Haghighipanah et al. 2017 on a simulated session, with one command.
//!
//! A: pulley and cable parameters from a sinusoid. B: cable parameters from a task motion. C: joints over six trials of a task motion from
//! which nothing was identified. D: the marker hidden for 10 to 80 % of the time, in blocks of 2 s.
//!
//! What is simulated: the robot, with effects that no model here has (play, stiction, clocks, a turned registration), and the tip as a
//! tracker finds it. Everything after that is what a lab would run.

mod figures;
mod occlusion;
mod parameters;
mod trials;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use raven::Result;
use raven::cli::{self, Outcome};
use raven::filter::{BiasStates, Tuning};
use raven::log::Recording;
use raven::robot::Robot;
use serde::Serialize;

use crate::chain::{Chain, capture};
use crate::estimate::Settings;
use crate::{FilterKind, Occlusion};
use parameters::Parameters;

/// Repeats the founding paper's experiments A to D.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  raven-replay paper paper/ --seed 7")]
pub struct Args {
    /// Folder for logs, tables and figures; made if it is not there.
    folder: PathBuf,
    /// Seed of the session: what is hidden and all noise.
    #[arg(long, default_value_t = 7, allow_negative_numbers = true)]
    seed: u64,
    /// Recordings of seconds instead of minutes: shows that it runs, not how well.
    #[arg(long)]
    quick: bool,
}

/// Durations [s].
struct Durations {
    /// Sinusoid of experiment A, task motion of B, task motion of D.
    experiment: f64,
    /// Trials of experiment C.
    trials: [f64; 6],
}

/// The paper's.
const FULL: Durations = Durations { experiment: 200.0, trials: [188.0, 80.0, 150.0, 82.0, 110.0, 290.0] };
/// For tests: a period of the slowest sine, and enough of each trial for every joint to move.
const QUICK: Durations = Durations { experiment: 14.0, trials: [6.0, 5.0, 5.0, 5.0, 5.0, 6.0] };

/// What the rig is turned by beyond the preset's effects: 1 deg, about no axis of the arm.
const TURNED_RIG: &str = "camera-rotation=0.010,-0.008,0.012";

/// The machine-readable result.
#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    quick: bool,
    parameters: Parameters,
    trials: trials::Trials,
    occlusion: occlusion::Occlusions,
    seconds: f64,
}

/// Runs the experiments.
///
/// # Errors
/// If the folder cannot be written to, or a step fails.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let started = Instant::now();
    let folder = &args.folder;
    let durations = if args.quick { &QUICK } else { &FULL };
    let mut chain = Chain::begin(folder, out)?;
    let lab = format!("--hidden lab --effect {TURNED_RIG} --seed {}", args.seed);
    let mut record = |motion: &str, seconds: f64, more: &str| {
        let what = format!("simulate --robot {{robot.yaml}} --motion {motion} --duration {seconds} {lab} {more} -o {{{motion}.mcap}}");
        chain.step("raven-capture", capture, &what)
    };
    record("sinusoid", durations.experiment, "--truth {truth.json} --cameras-out {cameras.yaml}")?;
    record("fls", durations.experiment, "")?;
    for (trial, seconds) in durations.trials.iter().enumerate() {
        record(&format!("fls{}", trial + 1), *seconds, "")?;
    }
    record("fls7", durations.experiment, "--occluded 0")?;

    let parameters = Parameters::identify(&mut chain, folder)?;
    let robot = Robot::read(&folder.join("a.yaml"))?;
    let settings = Settings { tuning: Some(tuning(&robot, folder)?), ..TWELVE };
    let trials = trials::Trials::run(&robot, folder, &settings)?;
    chain.say(&trials.text())?;
    let occlusion = occlusion::Occlusions::run(&robot, &folder.join("fls7.mcap"), &settings)?;
    chain.say(&occlusion.text())?;
    let seconds = started.elapsed().as_secs_f64();
    chain.say(&format!("All experiments took {seconds:.0} s. Logs, tables and figures are in {}.", folder.display()))?;
    let outcome = chain.finish("paper.txt")?;
    let report = Report { seed: args.seed, quick: args.quick, parameters, trials, occlusion, seconds };
    cli::write_json(&folder.join("paper.json"), &report)?;
    Ok(outcome)
}

/// Twelve states that skip what is hidden.
const TWELVE: Settings = Settings { filter: FilterKind::Bias, occlude: 0.0, occlusion: Occlusion::Skip, tuning: None };

/// The filter's tuning from the recording of experiment B: the trials must not tune the filter that is tried on them.
fn tuning(robot: &Robot, folder: &Path) -> Result<Tuning> {
    let recording = read(&folder.join("fls.mcap"), robot)?;
    let arm = robot.arm()?;
    let tips = recording.tips(robot)?;
    Ok(BiasStates::tuned(&arm, &recording.motor_track()?, &tips).tuning)
}

fn read(path: &Path, robot: &Robot) -> Result<Recording> {
    Recording::of_robot(path, robot)
}
