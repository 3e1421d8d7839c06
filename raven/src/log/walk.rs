//! Walks the records of an MCAP file from front to back, chunk by chunk, and keeps going past damage.
//!
//! Memory is bounded by the largest chunk. A chunk whose check sum or contents are wrong is left out; a file that was cut off is read up to
//! the cut, into its last, open chunk. What was lost stands in [`Walker::damage`]: readers that need a whole file refuse it there.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mcap::McapError;
use mcap::read::ChannelAccumulator;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::Stamp;
use crate::{Error, Result};

/// Opcode and length before every record.
const HEAD: usize = 9;
/// No record or chunk is larger: a length beyond it is damage, not data.
const RECORD_LIMIT: usize = 1 << 30;
/// Bytes handed to the decompressor at a time.
const READ_SIZE: usize = 1 << 20;

/// A topic with its encoding and schema.
pub type Channel = mcap::Channel<'static>;

/// One message as it lies in the file.
#[derive(Debug, Clone, Copy)]
pub struct RawMessage<'a> {
    /// Where it belongs.
    pub channel: &'a Arc<Channel>,
    /// Counter of the publisher, 0 if it has none.
    pub sequence: u32,
    /// Time of arrival.
    pub log_time: Stamp,
    /// Time of publication.
    pub publish_time: Stamp,
    /// The encoded message.
    pub data: &'a [u8],
}

/// A file stored inside a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attachment {
    /// Name, as in `robot.yaml`.
    pub name: String,
    /// Media type, as in `application/yaml`.
    pub media_type: String,
    /// Contents.
    pub data: Vec<u8>,
    /// When it was stored.
    pub log_time: Stamp,
    /// When the file was made.
    pub create_time: Stamp,
}

/// What a walk comes upon.
#[derive(Debug)]
pub enum Item<'a> {
    /// The start of the file.
    Start {
        /// `ros1` or nothing.
        profile: String,
        /// What wrote it.
        library: String,
    },
    /// A topic, before its first message.
    Channel(&'a Arc<Channel>),
    /// A message.
    Message(RawMessage<'a>),
    /// A stored file.
    Attachment(Attachment),
    /// A named set of key-value pairs.
    Metadata(String, BTreeMap<String, String>),
}

/// What is wrong with a file.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct Damage {
    /// Byte at which the file breaks off.
    pub cut_off_at: Option<u64>,
    /// Chunks and other records that had to be left out.
    pub bad_records: u64,
    /// The first fault in words.
    pub fault: String,
}

/// A walk over one file.
pub struct Walker {
    path: PathBuf,
    file: BufReader<File>,
    position: u64,
    length: u64,
    buffer: Vec<u8>,
    known: Known,
    expected_messages: Option<u64>,
    past_data: bool,
    done: bool,
    damage: Option<Damage>,
}

/// What the records so far have established.
#[derive(Default)]
struct Known {
    channels: ChannelAccumulator<'static>,
    messages: u64,
}

