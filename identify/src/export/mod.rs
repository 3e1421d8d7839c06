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
use std::path::Path;

use raven::cli::{self, Outcome};
use raven::robot::Robot;
use raven::{Error, Result, files};

use crate::args::{Export, Format};
use calibration::{Calibration, remarks};

/// Writes the file that the arguments ask for.
///
/// # Errors
/// With a sentence, if the robot file carries nothing to export or something that must not be, or a file cannot be read or written.
pub fn run(args: &Export, out: &mut dyn Write) -> Result<Outcome> {
    if args.base.is_some() && args.format != Format::R2params {
        return Err(Error::Argument("--base goes with --format r2params, whose gains it holds.".to_owned()));
    }
    files::apart([&args.identified], &[("-o", Some(&args.output))])?;
    let robot = Robot::read(&args.identified)?;
    let calibration = Calibration::new(&args.identified, &robot)?;
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
    if args.output.as_os_str() == cli::STANDARD_OUTPUT {
        cli::print(out, &text)?;
    } else {
        write_keeping_old(&args.output, &text)?;
    }
    calibration.left_out(args.format).iter().chain(&remarks(&calibration.identified)).for_each(|sentence| cli::warn(sentence));
    if !robot.effects.is_empty() {
        let listed: Vec<&str> = robot.effects.iter().map(|effect| effect.id.as_str()).collect();
        cli::warn(&format!(
            "{}: the controller has no constants for {}, which the robot file lists as effects; they are not in this file.",
            args.identified.display(),
            listed.join(", ")
        ));
    }
    if robot.joints.iter().any(|joint| joint.motor_at_hard_stop.is_some()) {
        cli::warn(&format!(
            "{}: once the controller loads these numbers it sets its encoders by them; remove motor_at_hard_stop from the robot file before \
             it is used on recordings made from then on.",
            args.identified.display()
        ));
    }
    Ok(Outcome::Done)
}

/// Writes in one step and keeps what was there before as `NAME.old`.
fn write_keeping_old(path: &Path, text: &str) -> Result<()> {
    if let Ok(old) = std::fs::read(path) {
        if old == text.as_bytes() {
            return Ok(());
        }
        let mut kept = path.as_os_str().to_owned();
        kept.push(".old");
        files::write_atomic(Path::new(&kept), &old)?;
    }
    files::write_atomic(path, text.as_bytes())
}
