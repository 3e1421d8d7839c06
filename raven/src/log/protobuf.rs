//! The project's own messages in protobuf, and the stamp of any protobuf message.
//!
//! Each message stands here twice: as a struct that `prost` encodes, and as the descriptor that goes into the log, by which every reader
//! decodes it. Tags are never reused.

use foxglove::Encode;
use foxglove::messages::{JointStates, Timestamp};
use foxglove::prost_types::field_descriptor_proto::{Label, Type};
use foxglove::prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};
use prost::Message;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};

use super::Stamp;

const PACKAGE: &str = "raven_cal";
const TIMESTAMP: &str = ".google.protobuf.Timestamp";
const TIMESTAMP_FILE: &str = "google/protobuf/timestamp.proto";

/// `raven_cal.TipObservation`; the fields are those of `raven_cal/TipObservation`.
#[derive(Clone, PartialEq, Message)]
pub(super) struct TipMessage {
    #[prost(message, optional, tag = "1")]
    pub(super) timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    pub(super) frame_id: String,
    #[prost(uint32, tag = "3")]
    pub(super) status: u32,
    #[prost(double, repeated, tag = "4")]
    pub(super) left_px: Vec<f64>,
    #[prost(double, repeated, tag = "5")]
    pub(super) right_px: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    pub(super) position: Vec<f64>,
    #[prost(double, repeated, tag = "7")]
    pub(super) covariance: Vec<f64>,
}

/// `raven_cal.FrameMeta`: what the driver said about one frame. `timestamp` is filled in by the writer.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct FrameMeta {
    /// Stamp of the frame.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// V4L2 sequence number.
    #[prost(uint32, tag = "2")]
    pub sequence: u32,
    /// Kernel time of the frame on the monotonic clock (ns).
    #[prost(uint64, tag = "3")]
    pub kernel_monotonic_ns: u64,
    /// Time at which the program took the frame from the driver, on the monotonic clock (ns).
    #[prost(uint64, tag = "4")]
    pub dequeue_monotonic_ns: u64,
    /// V4L2 buffer flags.
    #[prost(uint32, tag = "5")]
    pub flags: u32,
    /// Bytes of the frame.
    #[prost(uint32, tag = "6")]
    pub bytes: u32,
    /// Frames the driver says it dropped before this one.
    #[prost(uint32, tag = "7")]
    pub gap: u32,
    /// The JPEG has no end marker.
    #[prost(bool, tag = "8")]
    pub truncated: bool,
    /// The frame has the contents of the one before it.
    #[prost(bool, tag = "9")]
    pub repeated: bool,
    /// Frames that must be missing before this one by the interval, though the driver counted none.
    #[prost(uint32, tag = "10")]
    pub skipped: u32,
}

impl FrameMeta {
    /// Whether the driver says that what the frame holds is damaged (V4L2_BUF_FLAG_ERROR).
    #[must_use]
    pub const fn is_damaged(&self) -> bool {
        const ERROR: u32 = 0x40;
        self.flags & ERROR != 0
    }
}

/// `raven_cal.ClockSample`: one reading of both clocks.
#[derive(Clone, PartialEq, Eq, Message)]
pub struct ClockSample {
    /// Real time; filled in by the writer.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// Monotonic clock (ns).
    #[prost(uint64, tag = "2")]
    pub monotonic_ns: u64,
    /// Real-time clock (ns since the epoch).
    #[prost(uint64, tag = "3")]
    pub realtime_ns: u64,
}

/// A message with its schema: name and serialized descriptor set.
pub(super) trait Described: Message {
    fn schema() -> (String, Vec<u8>);
}

impl Described for TipMessage {
    fn schema() -> (String, Vec<u8>) {
        let repeated = Label::Repeated;
        describe(
            "TipObservation",
            &[
                ("timestamp", Type::Message, Label::Optional),
                ("frame_id", Type::String, Label::Optional),
                ("status", Type::Uint32, Label::Optional),
                ("left_px", Type::Double, repeated),
                ("right_px", Type::Double, repeated),
                ("position", Type::Double, repeated),
                ("covariance", Type::Double, repeated),
            ],
        )
    }
}