type Visit<'v> = &'v mut dyn FnMut(Item<'_>) -> Result<()>;

impl Walker {
    /// Opens a file.
    ///
    /// # Errors
    /// If it cannot be read, is empty or is no MCAP file.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
        let length = file.metadata().map_err(|e| Error::io(path, "read", e))?.len();
        let mut file = BufReader::with_capacity(1 << 16, file);
        if length == 0 {
            return Err(Error::file(path, "the file is empty."));
        }
        let mut magic = Vec::new();
        (&mut file).take(mcap::MAGIC.len() as u64).read_to_end(&mut magic).map_err(|e| Error::io(path, "read", e))?;
        if magic.starts_with(b"#ROSBAG") {
            return Err(Error::file(path, "this is a ROS 1 bag, not an MCAP file; convert it with `raven-capture import`."));
        }
        if magic != mcap::MAGIC {
            return Err(Error::file(path, "this is no MCAP file: its first bytes are not those of one."));
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            position: mcap::MAGIC.len() as u64,
            length,
            buffer: Vec::new(),
            known: Known::default(),
            expected_messages: None,
            past_data: false,
            done: false,
            damage: None,
        })
    }

    /// Messages met so far.
    #[must_use]
    pub const fn messages(&self) -> u64 {
        self.known.messages
    }

    /// How many messages the file says it has; known at the end of a walk, unless the file was cut off.
    #[must_use]
    pub const fn expected_messages(&self) -> Option<u64> {
        self.expected_messages
    }

    /// Bytes of the file.
    #[must_use]
    pub const fn length(&self) -> u64 {
        self.length
    }

    /// What was found to be wrong so far.
    #[must_use]
    pub const fn damage(&self) -> Option<&Damage> {
        self.damage.as_ref()
    }

    /// Refuses a file that turned out to be damaged; call it at the end of a walk.
    ///
    /// # Errors
    /// A sentence with the fault, how many messages are readable and how to save them.
    pub fn require_whole(&self) -> Result<()> {
        let Some(damage) = &self.damage else { return Ok(()) };
        let message = format!(
            "the file is damaged: {}; {} messages are readable. Save them with `raven-capture check {} --recover -o OUT.mcap`.",
            damage.fault,
            self.known.messages,
            self.path.display()
        );
        Err(Error::file(&self.path, message))
    }

    /// Walks the whole file.
    ///
    /// # Errors
    /// Those of [`Walker::step`].
    pub fn run(&mut self, mut visit: impl FnMut(Item<'_>) -> Result<()>) -> Result<()> {
        while self.step(&mut visit)? {}
        Ok(())
    }

    /// Walks one record of the file, a chunk with all that is in it; `false` at the end.
    ///
    /// # Errors
    /// If the disk cannot be read, or what `visit` returns. Damage is no error here.
    pub fn step(&mut self, visit: Visit<'_>) -> Result<bool> {
        if self.done {
            return Ok(false);
        }
        let left = self.length - self.position;
        if left < HEAD as u64 {
            self.cut_off();
            return Ok(false);
        }
        let mut head = [0; HEAD];
        self.file.read_exact(&mut head).map_err(|e| Error::io(&self.path, "read", e))?;
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > left - HEAD as u64 || length > RECORD_LIMIT as u64 || opcode == 0 {
            self.cut_off();
            if opcode == op::CHUNK {
                // The chunk that was open when the file was cut: what is in it up to the cut is as good as any.
                let mut rest = head.as_slice().chain(&mut self.file);
                let _ends_at_the_cut = read_records(&mut rest, false, &mut self.known, visit)?;
            }
            return Ok(false);
        }
        self.buffer.clear();
        self.buffer.extend_from_slice(&head);
        (&mut self.file).take(length).read_to_end(&mut self.buffer).map_err(|e| Error::io(&self.path, "read", e))?;
        let start = self.position;
        self.position += HEAD as u64 + length;
        if (self.buffer.len() as u64) < HEAD as u64 + length {
            self.cut_off();
            return Ok(false);
        }
        if let Err(fault) = self.record(opcode, visit)? {
            self.bad_record(start, &fault);
        }
        Ok(!self.done)
    }

    /// One whole record, in `self.buffer`.
    fn record(&mut self, opcode: u8, visit: Visit<'_>) -> Result<Result<(), McapError>> {
        let body = self.buffer.get(HEAD..).unwrap_or_default();
        match opcode {
            op::FOOTER => {
                self.done = true;
                let mut magic = Vec::new();
                let _absent_if_unreadable = (&mut self.file).take(mcap::MAGIC.len() as u64).read_to_end(&mut magic);
                if magic != mcap::MAGIC {
                    self.cut_off();
                }
            }
            op::DATA_END => self.past_data = true,
            op::STATISTICS => {
                if let Ok(Record::Statistics(statistics)) = mcap::parse_record(opcode, body) {
                    self.expected_messages = Some(statistics.message_count);
                }
            }
            // The rest of the summary repeats what the data section has said.
            _ if self.past_data => {}
            op::CHUNK => return read_records(&mut self.buffer.as_slice(), true, &mut self.known, visit),
            op::HEADER => match mcap::parse_record(opcode, body) {
                Ok(Record::Header(header)) => visit(Item::Start { profile: header.profile, library: header.library })?,
                Ok(_) => {}
                Err(fault) => return Ok(Err(fault)),
            },
            _ => return self.known.record(opcode, body, visit),
        }
        Ok(Ok(()))
    }

    fn cut_off(&mut self) {
        self.done = true;
        let (position, length) = (self.position, self.length);
        let damage = self.damage.get_or_insert_with(|| Damage {
            fault: format!("it breaks off in the record at byte {position} of {length}"),
            ..Damage::default()
        });
        damage.cut_off_at = Some(position);
    }

    fn bad_record(&mut self, start: u64, fault: &McapError) {
        let damage = self
            .damage
            .get_or_insert_with(|| Damage { fault: format!("the record at byte {start} is bad ({fault})"), ..Damage::default() });
        damage.bad_records += 1;
    }
}

