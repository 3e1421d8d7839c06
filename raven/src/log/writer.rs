//! Writes a log: a file beside its place, which takes the name only when it is whole.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};

use super::robot_state::{RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, RavenState};
use super::{Attachment, Channel, Item, RawMessage, Stamp, Walker, live, topics};
use crate::{Error, Result, files};

pub(super) const LIBRARY: &str = concat!("raven-cal ", env!("CARGO_PKG_VERSION"));
/// What follows in a log that can be computed again.
const COMPUTED: &str = ", computed";
/// Name under which a log carries the robot's file that it was made with.
pub const ROBOT_FILE: &str = "robot.yaml";
/// Name under which it carries the cameras'.
pub const CAMERAS_FILE: &str = "cameras.yaml";
const YAML: &str = "application/yaml";
/// MD5 of [`RAVEN_STATE_DEFINITION`], by which ROS tells versions of a message apart.
const RAVEN_STATE_MD5: &str = "ce9e7f4969049d8bb365de3c98461a01";

/// When a message's contents were measured, and when they arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// Time of the measurement: the message's stamp and the log's `publish_time`.
    pub measured: Stamp,
    /// Time of arrival: the log's `log_time`.
    pub arrived: Stamp,
}

impl From<Stamp> for Times {
    /// A message that arrives when it is measured, as computed ones do.
    fn from(stamp: Stamp) -> Self {
        Self { measured: stamp, arrived: stamp }
    }
}

/// A channel of a [`LogWriter`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ChannelId(u16);

/// Schema of a channel: encoding of messages and schema, name and contents.
#[derive(Debug, Clone, Copy)]
pub struct SchemaRef<'a> {
    /// `ros1` or `protobuf`.
    pub message_encoding: &'a str,
    /// Name of the message type.
    pub name: &'a str,
    /// `ros1msg` or `protobuf`.
    pub encoding: &'a str,
    /// Definition text or serialized descriptor set.
    pub data: &'a [u8],
}

/// Where a log is until it has its name.
pub(super) enum Place {
    /// In a file that goes when it is dropped.
    Temporary(tempfile::NamedTempFile),
    /// In a file that stays, whatever happens.
    Active(PathBuf),
}

/// A log being written; dropped before [`LogWriter::finish`], a computed one leaves nothing behind, and a live one its active file.
pub struct LogWriter {
    pub(super) path: PathBuf,
    pub(super) writer: Writer<NoSeek<BufWriter<File>>>,
    pub(super) file: File,
    pub(super) place: Place,
    channels: HashMap<&'static str, ChannelId>,
    last: Stamp,
}

impl LogWriter {
    /// Starts a log that will be called `path`.
    ///
    /// # Errors
    /// If the folder does not exist or cannot be written to, or there is a file.
    pub fn create(path: &Path) -> Result<Self> {
        Self::with_profile(path, "")
    }

    /// Starts a log that can be computed again, which the next of its name may replace.
    ///
    /// # Errors
    /// If the folder does not exist or cannot be written to, or there is a file that was not computed.
    pub fn computed(path: &Path) -> Result<Self> {
        Self::require_computed(path)?;
        Self::temporary(path, "", &format!("{LIBRARY}{COMPUTED}"))
    }

    /// Refuses a name that [`LogWriter::computed`] would refuse once everything has been computed.
    ///
    /// # Errors
    /// If there is a file that was not computed.
    pub fn require_computed(path: &Path) -> Result<()> {
        if holds_something(path) {
            if !files::is_recording(path) {
                return Err(Error::file(path, "this file is no recording and would be lost; choose another name."));
            }
            if !is_computed(path) {
                files::unused(path)?;
            }
        }
        Ok(())
    }

    /// Starts a log with a profile, as in `ros1`: a promise that every message is in that system's encoding.
    ///
    /// # Errors
    /// Those of [`LogWriter::create`].
    pub fn with_profile(path: &Path, profile: &str) -> Result<Self> {
        if holds_something(path) {
            files::unused(path)?;
        }
        Self::temporary(path, profile, LIBRARY)
    }

    fn temporary(path: &Path, profile: &str, library: &str) -> Result<Self> {
        let temporary = files::temporary_beside(path)?;
        let file = temporary.as_file().try_clone().map_err(|e| Error::io(path, "write", e))?;
        Self::start(path, profile, library, Place::Temporary(temporary), file)
    }

    pub(super) fn start(path: &Path, profile: &str, library: &str, place: Place, file: File) -> Result<Self> {
        // More threads make compression slower: the work per chunk is too small to share. Chunks written whole leave no file whose last chunk
        // has no length yet.
        let options = WriteOptions::new().library(library).profile(profile).compression_threads(0).disable_seeking(true);
        let out = BufWriter::with_capacity(1 << 18, file.try_clone().map_err(|e| Error::io(path, "write", e))?);
        let writer = options.create(NoSeek::new(out)).map_err(|e| fault(path, e))?;
        Ok(Self { path: path.to_owned(), writer, file, place, channels: HashMap::new(), last: Stamp(0) })
    }

