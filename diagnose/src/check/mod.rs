//! `raven-diagnose check`: the blind check. Verdicts first, labels afterwards.
//!
//! The verdicts are written and their SHA-256 is printed before the labels may be read ([`Committed`] is the only way to them), and
//! labels whose SHA-256 is not that of `labels.sha256` are refused.

mod beside;
mod cause;
mod committed;
mod estimates;
mod metrics;
mod print;
mod score;
#[cfg(test)]
mod tests;
mod verdict;

pub use crate::attribution::Word;
use beside::Diagnosis;
use cause::is_outside;
pub use cause::{Cause, Names};
pub use committed::Committed;
pub use estimates::Sizes;
pub use metrics::{Claim, Share, brier, calibration_error};
pub use score::{Answer, Score};
pub use verdict::{Blamed, Candidate, ChannelGap, Diagnosed, Estimate, Told, Verdict};

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Parser;
use raven::camera::Cameras;
use raven::cli::{self, Outcome};
use raven::robot::{Robot, nominal};
use raven::simulation::{CAMERAS, LABELS, LABELS_SUM, SealedFolder, sealed_set};
use raven::{Error, Result, files};

use crate::attribution::Nominal;
use crate::evidence::numbers::spread::Spread;

/// Diagnoses the recordings of a sealed folder blind, then opens the labels and prints the score.
///
///   raven-diagnose check blind/ --robot robot.yaml
///   raven-diagnose check --simulate 100 --seed 5
#[derive(Debug, Parser)]
#[command(bin_name = "raven-diagnose check", no_binary_name = true, version, verbatim_doc_comment)]
pub struct Args {
    /// Folder with recordings, cameras.yaml, labels.json and labels.sha256; with --simulate it is made, and kept.
    #[arg(required_unless_present = "simulate")]
    folder: Option<PathBuf>,
    /// Robot file: the model that the recordings are held against; by default the nominal Raven-II, gold arm.
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Cameras the tips were tracked with; by default those of the folder.
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// Makes a sealed folder of so many recordings and checks on it; without a folder's name it is removed afterwards.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), allow_negative_numbers = true)]
    simulate: Option<u16>,
    /// Seed of the simulated recordings.
    #[arg(long, requires = "simulate", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Diagnoses each recording as if there were no other; else how far the others find the file's numbers off counts in place of its tolerances.
    #[arg(long)]
    alone: bool,
    /// Where the verdicts go before the labels are read.
    #[arg(long, value_name = "FILE", default_value = "verdicts.json")]
    verdicts: PathBuf,
    /// Writes the score as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Diagnoses one recording of a robot that is off by parts of its tolerances.
pub type Diagnose<'a> = dyn Fn(&Path, &Spread) -> Result<Diagnosed> + 'a;
/// What one recording says when its effects are told, by identifier and place: the most that any diagnosis could see and close.
pub type Oracle<'a> = dyn Fn(&Path, &Spread, &[(&str, Option<&str>)]) -> Result<Option<Told>> + 'a;

/// Runs the blind check with this program's diagnosis.
///
/// # Errors
/// If a file cannot be read or written, or the labels are not those that were sealed.
pub fn run(args: Args, out: &mut dyn Write) -> Result<Outcome> {
    let robot = args.robot.as_deref().map_or_else(|| Ok(nominal::gold()), Robot::read)?;
    let passing;
    let folder = match &args.folder {
        Some(folder) => folder.as_path(),
        None => {
            passing = files::temporary_folder()?;
            passing.path()
        }
    };
    let sealed = [CAMERAS, LABELS, LABELS_SUM].map(|name| folder.join(name));
    let outputs = [("--verdicts", Some(args.verdicts.as_path())), ("--json", args.json.as_deref())];
    files::apart(sealed.iter().chain(&args.robot).chain(&args.cameras), &outputs)?;
    match args.simulate {
        Some(count) => simulate(&robot, args.seed, usize::from(count), folder)?,
        None => files::apart(recordings(folder)?, &outputs)?,
    }
    let cameras_path = args.cameras.clone().unwrap_or_else(|| folder.join(CAMERAS));
    let cameras = if args.cameras.is_some() || cameras_path.exists() { Some(Cameras::read(&cameras_path)?) } else { None };
    let nominal = |spread: &Spread| Nominal { spread: spread.clone(), ..Nominal::new(&robot, cameras.as_ref()) };
    let diagnose = |log: &Path, spread: &Spread| {
        let Diagnosed { verdict, departures } = crate::diagnose_recording(log, &nominal(spread))?;
        Ok(Diagnosed { verdict, departures: departures.filter(|_| !args.alone) })
    };
    let oracle = |log: &Path, spread: &Spread, effects: &[(&str, Option<&str>)]| crate::when_told(log, &nominal(spread), effects);
    let json = args.json.as_deref();
    // Standard output may be for the machine alone; the sums have to be seen all the same.
    let mut aside = std::io::stderr();
    let sums: &mut dyn Write = if json == Some(Path::new(cli::STANDARD_OUTPUT)) { &mut aside } else { out };
    let score = check(folder, &Names::of(&robot), &diagnose, &oracle, &args.verdicts, sums)?;
    cli::results(out, &format!("\n{score}"), json, &score)?;
    Ok(Outcome::Done)
}

/// Diagnoses every recording of a folder, commits to the verdicts, opens the labels and scores.
///
/// # Errors
/// If there is no recording, no diagnosis succeeds, a recording has no label, or the labels are not those that were sealed.
pub fn check(
    folder: &Path,
    names: &Names,
    diagnose: &Diagnose<'_>,
    oracle: &Oracle<'_>,
    verdicts: &Path,
    out: &mut dyn Write,
) -> Result<Score> {
    let seal = folder.join(LABELS_SUM);
    if !seal.exists() {
        return Err(Error::file(&seal, "is not there: the folder is not sealed, and verdicts could be held against no labels."));
    }
    let recordings = recordings(folder)?;
    let mut answers = Vec::new();
    let mut spreads = Vec::new();
    let mut first_error = None;
    for (Diagnosis { diagnosed, spread, seconds }, path) in beside::diagnose_all(&recordings, diagnose).into_iter().zip(&recordings) {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let verdict = diagnosed.map(|diagnosed| diagnosed.verdict).map_err(|error| {
            let text = error.to_string();
            first_error.get_or_insert_with(|| match error {
                Error::Data(because) => Error::Data(format!("{name}: {because}")),
                other => other,
            });
            text
        });
        answers.push(Answer { name, verdict, seconds, told: None });
        spreads.push(spread);
    }
    if let Some(error) = first_error {
        if answers.iter().all(|answer| answer.verdict.is_err()) {
            return Err(error);
        }
        cli::warn(&format!("some recordings have no verdict and count as wrong; the first of them: {error}"));
    }
    let committed = Committed::write(verdicts, &answers)?;
    cli::print(out, &format!("verdicts: SHA-256 {}  {}\n", committed.sum(), verdicts.display()))?;
    let labels = committed.open_labels(folder)?;
    cli::print(out, &format!("labels:   SHA-256 as sealed in {}\n", folder.join(LABELS_SUM).display()))?;
    if spreads.iter().any(|spread| *spread != Spread::default()) {
        cli::print(out, "Each was diagnosed beside the others, which say how far the robot file is off; --alone leaves that out.\n")?;
    }
    let bar = cli::progress(recordings.len() as u64, "fitting what is true");
    for ((answer, spread), path) in answers.iter_mut().zip(&spreads).zip(&recordings) {
        let Some(label) = labels.get(&answer.name) else {
            return Err(Error::file(path, "this recording has no label; move it out of the sealed folder."));
        };
        if !is_outside(label) && !label.effects.is_empty() && answer.verdict.is_ok() {
            let causes: Vec<Cause> = label.effects.iter().map(|effect| names.labelled(effect)).collect();
            let effects: Vec<(&str, Option<&str>)> = causes.iter().map(|cause| (cause.id.as_str(), cause.joint.as_deref())).collect();
            answer.told = oracle(path, spread, &effects)?;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    for name in labels.keys().filter(|name| answers.iter().all(|answer| answer.name != **name)) {
        cli::warn(&format!("the label `{name}` has no recording in {}.", folder.display()));
    }
    Ok(Score::of(&answers, &labels, names))
}

/// The recordings of a folder, by name.
fn recordings(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "read", e))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()).map_err(|e| Error::io(folder, "read", e)));
    let mut paths = paths.collect::<Result<Vec<_>>>()?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "mcap"));
    paths.sort();
    if paths.is_empty() {
        return Err(Error::file(folder, "there is no recording NAME.mcap in it."));
    }
    Ok(paths)
}

/// Makes a sealed set in a folder.
fn simulate(robot: &Robot, seed: u64, count: usize, folder: &Path) -> Result<()> {
    let cases = sealed_set(robot, seed, count)?;
    let bar = cli::progress(count as u64, "simulating");
    SealedFolder::open(folder)?.add_all(robot, &cases, &SealedFolder::options(), || bar.inc(1))?;
    bar.finish_and_clear();
    Ok(())
}
