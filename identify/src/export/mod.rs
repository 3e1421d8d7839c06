//! What the robot's controller loads: the calibrated numbers in its own files.
//!
//! The public controller reads gains from `r2params.yaml` and compiles everything else in, so there are three ways out: its own
//! parameter file with the calibrated lists added (`r2params`), a header that overrides its constants (`defines`), and all numbers
//! under neutral names (`rosparam`). None of them writes a number that the logs did not determine or that the hardware cannot have.

mod calibration;
mod constants;
mod defines;
mod r2params;
mod rosparam;

use std::io::Write;
use std::path::{Path, PathBuf};

use raven::cli::{self, Outcome};
use raven::robot::{Provenance, Robot};
use raven::{Error, Result, files};
use serde::Serialize;

use crate::args::{Export, Format};
use calibration::{Calibration, remarks};

/// What `--json` writes.
#[derive(Debug, Serialize)]
struct Written<'a> {
    format: Format,
    output: &'a Path,
    /// Where what was there before is kept, if anything else was.
    kept: Option<&'a Path>,
    /// The identified numbers that the file carries, in SI units.
    numbers: Vec<Number<'a>>,
    logs: Vec<Log<'a>>,
    /// What is not in the file, and what is to be said of what is.
    warnings: &'a [String],
}

/// An identified number.
#[derive(Debug, Serialize)]
struct Number<'a> {
    parameter: &'a str,
    key: &'a str,
    unit: &'a str,
    value: f64,
    std: f64,
    prior: f64,
}

impl<'a> From<&'a Provenance> for Number<'a> {
    fn from(entry: &'a Provenance) -> Self {
        let Provenance { parameter, key, unit, value, std, prior, .. } = entry;
        Self { parameter, key, unit, value: *value, std: *std, prior: *prior }
    }
}

/// A recording that it rests on.
#[derive(Debug, Serialize)]
struct Log<'a> {
    name: &'a str,
    sha256: &'a str,
}

/// Writes the file that the arguments ask for.
///
/// # Errors
/// With a sentence, if the robot file carries nothing to export or something that must not be, or a file cannot be read or written.
pub fn run(args: &Export, out: &mut dyn Write) -> Result<Outcome> {
    if args.base.is_some() && args.format != Format::R2params {
        return Err(Error::Argument("--base goes with --format r2params, whose gains it holds.".to_owned()));
    }
    let outputs = [("-o", Some(args.output.as_path())), ("--json", args.json.as_deref())];
    cli::is_left_for_words(&outputs)?;
    files::apart(std::iter::once(&args.identified).chain(&args.base), &outputs)?;
    let robot = Robot::read(&args.identified)?;
    let calibration = Calibration::new(&args.identified, &robot)?;
    if calibration.identified.iter().all(|entry| !calibration.carries(args.format, &entry.key)) {
        let found: Vec<&str> = calibration.identified.iter().map(|entry| entry.parameter.as_str()).collect();
        let message = format!("there is nothing to export: the controller has no constant for {}.", found.join(", "));
        return Err(Error::file(&args.identified, message));
    }
    let text = match args.format {
        Format::R2params => {
            let base = args.base.as_deref().ok_or_else(|| {
                Error::Argument("--base is missing: the lab's own r2params.yaml, whose gains stay as they are.".to_owned())
            })?;
            r2params::merge(base, &files::read_text(base)?, &calibration)?
        }
        Format::Defines => defines::header(&calibration),
        Format::Rosparam => rosparam::yaml(&args.identified, &robot, &calibration)?,
    };
    let old = old(&args.output, &text)?;
    let kept = old.as_ref().map(|(kept, _)| kept.as_path());
    files::apart::<&Path>([], &[("what -o keeps", kept), ("--json", args.json.as_deref())])?;
    if let Some((kept, contents)) = &old {
        files::write_atomic(kept, contents)?;
    }
    cli::write_text(&args.output, &text, out)?;
    let warnings = warnings(args, &robot, &calibration);
    let carried = calibration.identified.iter().filter(|entry| calibration.carries(args.format, &entry.key));
    let written = Written {
        format: args.format,
        output: &args.output,
        kept,
        numbers: carried.map(Number::from).collect(),
        logs: calibration.logs().into_iter().map(|(name, sha256)| Log { name, sha256 }).collect(),
        warnings: &warnings,
    };
    cli::results(out, "", args.json.as_deref(), &written)?;
    warnings.iter().for_each(|sentence| cli::warn(sentence));
    Ok(Outcome::Done)
}

/// What is to be said beside the file.
fn warnings(args: &Export, robot: &Robot, calibration: &Calibration) -> Vec<String> {
    let mut warnings = calibration.left_out(args.format);
    warnings.extend(remarks(&calibration.identified));
    if !robot.effects.is_empty() {
        let listed: Vec<&str> = robot.effects.iter().map(|effect| effect.id.as_str()).collect();
        warnings.push(format!(
            "{}: the controller has no constants for {}, which the robot file lists as effects; they are not in this file.",
            args.identified.display(),
            listed.join(", ")
        ));
    }
    if robot.joints.iter().any(|joint| joint.motor_at_hard_stop.is_some()) {
        warnings.push(format!(
            "{}: once the controller loads these numbers it sets its encoders by them; remove motor_at_hard_stop from the robot file before \
             it is used on recordings made from then on.",
            args.identified.display()
        ));
    }
    warnings
}

/// What a write of `text` to a file would lose, and where to keep it: `NAME.old`, then `NAME.old2` and so on. Nothing of a file that has the
/// same text or of which a copy is kept already, of a pipe or a device, and of a recording, which is not written over.
fn old(path: &Path, text: &str) -> Result<Option<(PathBuf, Vec<u8>)>> {
    if path.as_os_str() == cli::STANDARD_OUTPUT || !path.is_file() || files::is_recording(path) {
        return Ok(None);
    }
    let contents = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    if contents == text.as_bytes() {
        return Ok(None);
    }
    let mut ending = ".old".to_owned();
    for count in 2.. {
        let mut kept = path.as_os_str().to_owned();
        kept.push(&ending);
        let kept = PathBuf::from(kept);
        if kept.symlink_metadata().is_err() {
            return Ok(Some((kept, contents)));
        }
        if kept.is_file() && std::fs::read(&kept).is_ok_and(|there| there == contents) {
            break;
        }
        ending = format!(".old{count}");
    }
    Ok(None)
}