    /// Adds a channel, or finds the one that is the same.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn add_channel(&mut self, topic: &str, schema: SchemaRef<'_>, metadata: &BTreeMap<String, String>) -> Result<ChannelId> {
        let id = if schema.encoding.is_empty() {
            0
        } else {
            self.writer.add_schema(schema.name, schema.encoding, schema.data).map_err(|e| fault(&self.path, e))?
        };
        let id = self.writer.add_channel(id, topic, schema.message_encoding, metadata).map_err(|e| fault(&self.path, e))?;
        Ok(ChannelId(id))
    }

    /// Writes an encoded message.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn write(&mut self, channel: ChannelId, times: impl Into<Times>, sequence: u32, data: &[u8]) -> Result<()> {
        let Times { measured, arrived } = times.into();
        self.last = self.last.max(arrived);
        let header = MessageHeader { channel_id: channel.0, sequence, log_time: arrived.0, publish_time: measured.0 };
        self.writer.write_to_known_channel(&header, data).map_err(|e| fault(&self.path, e))
    }

    /// Writes the robot's own message in the layout of the public controller.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn robot_state(&mut self, times: impl Into<Times>, state: &RavenState) -> Result<()> {
        let times = times.into();
        let channel = self.channel(topics::RAVEN_STATE, |log| {
            let schema = SchemaRef {
                message_encoding: "ros1",
                name: RAVEN_STATE_TYPE,
                encoding: "ros1msg",
                data: RAVEN_STATE_DEFINITION.as_bytes(),
            };
            let metadata = BTreeMap::from([("md5sum".to_owned(), RAVEN_STATE_MD5.to_owned())]);
            log.add_channel(topics::RAVEN_STATE, schema, &metadata)
        })?;
        self.write(channel, times, state.seq, &state.encode(times.measured))
    }

    /// Writes a metadata record, as in `session`.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn metadata(&mut self, name: &str, pairs: &BTreeMap<String, String>) -> Result<()> {
        let record = Metadata { name: name.to_owned(), metadata: pairs.clone() };
        self.writer.write_metadata(&record).map_err(|e| fault(&self.path, e))
    }

    /// Stores a file in the log, dated by the last message.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn attachment(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<()> {
        let (name, media_type) = (name.to_owned(), media_type.to_owned());
        self.copy_attachment(&Attachment { name, media_type, data: data.to_vec(), log_time: self.last, create_time: self.last })
    }

    /// Stores the robot's file and the cameras', with which the log was made.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn made_with(&mut self, robot: &str, cameras: Option<&[u8]>) -> Result<()> {
        self.attachment(ROBOT_FILE, YAML, robot.as_bytes())?;
        cameras.map_or(Ok(()), |cameras| self.attachment(CAMERAS_FILE, YAML, cameras))
    }

    /// Stores an attachment of another log, with its dates.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn copy_attachment(&mut self, attachment: &Attachment) -> Result<()> {
        let record = mcap::Attachment {
            log_time: attachment.log_time.0,
            create_time: attachment.create_time.0,
            name: attachment.name.clone(),
            media_type: attachment.media_type.clone(),
            data: attachment.data.as_slice().into(),
        };
        self.writer.attach(&record).map_err(|e| fault(&self.path, e))
    }

    /// Adds a channel of another log with its topic, schema and metadata.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn copy_channel(&mut self, channel: &Channel) -> Result<ChannelId> {
        let (name, encoding, data) =
            channel.schema.as_ref().map_or(("", "", &[][..]), |schema| (&schema.name, &schema.encoding, &schema.data));
        let schema = SchemaRef { message_encoding: &channel.message_encoding, name, encoding, data };
        self.add_channel(&channel.topic, schema, &channel.metadata)
    }

    /// Writes a message of another log byte for byte, with its times and its sequence number.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn copy_message(&mut self, channel: ChannelId, message: &RawMessage<'_>) -> Result<()> {
        let times = Times { measured: message.publish_time, arrived: message.log_time };
        self.write(channel, times, message.sequence, message.data)
    }

    /// Completes the file: index, sync, rename.
    ///
    /// # Errors
    /// If the disk is full; nothing is left behind then, or of a live log its active file.
    pub fn finish(mut self) -> Result<()> {
        self.writer.finish().map_err(|e| fault(&self.path, e))?;
        let buffer = self.writer.into_inner().into_inner();
        buffer.into_inner().map_err(|e| Error::io(&self.path, "write", e.into_error()))?;
        match self.place {
            Place::Temporary(temporary) => files::persist(temporary, &self.path),
            Place::Active(active) => {
                self.file.sync_all().map_err(|e| Error::io(&self.path, "sync", e))?;
                live::rename(&active, &self.path)
            }
        }
    }

    /// The channel of one of the known topics, made on first use.
    pub(super) fn channel(&mut self, topic: &'static str, make: impl FnOnce(&mut Self) -> Result<ChannelId>) -> Result<ChannelId> {
        if let Some(&channel) = self.channels.get(topic) {
            return Ok(channel);
        }
        let channel = make(self)?;
        self.channels.insert(topic, channel);
        Ok(channel)
    }
}

pub(super) fn fault(path: &Path, error: McapError) -> Error {
    match error {
        McapError::Io(source) => Error::io(path, "write", source),
        other => Error::file(path, format!("the log cannot be written: {other}.")),
    }
}

fn holds_something(path: &Path) -> bool {
    path.metadata().is_ok_and(|there| there.is_file() && there.len() > 0)
}

/// Whether a log says of itself that it can be computed again.
fn is_computed(path: &Path) -> bool {
    let mut computed = false;
    let mut visit = |item: Item<'_>| {
        if let Item::Start { library, .. } = item {
            computed = library.starts_with("raven-cal") && library.ends_with(COMPUTED);
        }
        Ok(())
    };
    Walker::open(path).and_then(|mut walker| walker.step(&mut visit)).is_ok() && computed
}
