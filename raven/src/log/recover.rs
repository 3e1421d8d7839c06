//! Saves what can be read of a damaged log.

use std::path::Path;

use super::Damage;
use super::copy::Copy;
use crate::{Error, Result};

/// What was saved.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Recovery {
    /// Messages in the new file.
    pub messages: u64,
    /// Messages the damaged file says it had, where it still says so.
    pub expected_messages: Option<u64>,
    /// Stored files in the new file.
    pub attachments: u64,
    /// What was wrong; `None` if nothing was.
    pub damage: Option<Damage>,
}

/// Copies every readable message, topic, attachment and metadata record of `input` into a new, whole log.
///
/// # Errors
/// If `input` cannot be read or is no MCAP file, or `output` exists or cannot be written.
pub fn recover(input: &Path, output: &Path) -> Result<Recovery> {
    let copy = Copy::new(input, output, |_| true)?;
    let recovery = Recovery {
        messages: copy.messages,
        expected_messages: copy.walker.expected_messages(),
        attachments: copy.attachments,
        damage: copy.walker.damage().cloned(),
    };
    copy.finish(|| Error::file(input, "no message in it can be read: there is nothing to save."))?;
    Ok(recovery)
}
