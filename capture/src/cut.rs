//! `raven-capture cut`: a part of a log as one of its own.

use std::io::Write;
use std::path::PathBuf;

use raven::cli::{self, Outcome};
use raven::log::cut;
use raven::{Error, Result, files};

use crate::number::not_negative;

/// Arguments of `raven-capture cut`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  raven-capture cut session.mcap --from 12 --to 45.5 -o part.mcap\n\n\
                        Seconds count from the first message by time of arrival. Exit codes: 0 done, 1 failed, 2 wrong arguments.")]
pub struct Args {
    /// The log.
    pub file: PathBuf,
    /// Start of the part.
    #[arg(long, value_name = "SECONDS", value_parser = not_negative, default_value = "0", allow_negative_numbers = true)]
    pub from: f64,
    /// End of the part; the end of the log if it is not given.
    #[arg(long, value_name = "SECONDS", value_parser = not_negative, allow_negative_numbers = true)]
    pub to: Option<f64>,
    /// The new log.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Cuts a part out of a log.
///
/// # Errors
/// If the part ends before it begins or holds no message, the log is damaged or cannot be read, or the new one exists or cannot be written.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    files::apart([&args.file], &[("-o", Some(args.output.as_path())), ("--json", args.json.as_deref())])?;
    let to_s = args.to.unwrap_or(f64::INFINITY);
    if to_s <= args.from {
        return Err(Error::Argument(format!("--to {to_s} does not come after --from {}: give a later end.", args.from)));
    }
    let cut = cut(&args.file, &args.output, &(args.from..to_s))?;
    let end_s = to_s.min(cut.length_s);
    let text =
        format!("{} of {} messages, from {:.3} to {end_s:.3} s, are in {}.\n", cut.messages, cut.of, args.from, args.output.display());
    cli::results(out, &text, args.json.as_deref(), &cut)?;
    Ok(Outcome::Done)
}
