//! What the programs share: outcomes and exit codes, progress on a terminal, results as JSON.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 done, 1 failed, 2 wrong arguments, 3 done with data
//! lost.

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::{Error, Result, files};

/// How a program ended when it did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for was done: exit code 0.
    Done,
    /// Done, but some of the input could not be used: exit code 3.
    DataLost,
}

/// Turns the result of a program into its exit code and prints the error, if any, as one sentence on standard error.
pub fn exit(result: Result<Outcome>) -> ExitCode {
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::DataLost) => ExitCode::from(3),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(if matches!(error, Error::Argument(_)) { 2 } else { 1 })
        }
    }
}

/// Says something that is not a result on standard error.
pub fn warn(message: &str) {
    eprintln!("warning: {message}");
}

/// A progress bar over `steps`, shown on standard error where that is a terminal and hidden elsewhere.
#[must_use]
pub fn progress(steps: u64, label: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:24} {wide_bar} {pos}/{len} {eta}").unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(steps).with_style(style).with_message(label)
}

/// A spinner for work whose length is not known.
#[must_use]
pub fn spinner(label: &'static str) -> ProgressBar {
    let bar = ProgressBar::new_spinner().with_message(label);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}

/// Writes the machine-readable result; `-` is standard output.
///
/// # Errors
/// If the file cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value).map_err(|e| Error::file(path, format!("the result is no JSON: {e}.")))?;
    text.push('\n');
    if path.as_os_str() == "-" {
        print!("{text}");
        return Ok(());
    }
    files::write_atomic(path, text.as_bytes())
}
