//! Recordings: one MCAP file each, read and written.
//!
//! Two encodings are at home in a log, and every topic may come in either: `ros1msg`, decoded by the definition stored in the file and by
//! field name, and protobuf with Foxglove's schemas. Time is the stamp of the measurement in the message's header, never the time of
//! arrival: `publish_time` stands in only for a message without a stamp.

pub mod topics;

mod stamp;
mod tip;

pub use stamp::Stamp;
pub use tip::{TipObservation, TipStatus};
