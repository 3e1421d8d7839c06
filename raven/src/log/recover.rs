//! Saves what can be read of a damaged log.

use std::path::Path;

use super::{Damage, Item, LogWriter, Walker};
use crate::{Error, Result, files};

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
    let mut walker = Walker::open(input)?;
    files::unused(output)?;
    let mut writer = None;
    let mut ids = std::collections::HashMap::new();
    let mut attachments = 0;
    walker.run(|item| {
        let log = match (&mut writer, &item) {
            (Some(log), _) => log,
            (None, Item::Start { profile, .. }) => writer.insert(LogWriter::with_profile(output, profile)?),
            (None, _) => writer.insert(LogWriter::create(output)?),
        };
        match item {
            Item::Start { .. } => Ok(()),
            Item::Channel(channel) => {
                ids.insert(channel.id, log.copy_channel(channel)?);
                Ok(())
            }
            Item::Message(message) => match ids.get(&message.channel.id) {
                Some(&id) => log.copy_message(id, &message),
                None => Ok(()),
            },
            Item::Attachment(attachment) => {
                attachments += 1;
                log.copy_attachment(&attachment)
            }
            Item::Metadata(name, pairs) => log.metadata(&name, &pairs),
        }
    })?;
    let (messages, expected_messages, damage) = (walker.messages(), walker.expected_messages(), walker.damage().cloned());
    match writer {
        Some(log) if messages > 0 => log.finish()?,
        _ => return Err(Error::file(input, "no message in it can be read: there is nothing to save.")),
    }
    Ok(Recovery { messages, expected_messages, attachments, damage })
}
