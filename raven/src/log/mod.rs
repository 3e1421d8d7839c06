//! Recordings: one MCAP file each, read and written.
//!
//! Two encodings are at home in a log, and every topic may come in either: `ros1msg`, decoded by the definition stored in the file and by
//! field name, and protobuf with Foxglove's schemas. Time is the stamp of the measurement in the message's header, never the time of
//! arrival: `publish_time` stands in only for a message without a stamp.

pub mod ros1;
pub mod topics;

mod clock;
mod converter;
mod copy;
mod cut;
mod frames;
mod header;
mod joints;
mod jpeg;
mod jump;
mod lag;
mod live;
mod losses;
mod moments;
mod pixels;
mod png;
mod protobuf;
mod quality;
mod recording;
mod recover;
mod robot_state;
mod sampling;
mod series;
mod skew;
mod stamp;
mod survey;
#[cfg(test)]
mod tests;
mod tip;
mod walk;
mod write_protobuf;
mod writer;

pub use clock::ClockSurvey;
pub use cut::{Cut, cut};
pub use frames::{CameraFrame, FrameData, Side, frame_stamps, frames};
pub use jpeg::is_truncated_jpeg;
pub use jump::Jump;
pub use lag::Lag;
pub use live::{active_name, complete, unrecorded};
pub use losses::FrameLosses;
pub use moments::Moments;
pub use pixels::LARGEST_SIDE;
pub use protobuf::{ClockSample, FrameMeta};
pub use quality::{GAP_FACTOR, StreamQuality};
pub use raven_jpeg::Part;
pub use recording::{MotorSource, Recording};
pub use recover::{Recovery, recover};
pub use robot_state::{ARM_JOINTS, RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, RavenState, arm_offset};
pub use sampling::{Sampling, Steps};
pub use series::JointSeries;
pub use skew::CameraSkew;
pub use stamp::Stamp;
pub use survey::{StoredFile, Survey, TipCounts, TopicSurvey};
pub use tip::{TipObservation, TipStatus};
pub use walk::{Attachment, Channel, Damage, Item, RawMessage, Walker};
pub use writer::{CAMERAS_FILE, ChannelId, LogWriter, ROBOT_FILE, SchemaRef, Times};