/// Decodes the records of `source`: a whole chunk, or the file's tail.
fn read_records(source: &mut dyn Read, whole: bool, known: &mut Known, visit: Visit<'_>) -> Result<Result<(), McapError>> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(whole)
        .with_record_length_limit(RECORD_LIMIT);
    let mut reader = LinearReader::new_with_options(options);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(need)) => match source.read(reader.insert(need.min(READ_SIZE))) {
                Ok(read) => reader.notify_read(read),
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Ok(Err(e.into())),
            },
            Ok(LinearReadEvent::Record { data, opcode }) => {
                if let Err(fault) = known.record(opcode, data, visit)? {
                    return Ok(Err(fault));
                }
            }
            Err(fault) => return Ok(Err(fault)),
        }
    }
    Ok(Ok(()))
}

impl Known {
    fn record(&mut self, opcode: u8, body: &[u8], visit: Visit<'_>) -> Result<Result<(), McapError>> {
        match opcode {
            op::MESSAGE => self.message(body, visit),
            op::SCHEMA | op::CHANNEL | op::METADATA => self.other(opcode, body, visit),
            op::ATTACHMENT if attachment_is_whole(body) => self.other(opcode, body, visit),
            op::ATTACHMENT => Ok(Err(McapError::UnexpectedEof)),
            _ => Ok(Ok(())),
        }
    }

    fn message(&mut self, body: &[u8], visit: Visit<'_>) -> Result<Result<(), McapError>> {
        let Some((&[c0, c1, s0, s1, s2, s3, ref times @ ..], data)) = body.split_first_chunk::<22>() else {
            return Ok(Err(McapError::UnexpectedEof));
        };
        let (id, sequence) = (u16::from_le_bytes([c0, c1]), u32::from_le_bytes([s0, s1, s2, s3]));
        let time = |at: usize| Stamp(times.get(at..).and_then(|t| t.first_chunk()).map_or(0, |t| u64::from_le_bytes(*t)));
        let Some(channel) = self.channels.get(id) else { return Ok(Err(McapError::UnknownChannel(sequence, id))) };
        self.messages += 1;
        visit(Item::Message(RawMessage { channel: &channel, sequence, log_time: time(0), publish_time: time(8), data }))?;
        Ok(Ok(()))
    }

    fn other(&mut self, opcode: u8, body: &[u8], visit: Visit<'_>) -> Result<Result<(), McapError>> {
        let record = match mcap::parse_record(opcode, body) {
            Ok(record) => record,
            Err(fault) => return Ok(Err(fault)),
        };
        let outcome = match record {
            Record::Schema { header, data } => self.channels.add_schema(header, data.into_owned().into()),
            Record::Channel(channel) => {
                let (id, seen) = (channel.id, self.channels.get(channel.id).is_some());
                let outcome = self.channels.add_channel(channel);
                if let (false, Some(channel)) = (seen, self.channels.get(id)) {
                    visit(Item::Channel(&channel))?;
                }
                outcome
            }
            Record::Metadata(metadata) => {
                visit(Item::Metadata(metadata.name, metadata.metadata))?;
                Ok(())
            }
            Record::Attachment { header, data, .. } => {
                visit(Item::Attachment(Attachment {
                    name: header.name,
                    media_type: header.media_type,
                    data: data.into_owned(),
                    log_time: Stamp(header.log_time),
                    create_time: Stamp(header.create_time),
                }))?;
                Ok(())
            }
            _ => Ok(()),
        };
        Ok(outcome)
    }
}

/// Whether an attachment's lengths fit its record: two times, two strings, the data and a check sum.
fn attachment_is_whole(body: &[u8]) -> bool {
    let text = |rest: &[u8]| -> Option<usize> { usize::try_from(u32::from_le_bytes(*rest.first_chunk()?)).ok()?.checked_add(4) };
    let fits = || -> Option<bool> {
        let rest = body.get(16..)?;
        let rest = rest.get(text(rest)?..)?;
        let rest = rest.get(text(rest)?..)?;
        let data = usize::try_from(u64::from_le_bytes(*rest.first_chunk()?)).ok()?;
        Some(data.checked_add(12)? <= rest.len())
    };
    fits().unwrap_or(false)
}
