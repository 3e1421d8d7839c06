//! Camera frames, streamed from a log in the order of the file.

use std::collections::{HashMap, VecDeque};
use std::path::Path;

use foxglove::messages::{CompressedImage, RawImage};
use prost::Message;
use serde::{Deserialize, Serialize};

use super::header::{StampReader, ros1_extractor, schema_name, unreadable};
use super::ros1::{Extractor, Value};
use super::{Channel, Item, RawMessage, Stamp, Walker, protobuf, topics};
use crate::{Error, Result};

/// One of the two cameras, as seen from behind them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// The left camera.
    Left,
    /// The right camera.
    Right,
}

impl Side {
    /// Both, left first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// `left` or `right`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// The pixels of a frame as they were recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FrameData {
    /// A JPEG or PNG file.
    Jpeg(Vec<u8>),
    /// Rows of pixels.
    Raw {
        /// ROS name of the layout: `bgr8`, `rgb8`, `mono8`, `yuv422_yuy2`, `yuv422`.
        encoding: String,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes from one row to the next.
        step: u32,
        /// `step` times `height` bytes.
        data: Vec<u8>,
    },
}

/// One frame of one camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraFrame {
    /// Which camera.
    pub side: Side,
    /// Time of the exposure, as well as the recorder knew it.
    pub stamp: Stamp,
    /// Time of arrival.
    pub log_time: Stamp,
    /// Frame of the camera.
    pub frame_id: String,
    /// Number of the frame as the camera counts, if the log has it.
    pub sequence: Option<u64>,
    /// Pixels.
    pub data: FrameData,
}

/// Reads the frames of one channel.
pub(super) enum FrameDecoder {
    Ros1Compressed(Extractor),
    Ros1Raw(Extractor),
    ProtobufCompressed,
    ProtobufRaw,
}

const HEADER: [&str; 3] = ["header.stamp", "header.frame_id", "header.seq"];

impl FrameDecoder {
    /// # Errors
    /// Half a sentence about the channel.
    pub(super) fn new(channel: &Channel) -> Result<Self, String> {
        let [stamp, frame_id, seq] = HEADER;
        let compiled = |wanted: &[&str]| -> Result<Extractor, String> {
            let extractor = ros1_extractor(channel, wanted)?;
            match wanted.iter().enumerate().find(|(slot, _)| !extractor.has(*slot)) {
                None => Ok(extractor),
                Some((_, field)) => Err(format!("its messages have no field `{field}`")),
            }
        };
        match (channel.message_encoding.as_str(), schema_name(channel)) {
            ("ros1", "sensor_msgs/Image") => {
                compiled(&[stamp, frame_id, seq, "encoding", "width", "height", "step", "data"]).map(Self::Ros1Raw)
            }
            ("ros1", _) => compiled(&[stamp, frame_id, seq, "data"]).map(Self::Ros1Compressed),
            ("protobuf", "foxglove.CompressedImage") => Ok(Self::ProtobufCompressed),
            ("protobuf", "foxglove.RawImage") => Ok(Self::ProtobufRaw),
            _ => Err(unreadable(channel, "images")),
        }
    }

    /// The frame; `None` if the message does not fit its definition.
    pub(super) fn decode(&self, side: Side, message: &RawMessage<'_>) -> Option<CameraFrame> {
        let counted = |number: u64| Some(number).filter(|&number| number > 0);
        let frame = |stamp: Option<Stamp>, frame_id: String, sequence: Option<u64>, data| CameraFrame {
            side,
            stamp: stamp.unwrap_or(message.publish_time),
            log_time: message.log_time,
            frame_id,
            sequence,
            data,
        };
        let ros1 = |stamp: Option<Value<'_>>, frame_id: Option<Value<'_>>, seq: Option<Value<'_>>, data| {
            let stamp = stamp?.stamp().filter(|stamp| stamp.0 > 0);
            Some(frame(stamp, text(frame_id)?, counted(u64::try_from(seq?.integer(0)?).ok()?), data))
        };
        match self {
            Self::Ros1Compressed(extractor) => {
                let [stamp, frame_id, seq, data] = extractor.walk(message.data).ok()?;
                ros1(stamp, frame_id, seq, FrameData::Jpeg(data?.bytes().to_vec()))
            }
            Self::Ros1Raw(extractor) => {
                let [stamp, frame_id, seq, encoding, width, height, step, data] = extractor.walk(message.data).ok()?;
                let size = |value: Option<Value<'_>>| u32::try_from(value?.integer(0)?).ok();
                let (width, height, step) = (size(width)?, size(height)?, size(step)?);
                ros1(stamp, frame_id, seq, FrameData::Raw { encoding: text(encoding)?, width, height, step, data: data?.bytes().to_vec() })
            }
            Self::ProtobufCompressed => {
                let image = CompressedImage::decode(message.data).ok()?;
                let data = FrameData::Jpeg(image.data.into());
                Some(frame(protobuf::stamp(image.timestamp), image.frame_id, counted(message.sequence.into()), data))
            }
            Self::ProtobufRaw => {
                let image = RawImage::decode(message.data).ok()?;
                let (encoding, width, height, step) = (image.encoding, image.width, image.height, image.step);
                let data = FrameData::Raw { encoding, width, height, step, data: image.data.into() };
                Some(frame(protobuf::stamp(image.timestamp), image.frame_id, counted(message.sequence.into()), data))
            }
        }
    }
}

