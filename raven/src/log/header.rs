//! The stamp of any message, and what both encodings need to get at fields.

use super::protobuf;
use super::ros1::{Definition, Extractor, HEADER_STAMPS, header_stamp};
use super::{Channel, Stamp};

/// Finds the stamp of the messages of one channel.
pub(super) enum StampReader {
    Ros1(Extractor),
    Protobuf(u32),
    /// The messages have none, or are in an encoding nobody here reads.
    Absent,
}

impl StampReader {
    pub(super) fn new(channel: &Channel) -> Self {
        if channel.message_encoding == "ros1" {
            return match ros1_extractor(channel, &HEADER_STAMPS) {
                Ok(extractor) if extractor.has(0) || extractor.has(1) => Self::Ros1(extractor),
                _ => Self::Absent,
            };
        }
        let schema = channel.schema.as_ref().filter(|_| channel.message_encoding == "protobuf");
        schema.and_then(|schema| protobuf::timestamp_tag(&schema.name, &schema.data)).map_or(Self::Absent, Self::Protobuf)
    }

    /// The stamp; `None` if it is absent, unset, or the message does not fit its definition.
    pub(super) fn read(&self, message: &[u8]) -> Option<Stamp> {
        match self {
            Self::Ros1(extractor) => header_stamp(extractor.walk(message).ok()?),
            Self::Protobuf(tag) => protobuf::find_stamp(message, *tag),
            Self::Absent => None,
        }
    }
}

/// Compiles the definition stored with a channel of ROS 1 messages.
///
/// # Errors
/// Half a sentence about the channel.
pub(super) fn ros1_extractor(channel: &Channel, wanted: &[&str]) -> Result<Extractor, String> {
    let schema = channel.schema.as_ref().ok_or("it has no schema, which ROS 1 messages cannot be decoded without")?;
    if schema.encoding != "ros1msg" {
        return Err(format!("its schema is in `{}`, not in `ros1msg`", schema.encoding));
    }
    let text = String::from_utf8_lossy(&schema.data);
    let definition = Definition::parse(&schema.name, &text).map_err(|fault| format!("its definition cannot be read: {fault}"))?;
    Extractor::new(&definition, wanted).map_err(|fault| format!("its definition cannot be used: {fault}"))
}

/// Name of a channel's schema, empty without one.
pub(super) fn schema_name(channel: &Channel) -> &str {
    channel.schema.as_ref().map_or("", |schema| &schema.name)
}

/// Half a sentence about a channel that is in neither encoding or has another kind of message than its topic promises.
pub(super) fn unreadable(channel: &Channel, expected: &str) -> String {
    match channel.message_encoding.as_str() {
        "ros1" | "protobuf" => format!("its messages are `{}`, not {expected}", schema_name(channel)),
        other => format!("its messages are encoded as `{other}`; only `ros1` and `protobuf` can be read"),
    }
}
