//! Identifies kinematic and cable parameters from recordings, and exports them for the controller.
//!
//! A recording has the motors' angles and the tip as the cameras saw it; between them lie cables, pulleys, hard stops, clocks and a
//! registration. [`parameters`] names these numbers, [`priors`] says what is known of them beforehand, [`problem`] compares
//! [`prediction`]s with sightings, [`batch`] finds the most probable numbers and how well each is known, [`parsimony`] decides whether the file's
//! other numbers need be off within their [`tolerances`] for that, and [`identified`] writes what the recording determined into the robot file.
//! [`identifiability`] says what a recording can tell at all. [`export`] hands them to the controller; [`excite`]
//! proposes what to record next. [`added`] puts effects that a diagnosis named into the robot file.

pub mod added;
pub mod args;
pub mod batch;
pub mod damping;
pub mod excite;
pub mod export;
pub mod identifiability;
pub mod identified;
pub mod misfit;
pub mod motion;
pub mod parameters;
pub mod parsimony;
pub mod prediction;
pub mod priors;
pub mod problem;
pub mod recording;
pub mod recursive;
pub mod registration;
pub mod report;
pub mod session;
pub mod systematic;
pub mod tolerances;

use std::io::Write;
use std::path::Path;
use std::time::Instant;

pub use args::Args;
use args::Command;
use identifiability::Identifiability;
use identified::Finding;
use problem::Problem;
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::robot::Robot;
use raven::{Error, Result};
use recording::Recordings;
use registration::Registration;
use report::Report;
use systematic::Systematic;

/// Does what the arguments ask for; the result goes to `out`.
///
/// # Errors
/// With a sentence, if an argument is wrong, a file cannot be read or written, or the recordings do not carry an estimate.
pub fn run(args: Args, out: &mut dyn Write) -> Result<Outcome> {
    match &args.command {
        Some(Command::Export(export)) => export::run(export, out),
        Some(Command::Excite(excite)) => excite::run(excite, out),
        None if !args.identify.add_effect.is_empty() => added::run(&args.identify, out),
        None => identify(&args.identify, out),
    }
}

fn identify(args: &args::Identify, out: &mut dyn Write) -> Result<Outcome> {
    let start = Instant::now();
    args.apart()?;
    let has_table = args.has_table()?;
    let sharing = args.sharing()?;
    let selection = args.selection()?;
    let robot = Robot::read(args.robot()?)?;
    robot.arm()?;
    let cameras = args.cameras.as_deref().map(Cameras::read).transpose()?;
    let quality = cameras.as_ref().map_or_else(Quality::default, |cameras| cameras.quality);
    let mut unknowns = priors::unknowns(&robot, &selection, &quality)?;
    args.plots(&unknowns)?;
    let recordings = {
        let spinner = cli::spinner("reading logs");
        let recordings = Recordings::read(args.logs()?, &robot, cameras.as_ref().zip(args.cameras.as_deref()));
        spinner.finish_and_clear();
        recordings?
    };
    recordings.doubts.iter().for_each(|sentence| cli::warn(sentence));
    let hidden = damping::leave_out_hidden(&mut unknowns, &robot, &recordings.sessions)?;
    args.plots(&unknowns)?;
    let problem = Problem::new(&robot, &unknowns, &recordings.sessions)?.with_systematic(Systematic::of(recordings.tracked.clone()))?;
    let spinner = cli::spinner("estimating");
    let fit = parsimony::fit(problem, sharing);
    spinner.finish_and_clear();
    let parsimony::Fit { problem, estimate, trace, as_filed } = fit.map_err(|error| match error {
        Error::Unsettled { .. } => Error::Data(format!("{error} Estimate fewer with --parameters.")),
        other => other,
    })?;
    let registration = Registration::of(&robot.arm()?, &unknowns, &problem.flaws_of_sight(), &recordings.sessions, &estimate);
    let mut findings = Finding::all(&unknowns, &estimate);
    registration.iter().for_each(|registration| registration.apply(&mut findings));
    let squares = problem.normalized_squares(&estimate.z)?;
    let identifiability = Identifiability::of(&robot, &problem, &unknowns, &estimate)?;
    let times_s = [recordings.duration_s, start.elapsed().as_secs_f64()];
    let mut report = Report::new(&robot, &findings, &estimate, &squares, problem.misfit(), times_s);
    report.identifiability = Some(identifiability);
    report.as_filed = as_filed;
    report.tolerances = problem.tolerances_found(&estimate);
    report.left = problem.left_found(&estimate);
    report.cameras = problem.cameras_found(&estimate);

    if let Some(path) = &args.output {
        let method = identified::remarked(args.method.name(), report.misfit());
        let mut new = identified::identified(&robot, &findings, problem.held(), &method, &recordings.sessions)?;
        if let Some(registration) = &registration {
            new.observation = new.observation.with_pose_covariance(&registration.covariance);
        }
        write_robot(path, &new, out, "estimate it from another recording, or leave it out of --parameters")?;
    }
    if let (Some(path), Some(trace)) = (&args.plot, trace) {
        let svg = trace.plot(&robot, &unknowns, |k| !unknowns[k].quantity.is_registration())?;
        cli::write_text(path, &svg, out)?;
    }
    let table = if has_table { report.table() } else { String::new() };
    cli::results(out, &table, args.json.as_deref(), &report)?;
    for effect in raven::effects::within_images(&robot) {
        cli::warn(&format!(
            "{} is in the robot file's list of effects and left out here: a tip is taken for one point at one time.",
            effect.id
        ));
    }
    recordings.lost.iter().chain(&hidden).chain(&report.warnings()).for_each(|sentence| cli::warn(sentence));
    Ok(if recordings.lost.is_empty() { Outcome::Done } else { Outcome::DataLost })
}

/// Writes a robot file, unless no program could read it: estimates and effects may leave what a file can hold. The advice is for that case.
pub(crate) fn write_robot(path: &Path, robot: &Robot, out: &mut dyn Write, advice: &str) -> Result<()> {
    let text = robot.to_yaml();
    let refused = |error| Error::Data(format!("{error} No program could read such a file, so nothing is written; {advice}."));
    Robot::parse(path, &text).map_err(refused)?;
    cli::write_text(path, &text, out)
}
