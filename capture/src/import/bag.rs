//! ROS 1 bags, format 2.0 (wiki.ros.org/Bags/Format/2.0), read from the beginning to the end.
//!
//! A bag is a line of text and then records: a header of fields `name=value` and data, each after its length. The index at the end is not used, so a
//! bag that was cut off reads up to the cut.

use std::collections::BTreeMap;
use std::io::{self, Read};

use super::chunk::unpack;

/// What a bag begins with.
pub const MAGIC: &[u8] = b"#ROSBAG V2.0\n";
/// No header is this long, and no record; what says so is damaged.
const LARGEST_HEADER: u32 = 1 << 20;
const LARGEST_DATA: u32 = 1 << 31;

/// Kinds of records that matter; the others are the bag's own header and its index.
const MESSAGE: u8 = 0x02;
const CHUNK: u8 = 0x05;
const CONNECTION: u8 = 0x07;

/// What a bag holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Entry {
    /// A publisher of a topic. It may be said again, and comes before its messages.
    Connection {
        /// Its number.
        id: u32,
        /// Topic under which it was recorded.
        topic: String,
        /// Message type, as in `sensor_msgs/Image`.
        message_type: String,
        /// The message's definition.
        definition: String,
        /// Everything else that was said when it connected, as in `md5sum`.
        metadata: BTreeMap<String, String>,
    },
    /// A message.
    Message {
        /// Whose it is.
        connection: u32,
        /// When it arrived: seconds and nanoseconds.
        time: [u32; 2],
        /// Its bytes.
        data: Vec<u8>,
    },
}

/// Why a bag cannot be read on.
#[derive(Debug, thiserror::Error)]
pub enum BagFault {
    /// The operating system says so, or the file ends within a record.
    #[error("{0}")]
    Read(#[from] io::Error),
    /// What stands there is not a bag's.
    #[error("{0}")]
    Malformed(String),
}

/// Reads the first line.
///
/// # Errors
/// If it is empty or no bag of format 2.0.
pub fn read_magic(input: &mut impl Read) -> Result<(), BagFault> {
    let mut magic = Vec::with_capacity(MAGIC.len());
    input.by_ref().take(MAGIC.len() as u64).read_to_end(&mut magic)?;
    match magic.as_slice() {
        MAGIC => Ok(()),
        [] => Err(BagFault::Malformed("the file is empty".to_owned())),
        _ => Err(BagFault::Malformed("it does not begin as a bag of format 2.0 does".to_owned())),
    }
}

/// Reads one record and gives what is in it to `take`; `false` at the end.
///
/// # Errors
/// If the record is damaged or cut off, or `take` fails.
pub fn read_record<E: From<BagFault>>(input: &mut impl Read, take: &mut impl FnMut(Entry) -> Result<(), E>) -> Result<bool, E> {
    let Some((fields, data)) = record(input)? else { return Ok(false) };
    match fields.kind()? {
        CHUNK => {
            let chunk = unpack(&fields.text("compression")?, fields.number("size")?, &data)?;
            let mut inside = chunk.as_slice();
            while let Some((fields, data)) = record(&mut inside)? {
                if let Some(entry) = entry(&fields, data)? {
                    take(entry)?;
                }
            }
        }
        _ => {
            if let Some(entry) = entry(&fields, data)? {
                take(entry)?;
            }
        }
    }
    Ok(true)
}

fn entry(fields: &Fields, data: Vec<u8>) -> Result<Option<Entry>, BagFault> {
    match fields.kind()? {
        CONNECTION => {
            let said = Fields::parse(&data)?;
            let mut metadata: BTreeMap<String, String> =
                said.0.keys().filter_map(|key| Some((key.clone(), said.text(key).ok()?))).collect();
            let (message_type, definition) = (said.text("type")?, said.text("message_definition")?);
            metadata.retain(|key, _| !["type", "message_definition", "topic"].contains(&key.as_str()));
            Ok(Some(Entry::Connection { id: fields.number("conn")?, topic: fields.text("topic")?, message_type, definition, metadata }))
        }
        MESSAGE => {
            let time = fields.bytes("time")?;
            let part = |from: usize| time.get(from..from + 4).and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes);
            let (Some(seconds), Some(nanoseconds)) = (part(0), part(4)) else {
                return Err(BagFault::Malformed(format!("a field `time` has {} bytes instead of 8", time.len())));
            };
            Ok(Some(Entry::Message { connection: fields.number("conn")?, time: [seconds, nanoseconds], data }))
        }
        _ => Ok(None),
    }
}

/// The fields of a header.
struct Fields(BTreeMap<String, Vec<u8>>);

impl Fields {
    fn parse(mut bytes: &[u8]) -> Result<Self, BagFault> {
        let mut fields = BTreeMap::new();
        while !bytes.is_empty() {
            let field = sized(&mut bytes, LARGEST_HEADER)?.ok_or_else(cut_off)?;
            let equals =
                field.iter().position(|&byte| byte == b'=').ok_or_else(|| BagFault::Malformed("a field has no name".to_owned()))?;
            let (name, value) = field.split_at(equals);
            fields.insert(String::from_utf8_lossy(name).into_owned(), value.get(1..).unwrap_or_default().to_vec());
        }
        Ok(Self(fields))
    }

    fn bytes(&self, name: &str) -> Result<&[u8], BagFault> {
        self.0.get(name).map(Vec::as_slice).ok_or_else(|| BagFault::Malformed(format!("a record has no field `{name}`")))
    }

    fn kind(&self) -> Result<u8, BagFault> {
        self.bytes("op")?.first().copied().ok_or_else(|| BagFault::Malformed("a record has an empty field `op`".to_owned()))
    }

    fn number(&self, name: &str) -> Result<u32, BagFault> {
        let bytes = self.bytes(name)?;
        let four = bytes.try_into().map_err(|_| BagFault::Malformed(format!("a field `{name}` has {} bytes instead of 4", bytes.len())))?;
        Ok(u32::from_le_bytes(four))
    }

    fn text(&self, name: &str) -> Result<String, BagFault> {
        let text = String::from_utf8(self.bytes(name)?.to_vec());
        text.map_err(|_| BagFault::Malformed(format!("a field `{name}` is no text")))
    }
}

/// Header and data of the next record; `None` at the end.
fn record(input: &mut impl Read) -> Result<Option<(Fields, Vec<u8>)>, BagFault> {
    let Some(header) = sized(input, LARGEST_HEADER)? else { return Ok(None) };
    let data = sized(input, LARGEST_DATA)?.ok_or_else(cut_off)?;
    Ok(Some((Fields::parse(&header)?, data)))
}

/// A length and as many bytes; `None` if nothing is left.
fn sized(input: &mut impl Read, largest: u32) -> Result<Option<Vec<u8>>, BagFault> {
    let mut length = Vec::with_capacity(4);
    input.by_ref().take(4).read_to_end(&mut length)?;
    if length.is_empty() {
        return Ok(None);
    }
    let length = u32::from_le_bytes(length.try_into().map_err(|_| cut_off())?);
    if length > largest {
        return Err(BagFault::Malformed(format!("a length is {length} bytes")));
    }
    // Memory grows with what is there, not with what is said.
    let mut bytes = Vec::new();
    input.by_ref().take(length.into()).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == u64::from(length) { Ok(Some(bytes)) } else { Err(cut_off()) }
}

fn cut_off() -> BagFault {
    BagFault::Malformed("it breaks off within a record".to_owned())
}
