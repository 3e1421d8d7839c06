//! Verdicts that can no longer be changed: the key to the labels.

use std::collections::BTreeMap;
use std::path::Path;

use raven::simulation::{Labels, SealedFolder};
use raven::{Error, Result, files};
use serde_json::{Value, json};

use super::score::Answer;

/// Verdicts that were written, with their sum.
#[derive(Debug)]
pub struct Committed {
    sum: String,
}

impl Committed {
    /// Writes the verdicts, by recording, to a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(path: &Path, answers: &[Answer]) -> Result<Self> {
        let value = |answer: &Answer| match &answer.verdict {
            Ok(verdict) => json!(verdict),
            Err(error) => json!({ "error": error }),
        };
        let verdicts: BTreeMap<&str, Value> = answers.iter().map(|answer| (answer.name.as_str(), value(answer))).collect();
        let mut text = serde_json::to_string_pretty(&verdicts).map_err(|e| Error::file(path, format!("no JSON: {e}.")))?;
        text.push('\n');
        files::write_atomic(path, text.as_bytes())?;
        Ok(Self { sum: files::sha256_of(text.as_bytes()) })
    }

    /// SHA-256 of the file.
    #[must_use]
    pub fn sum(&self) -> &str {
        &self.sum
    }

    /// Reads the labels of a folder.
    ///
    /// # Errors
    /// If they are not there, or not those that were sealed.
    pub fn open_labels(&self, folder: &Path) -> Result<Labels> {
        SealedFolder::labels(folder)
    }
}
