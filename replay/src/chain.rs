//! The programs one after the other, in one process, with the commands a lab would type.

use std::io::Write;
use std::path::Path;

use clap::Parser;
use raven::cli::Outcome;
use raven::robot::nominal;
use raven::{Error, Result, files};
use serde_json::Value;

/// What every run leaves in its folder: what was hidden.
pub const TRUTH: &str = "truth.json";

/// The words of a command as they are typed; `{name}` is the file `name` in a folder.
#[must_use]
pub fn typed(folder: &Path, name: &str, arguments: &str) -> Vec<String> {
    let expand = |word: &str| match word.strip_prefix('{').and_then(|w| w.strip_suffix('}')) {
        Some(file) => folder.join(file).display().to_string(),
        None => word.to_owned(),
    };
    [name.to_owned()].into_iter().chain(arguments.split_whitespace().map(expand)).collect()
}

/// One program of the chain, with its arguments as they would be typed.
pub type Program = fn(&[String], &mut dyn Write) -> Result<Outcome>;

/// Runs the steps one after the other and keeps what they printed.
pub struct Chain<'a> {
    folder: &'a Path,
    out: &'a mut dyn Write,
    /// Commands and what they printed.
    transcript: String,
    /// Whether any step lost data.
    outcome: Outcome,
}

impl<'a> Chain<'a> {
    /// A chain that works in `folder`, which then holds the nominal `robot.yaml`, and prints to `out`.
    ///
    /// # Errors
    /// If the folder cannot be written to, or holds files of others: those of a recording day have the same names.
    pub fn begin(folder: &'a Path, out: &'a mut dyn Write) -> Result<Self> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let mut there = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "read", e))?;
        if there.next().is_some() && !folder.join(TRUTH).exists() {
            let message =
                format!("the folder holds files and no {TRUTH} of an earlier run: they might be written over; name a new folder.");
            return Err(Error::file(folder, message));
        }
        files::write_atomic(&folder.join("robot.yaml"), nominal::GOLD_YAML.as_bytes())?;
        Ok(Self { folder, out, transcript: String::new(), outcome: Outcome::Done })
    }

    /// Runs a program; `{name}` in its arguments is the file `name` in the chain's folder.
    ///
    /// # Errors
    /// If the program fails or its output cannot be written.
    pub fn step(&mut self, name: &str, program: Program, arguments: &str) -> Result<()> {
        let typed = typed(self.folder, name, arguments);
        let shown: Vec<String> = typed.iter().map(|w| if w.contains(' ') { format!("'{w}'") } else { w.clone() }).collect();
        self.say(&format!("$ {}", shown.join(" ")))?;
        let mut printed = Vec::new();
        if program(&typed, &mut printed)? == Outcome::DataLost {
            self.outcome = Outcome::DataLost;
        }
        self.say(&String::from_utf8_lossy(&printed))
    }

    /// Prints a line and keeps it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn say(&mut self, text: &str) -> Result<()> {
        let line = format!("{text}\n");
        self.transcript += &line;
        raven::cli::print(&mut self.out, &line)
    }

    /// Leaves what was typed and printed in the folder as `name`; data that any step lost is lost to the chain.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self, name: &str) -> Result<Outcome> {
        files::write_atomic(&self.folder.join(name), self.transcript.as_bytes())?;
        Ok(self.outcome)
    }
}

/// Reads what a step has left for machines.
///
/// # Errors
/// If the file cannot be read or is no JSON.
pub fn read_json(path: &Path) -> Result<Value> {
    serde_json::from_str(&files::read_text(path)?).map_err(|e| Error::file(path, format!("is no JSON: {e}.")))
}

fn parse<A: Parser>(typed: &[String]) -> Result<A> {
    A::try_parse_from(typed).map_err(|e| Error::Argument(e.to_string()))
}

/// `raven-capture`.
///
/// # Errors
/// Its own.
pub fn capture(typed: &[String], out: &mut dyn Write) -> Result<Outcome> {
    raven_capture::run(parse(typed)?, out)
}

/// `raven-calibrate`.
///
/// # Errors
/// Its own.
pub fn calibrate(typed: &[String], out: &mut dyn Write) -> Result<Outcome> {
    raven_calibrate::run(parse(typed)?, out)
}

/// `raven-track`.
///
/// # Errors
/// Its own.
pub fn track(typed: &[String], out: &mut dyn Write) -> Result<Outcome> {
    raven_track::run(parse(typed)?, out)
}

/// `raven-identify`.
///
/// # Errors
/// Its own.
pub fn identify(typed: &[String], out: &mut dyn Write) -> Result<Outcome> {
    raven_identify::run(parse(typed)?, out)
}

/// `raven-replay`.
///
/// # Errors
/// Its own.
pub fn replay(typed: &[String], out: &mut dyn Write) -> Result<Outcome> {
    crate::run(parse(typed)?, out)
}

/// `raven-diagnose`.
///
/// # Errors
/// Its own.
pub fn diagnose(typed: &[String], out: &mut dyn Write) -> Result<Outcome> {
    raven_diagnose::run(parse(typed)?, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_that_a_step_lost_are_lost_to_the_chain() {
        let folder = tempfile::tempdir().unwrap();
        let mut nowhere = Vec::new();
        let mut chain = Chain::begin(folder.path(), &mut nowhere).unwrap();
        let (whole, torn): (Program, Program) = (|_, _| Ok(Outcome::Done), |_, _| Ok(Outcome::DataLost));
        [whole, torn, whole].iter().for_each(|program| chain.step("raven-any", *program, "{robot.yaml}").unwrap());
        assert_eq!(chain.finish("typed.txt").unwrap(), Outcome::DataLost);
        assert!(files::read_text(&folder.path().join("typed.txt")).unwrap().contains("$ raven-any"));
    }

    #[test]
    fn a_folder_of_a_recording_day_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let (at, mut nowhere) = (folder.path(), Vec::new());
        std::fs::write(at.join("cameras.yaml"), "mine").unwrap();
        let refused = Chain::begin(at, &mut nowhere).err().unwrap().to_string();
        assert!(refused.contains("name a new folder") && !at.join("robot.yaml").exists(), "{refused}");
        let new = at.join("new/tour");
        Chain::begin(&new, &mut nowhere).unwrap();
        std::fs::write(new.join(TRUTH), "{}").unwrap();
        Chain::begin(&new, &mut nowhere).unwrap();
    }
}
