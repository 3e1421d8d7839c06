//! Copies a log, message by message.

use std::collections::HashMap;
use std::path::Path;

use super::{Item, LogWriter, RawMessage, Walker};
use crate::{Error, Result, files};

/// A copy that does not have its name yet, and the walk that it was made on, at its end.
pub(super) struct Copy {
    log: Option<LogWriter>,
    pub walker: Walker,
    pub messages: u64,
    pub attachments: u64,
}

impl Copy {
    /// Copies every topic, attachment and metadata record of `input` that can be read, and of the messages those that are `kept`, which hears of them
    /// in the order of the file.
    ///
    /// # Errors
    /// If `input` cannot be read or is no MCAP file, or `output` exists or cannot be written.
    pub fn new(input: &Path, output: &Path, mut kept: impl FnMut(&RawMessage<'_>) -> bool) -> Result<Self> {
        let mut walker = Walker::open(input)?;
        files::unused(output)?;
        let mut writer = None;
        let mut ids = HashMap::new();
        let (mut messages, mut attachments) = (0, 0);
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
                    Some(&id) if kept(&message) => {
                        messages += 1;
                        log.copy_message(id, &message)
                    }
                    _ => Ok(()),
                },
                Item::Attachment(attachment) => {
                    attachments += 1;
                    log.copy_attachment(&attachment)
                }
                Item::Metadata(name, pairs) => log.metadata(&name, &pairs),
            }
        })?;
        Ok(Self { log: writer, walker, messages, attachments })
    }

    /// Gives the copy its name, unless it has no message.
    ///
    /// # Errors
    /// `without_messages` if it has none, or if it cannot be written.
    pub fn finish(self, without_messages: impl FnOnce() -> Error) -> Result<()> {
        match self.log {
            Some(log) if self.messages > 0 => log.finish(),
            _ => Err(without_messages()),
        }
    }
}