fn text(value: Option<Value<'_>>) -> Option<String> {
    value?.texts().next().map(std::borrow::Cow::into_owned)
}

/// The frames of both cameras in the order of the file; memory holds those of one chunk. Where a camera has both JPEG and raw frames, the
/// kind that comes first is taken.
///
/// # Errors
/// If the file cannot be opened or is no MCAP file. The iterator ends with an error if there are no cameras in the log, or a message does
/// not fit its definition, or the file is damaged.
pub fn frames(path: &Path) -> Result<impl Iterator<Item = Result<CameraFrame>> + use<>> {
    Ok(Frames { walker: Some(Walker::open(path)?), path: path.to_owned(), cameras: Cameras::default(), ready: VecDeque::new() })
}

/// Camera and stamp of every frame in the order of the file, without its pixels.
///
/// # Errors
/// If the file cannot be read, is no MCAP file, is damaged, or has no cameras.
pub fn frame_stamps(path: &Path) -> Result<Vec<(Side, Stamp)>> {
    let mut walker = Walker::open(path)?;
    let mut cameras = Cameras::default();
    let mut readers = HashMap::new();
    let mut stamps = Vec::new();
    walker.run(|item| {
        match item {
            Item::Channel(channel) => {
                cameras.admit(channel);
                readers.insert(channel.id, StampReader::new(channel));
            }
            Item::Message(message) => {
                if let Some((side, _)) = cameras.of(message.channel) {
                    let own = readers.get(&message.channel.id).and_then(|reader| reader.read(message.data));
                    stamps.push((side, own.unwrap_or(message.publish_time)));
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    walker.require_whole()?;
    cameras.require_any(path)?;
    Ok(stamps)
}

/// The channels whose frames are taken: those of the topic on which a camera has its first frame, as many as published on it.
#[derive(Default)]
struct Cameras {
    decoders: HashMap<u16, (Side, FrameDecoder)>,
    taken: HashMap<Side, String>,
    topics: Vec<String>,
    problem: Option<String>,
}

impl Cameras {
    fn admit(&mut self, channel: &Channel) {
        self.topics.push(format!("`{}`", channel.topic));
        let Some(side) = topics::camera_of(&channel.topic) else { return };
        match FrameDecoder::new(channel) {
            Ok(decoder) => drop(self.decoders.insert(channel.id, (side, decoder))),
            Err(problem) => self.problem = Some(format!("`{}`: {problem}", channel.topic)),
        }
    }

    /// The camera of a channel that has a frame, and how to read it; `None` if the camera's frames are those of another topic.
    fn of(&mut self, channel: &Channel) -> Option<(Side, &FrameDecoder)> {
        let (side, decoder) = self.decoders.get(&channel.id)?;
        let taken = self.taken.entry(*side).or_insert_with(|| channel.topic.clone());
        (*taken == channel.topic).then_some((*side, decoder))
    }

    fn require_any(&self, path: &Path) -> Result<()> {
        if !self.decoders.is_empty() {
            return Ok(());
        }
        let why = self.problem.clone().unwrap_or_else(|| {
            let there = if self.topics.is_empty() { "none".to_owned() } else { self.topics.join(", ") };
            format!("they are expected on `{}` and `{}`. Topics in the file: {there}", topics::LEFT_COMPRESSED, topics::RIGHT_COMPRESSED)
        });
        Err(Error::file(path, format!("the log has no camera images: {why}.")))
    }
}

struct Frames {
    /// `None` at the end.
    walker: Option<Walker>,
    path: std::path::PathBuf,
    cameras: Cameras,
    ready: VecDeque<CameraFrame>,
}

impl Frames {
    /// Reads one chunk; `false` at the end of the file.
    fn fill(&mut self) -> Result<bool> {
        let Some(walker) = &mut self.walker else { return Ok(false) };
        let (path, cameras, ready) = (&self.path, &mut self.cameras, &mut self.ready);
        let more = walker.step(&mut |item| {
            match item {
                Item::Channel(channel) => cameras.admit(channel),
                Item::Message(message) => {
                    if let Some((side, decoder)) = cameras.of(message.channel) {
                        let unfit = || {
                            let topic = &message.channel.topic;
                            Error::file(path, format!("the message on `{topic}` at {} does not fit its definition.", message.publish_time))
                        };
                        ready.push_back(decoder.decode(side, &message).ok_or_else(unfit)?);
                    }
                }
                _ => {}
            }
            Ok(())
        })?;
        if !more {
            walker.require_whole()?;
            self.cameras.require_any(&self.path)?;
        }
        Ok(more)
    }
}

impl Iterator for Frames {
    type Item = Result<CameraFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(frame) = self.ready.pop_front() {
                return Some(Ok(frame));
            }
            self.walker.as_ref()?;
            match self.fill() {
                Ok(true) => {}
                // What the last step brought is still to come.
                Ok(false) => self.walker = None,
                Err(error) => {
                    self.walker = None;
                    self.ready.clear();
                    return Some(Err(error));
                }
            }
        }
    }
}