impl Described for FrameMeta {
    fn schema() -> (String, Vec<u8>) {
        let one = Label::Optional;
        describe(
            "FrameMeta",
            &[
                ("timestamp", Type::Message, one),
                ("sequence", Type::Uint32, one),
                ("kernel_monotonic_ns", Type::Uint64, one),
                ("dequeue_monotonic_ns", Type::Uint64, one),
                ("flags", Type::Uint32, one),
                ("bytes", Type::Uint32, one),
                ("gap", Type::Uint32, one),
                ("truncated", Type::Bool, one),
                ("repeated", Type::Bool, one),
                ("skipped", Type::Uint32, one),
            ],
        )
    }
}

impl Described for ClockSample {
    fn schema() -> (String, Vec<u8>) {
        let one = Label::Optional;
        let fields = [("timestamp", Type::Message, one), ("monotonic_ns", Type::Uint64, one), ("realtime_ns", Type::Uint64, one)];
        describe("ClockSample", &fields)
    }
}

/// The time of a stamp in protobuf.
pub(super) fn timestamp(stamp: Stamp) -> Option<Timestamp> {
    let (seconds, nanoseconds) = stamp.to_ros();
    Timestamp::new_checked(seconds, nanoseconds)
}

/// The stamp of a time in protobuf; the zero time is none.
pub(super) fn stamp(timestamp: Option<Timestamp>) -> Option<Stamp> {
    timestamp.map(|timestamp| Stamp(timestamp.total_nanos())).filter(|stamp| stamp.0 > 0)
}

/// Descriptor set of one message whose fields have the tags 1, 2, 3 ... in this order.
fn describe(name: &str, fields: &[(&str, Type, Label)]) -> (String, Vec<u8>) {
    let field = |(tag, &(name, kind, label)): (i32, &(&str, Type, Label))| FieldDescriptorProto {
        name: Some(name.to_owned()),
        json_name: Some(name.to_owned()),
        number: Some(tag),
        label: Some(label.into()),
        r#type: Some(kind.into()),
        type_name: (kind == Type::Message).then(|| TIMESTAMP.to_owned()),
        ..Default::default()
    };
    let message =
        DescriptorProto { name: Some(name.to_owned()), field: (1..).zip(fields).map(field).collect(), ..DescriptorProto::default() };
    let own = FileDescriptorProto {
        name: Some(format!("{PACKAGE}/{name}.proto")),
        package: Some(PACKAGE.to_owned()),
        dependency: vec![TIMESTAMP_FILE.to_owned()],
        message_type: vec![message],
        syntax: Some("proto3".to_owned()),
        ..FileDescriptorProto::default()
    };
    // Foxglove's descriptor sets hold Google's file for `Timestamp`.
    let foxglove = JointStates::get_schema().and_then(|schema| FileDescriptorSet::decode(schema.data.as_ref()).ok()).unwrap_or_default();
    let mut file: Vec<_> = foxglove.file.into_iter().filter(|file| file.name() == TIMESTAMP_FILE).collect();
    file.push(own);
    (format!("{PACKAGE}.{name}"), FileDescriptorSet { file }.encode_to_vec())
}

/// Tag of the field `timestamp` of a message, by the schema stored in the log.
pub(super) fn timestamp_tag(schema_name: &str, schema: &[u8]) -> Option<u32> {
    let set = FileDescriptorSet::decode(schema).ok()?;
    let message = set.file.iter().find_map(|file| {
        let wanted = schema_name.strip_prefix(file.package()).and_then(|rest| rest.strip_prefix('.')).unwrap_or(schema_name);
        file.message_type.iter().find(|message| message.name() == wanted)
    })?;
    let field = message.field.iter().find(|field| field.name() == "timestamp" && field.type_name() == TIMESTAMP)?;
    u32::try_from(field.number()).ok()
}

