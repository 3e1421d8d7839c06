//! End-to-end tests of raven-cal: whole programs on whole sessions. The tests are in `tests/`; this is what they share.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Parser;
use raven::cli::Outcome;
use serde_json::Value;

/// A program's entry point.
pub type Run<A> = fn(A, &mut dyn Write) -> raven::Result<Outcome>;

/// Data that stand beside the repository, or `None` with a line that says what is skipped.
#[must_use]
pub fn shared(path: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(path);
    if path.exists() {
        return Some(path);
    }
    aloud(&format!("SKIPPED: {} is not there", path.display()));
    None
}

/// Says something past the harness, which keeps the output of tests that pass to itself.
pub fn aloud(sentence: &str) {
    let _unheard = Command::new("sh").args(["-c", "echo \"$1\" >&2", "sh", sentence]).status();
}

/// A Python that can import these modules, or `None` with a line that says how to get them.
#[must_use]
pub fn python(modules: &str, hint: &str) -> Option<&'static str> {
    let can = |python: &&str| {
        let asked = Command::new(python).args(["-c", &format!("import {modules}")]).stdout(Stdio::null()).stderr(Stdio::null()).status();
        asked.is_ok_and(|status| status.success())
    };
    let found = ["python3", "/usr/bin/python3"].into_iter().find(can);
    if found.is_none() {
        aloud(&format!("SKIPPED: what needs a python3 that imports {modules} ({hint})"));
    }
    found
}

/// Runs a program as if typed; `{name}` in the arguments stands for the file `name` in `folder`. Gives what it printed.
///
/// # Errors
/// What the program fails with, or the usage text.
pub fn typed<A: Parser>(folder: &Path, run: Run<A>, arguments: &[&str]) -> Result<(Outcome, String), String> {
    let expand = |argument: &&str| match argument.strip_prefix('{').and_then(|a| a.strip_suffix('}')) {
        Some(name) => folder.join(name).display().to_string(),
        None => (*argument).to_owned(),
    };
    let line = std::iter::once("program".to_owned()).chain(arguments.iter().map(expand));
    let args = A::try_parse_from(line).map_err(|e| e.to_string())?;
    let mut printed = Vec::new();
    let outcome = run(args, &mut printed).map_err(|e| e.to_string())?;
    Ok((outcome, String::from_utf8_lossy(&printed).into_owned()))
}

/// Reads a JSON file that a program wrote into `folder`.
///
/// # Panics
/// If it is not there or no JSON: the test fails.
#[must_use]
pub fn json(folder: &Path, name: &str) -> Value {
    let text = std::fs::read_to_string(folder.join(name)).expect("the program wrote its JSON");
    serde_json::from_str(&text).expect("the program's JSON is JSON")
}

/// A number in a JSON value, by pointer.
///
/// # Panics
/// If there is none: the test fails.
#[must_use]
pub fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number at {pointer} in {value:#}"))
}
