//! TCPROS: a header of `key=value` fields from both sides, then messages. Everything has its length as a little-endian `uint32` before it.

use std::collections::BTreeMap;
use std::io::{Read, Write};

use super::fault::ReadFault;
use super::http::{exactly, malformed};

/// A raw image of 4096 x 2160 in colour is 27 MB; more than this is no message of a robot.
pub const MESSAGE_LIMIT: usize = 64 << 20;
/// The longest field of a header is the definition of the message, some kilobytes of text.
const HEADER_LIMIT: usize = 1 << 20;

/// What a publisher says about the messages of a connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Connection {
    /// Topic, as it was asked for.
    pub topic: String,
    /// Message type, as in `raven_2/raven_state`.
    pub message_type: String,
    /// MD5 sum of the type, by which versions of it are told apart.
    pub md5sum: String,
    /// Definition of the type and of all it uses; empty if the publisher keeps it to itself.
    pub definition: String,
    /// Name of the publisher.
    pub caller_id: String,
    /// Whether the last message is repeated to every new subscriber.
    pub latching: bool,
}

impl Connection {
    /// Says who asks for what, and reads what the publisher says in return.
    ///
    /// # Errors
    /// If the connection ends, the publisher refuses in words, or its header lacks the type or its sum.
    pub fn open(stream: &mut (impl Read + Write), caller_id: &str, topic: &str) -> Result<Self, ReadFault> {
        let wanted = [("callerid", caller_id), ("topic", topic), ("type", "*"), ("md5sum", "*"), ("tcp_nodelay", "1")];
        stream.write_all(&encode_header(&wanted))?;
        let mut fields = read_header(stream)?;
        if let Some(error) = fields.get("error") {
            return Err(malformed(format!("the refusal \"{error}\"")));
        }
        let mut needed = |key: &str| fields.remove(key).ok_or_else(|| malformed(format!("a connection header without `{key}`")));
        let (message_type, md5sum) = (needed("type")?, needed("md5sum")?);
        Ok(Self {
            topic: topic.to_owned(),
            message_type,
            md5sum,
            definition: fields.remove("message_definition").unwrap_or_default(),
            caller_id: fields.remove("callerid").unwrap_or_default(),
            latching: fields.get("latching").is_some_and(|value| value == "1"),
        })
    }
}

/// The bytes of a connection header.
#[must_use]
pub fn encode_header(fields: &[(&str, &str)]) -> Vec<u8> {
    let mut body = Vec::new();
    for (key, value) in fields {
        body.extend(length(key.len() + 1 + value.len()));
        body.extend_from_slice(key.as_bytes());
        body.push(b'=');
        body.extend_from_slice(value.as_bytes());
    }
    [length(body.len()).as_slice(), &body].concat()
}

/// Reads the fields of a connection header.
///
/// # Errors
/// If the connection ends, or the lengths or a field are wrong.
pub fn read_header(source: &mut impl Read) -> Result<BTreeMap<String, String>, ReadFault> {
    let block = read_block(source, HEADER_LIMIT, "a connection header")?;
    let (mut rest, mut fields) = (block.as_slice(), BTreeMap::new());
    while !rest.is_empty() {
        let short = || malformed(format!("a connection header that ends {} bytes into a field", rest.len()));
        let (size, after) = rest.split_first_chunk().ok_or_else(short)?;
        let size = usize::try_from(u32::from_le_bytes(*size)).map_err(|_| short())?;
        let (field, after) = after.split_at_checked(size).ok_or_else(short)?;
        let text = String::from_utf8_lossy(field);
        let (key, value) = text.split_once('=').ok_or_else(|| malformed("a field without `=` in a connection header".to_owned()))?;
        fields.insert(key.to_owned(), value.to_owned());
        rest = after;
    }
    Ok(fields)
}

/// Reads a length and as many bytes. A length beyond `limit` is refused, and memory grows only as bytes come.
///
/// # Errors
/// If the connection ends or the length is refused.
pub fn read_block(source: &mut impl Read, limit: usize, what: &str) -> Result<Vec<u8>, ReadFault> {
    let mut size = [0; 4];
    source.read_exact(&mut size)?;
    let size = usize::try_from(u32::from_le_bytes(size)).unwrap_or(usize::MAX);
    exactly(source, size, limit, what)
}

/// A length as it goes before a block; the callers' blocks are far below 4 GB.
fn length(bytes: usize) -> [u8; 4] {
    u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes()
}