/// The stamp in field `tag` of an encoded message, found without decoding the rest.
pub(super) fn find_stamp(mut message: &[u8], tag: u32) -> Option<Stamp> {
    let buffer = &mut message;
    let mut found = None;
    while !buffer.is_empty() {
        let (key, wire_type) = decode_key(buffer).ok()?;
        if key == tag && wire_type == WireType::LengthDelimited {
            let length = usize::try_from(decode_varint(buffer).ok()?).ok()?;
            let (value, rest) = buffer.split_at_checked(length)?;
            *buffer = rest;
            found = Some(Timestamp::decode(value).ok()?);
        } else {
            skip_field(wire_type, key, buffer, DecodeContext::default()).ok()?;
        }
    }
    stamp(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Names, types and labels that a struct's encoding has on the wire, against its descriptor.
    fn wire_types<M: Described>(message: &M) {
        let (name, schema) = M::schema();
        let set = FileDescriptorSet::decode(schema.as_slice()).unwrap();
        let own = set.file.last().unwrap();
        let fields = &own.message_type[0].field;
        assert_eq!(name, format!("{}.{}", own.package(), own.message_type[0].name()));
        let bytes = message.encode_to_vec();
        let mut buffer = bytes.as_slice();
        let mut tags = Vec::new();
        while !buffer.is_empty() {
            let (tag, wire_type) = decode_key(&mut buffer).unwrap();
            let field = fields.iter().find(|field| field.number() == tag as i32).unwrap();
            let expected = match (field.label(), field.r#type()) {
                (Label::Repeated, _) | (_, Type::Message | Type::String) => WireType::LengthDelimited,
                (_, Type::Uint32 | Type::Uint64 | Type::Bool) => WireType::Varint,
                other => panic!("{other:?}"),
            };
            assert_eq!(wire_type, expected, "{}", field.name());
            skip_field(wire_type, tag, &mut buffer, DecodeContext::default()).unwrap();
            tags.push(tag);
        }
        assert_eq!(tags.len(), fields.len(), "every field of {name} is on the wire once");
    }

    #[test]
    fn structs_and_descriptors_agree() {
        let timestamp = timestamp(Stamp(1_500_000_000));
        let (one, nine) = (vec![1.0], vec![1.0; 9]);
        wire_types(&TipMessage {
            timestamp,
            frame_id: "gold".into(),
            status: 1,
            left_px: one.clone(),
            right_px: one.clone(),
            position: one,
            covariance: nine,
        });
        wire_types(&FrameMeta {
            timestamp,
            sequence: 1,
            kernel_monotonic_ns: 1,
            dequeue_monotonic_ns: 1,
            flags: 1,
            bytes: 1,
            gap: 1,
            truncated: true,
            repeated: true,
            skipped: 1,
        });
        wire_types(&ClockSample { timestamp, monotonic_ns: 1, realtime_ns: 1 });
    }

    #[test]
    fn the_stamp_is_found_by_the_schema() {
        let schema = foxglove::messages::ImageAnnotations::get_schema().unwrap();
        assert_eq!(timestamp_tag(&schema.name, &schema.data), Some(5));
        let (name, schema) = TipMessage::schema();
        assert_eq!(timestamp_tag(&name, &schema), Some(1));
        let tip = TipMessage { timestamp: timestamp(Stamp(1_000_000_007)), frame_id: "x".into(), ..TipMessage::default() };
        assert_eq!(find_stamp(&tip.encode_to_vec(), 1), Some(Stamp(1_000_000_007)));
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), tag in 1_u32..6) {
            let _ = find_stamp(&bytes, tag);
            let _ = timestamp_tag("raven_cal.TipObservation", &bytes);
        }
    }
}
