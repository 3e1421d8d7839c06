//! What the programs share: outcomes and exit codes, progress on a terminal, results as JSON.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 done, 1 failed, 2 wrong arguments, 3 done with data
//! lost.

use std::io::Write;
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

/// Stands for standard output where a file is asked for.
pub const STANDARD_OUTPUT: &str = "-";

/// Prints on standard output, or what stands in for it.
///
/// # Errors
/// If it is closed.
pub fn print(out: &mut dyn Write, text: &str) -> Result<()> {
    out.write_all(text.as_bytes()).map_err(|e| Error::io(Path::new("standard output"), "write to", e))
}

/// Writes a text file; [`STANDARD_OUTPUT`] is standard output.
///
/// # Errors
/// If it cannot be written.
pub fn write_text(path: &Path, text: &str, out: &mut dyn Write) -> Result<()> {
    if path.as_os_str() == STANDARD_OUTPUT { print(out, text) } else { files::write_atomic(path, text.as_bytes()) }
}

/// Whether standard output is left for results in words: none of `outputs`, which come with the options that name them, goes there.
///
/// # Errors
/// If two of them are to go there.
pub fn is_left_for_words(outputs: &[(&str, Option<&Path>)]) -> Result<bool> {
    let goes_there = |path: &Path| path.as_os_str() == STANDARD_OUTPUT;
    let mut there = outputs.iter().filter(|(_, path)| path.is_some_and(goes_there)).map(|(option, _)| option);
    match (there.next(), there.next()) {
        (Some(one), Some(other)) => {
            Err(Error::Argument(format!("{one} and {other} are both `-`, and standard output takes one of them; name a file.")))
        }
        (one, _) => Ok(one.is_none()),
    }
}

/// Prints results in words, and writes them for machines where that is asked for; [`STANDARD_OUTPUT`] is for the machine alone.
///
/// # Errors
/// If either cannot be written.
pub fn results(out: &mut dyn Write, text: &str, json: Option<&Path>, value: &impl Serialize) -> Result<()> {
    match json {
        Some(path) if path.as_os_str() == STANDARD_OUTPUT => print(out, &json_text(path, value)?),
        Some(path) => write_json(path, value).and_then(|()| print(out, text)),
        None => print(out, text),
    }
}

/// Writes a file for machines.
///
/// # Errors
/// If it cannot be written.
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    files::write_atomic(path, json_text(path, value)?.as_bytes())
}

fn json_text(path: &Path, value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::file(path, format!("the result is no JSON: {e}.")))?;
    Ok(text + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_output_is_for_the_machine_alone_if_it_is_asked_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.json");
        for (json, must_print) in [(None, "in words\n"), (Some(path.as_path()), "in words\n"), (Some(Path::new("-")), "[\n  1\n]\n")] {
            let mut out = Vec::new();
            results(&mut out, "in words\n", json, &[1]).unwrap();
            assert_eq!(String::from_utf8(out).unwrap(), must_print);
        }
        assert_eq!(std::fs::read_to_string(path).unwrap(), "[\n  1\n]\n");
    }

    #[test]
    fn a_closed_pipe_is_an_error_and_no_panic() {
        struct Closed;
        impl Write for Closed {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::BrokenPipe.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        assert!(results(&mut Closed, "", Some(Path::new("-")), &[1]).unwrap_err().to_string().contains("standard output"));
    }
}
