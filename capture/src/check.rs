//! `raven-capture check`: what is in a log, how regular it is, and what can be done with it.

use std::io::Write;
use std::path::PathBuf;

use raven::cli::{self, Outcome};
use raven::log::{Survey, recover};
use raven::{Error, Result};

/// Arguments of `raven-capture check`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The log.
    pub file: PathBuf,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Save what can be read of a damaged log in a new one.
    #[arg(long, requires = "output")]
    pub recover: bool,
    /// The new log.
    #[arg(short, long, value_name = "FILE", requires = "recover")]
    pub output: Option<PathBuf>,
}

/// Checks a log.
///
/// # Errors
/// If the file cannot be read, is no MCAP file, or a result cannot be written.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let survey = Survey::of(&args.file)?;
    writeln!(out, "{survey:#?}").map_err(|e| Error::io(std::path::Path::new("-"), "write", e))?;
    if let Some(output) = &args.output {
        recover(&args.file, output)?;
    }
    if let Some(json) = &args.json {
        cli::write_json(json, &survey)?;
    }
    Ok(if survey.damage.is_some() { Outcome::DataLost } else { Outcome::Done })
}
