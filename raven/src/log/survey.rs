//! What is in a log and how regular it is, damaged or not.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use prost::Message;
use serde::Serialize;

use super::frames::FrameDecoder;
use super::header::{StampReader, schema_name};
use super::{
    CameraSkew, Channel, ClockSample, ClockSurvey, Damage, FrameLosses, FrameMeta, Item, Jump, Lag, MotorSource, RawMessage, Recording,
    Side, Stamp, StreamQuality, TipStatus, Walker, topics,
};
use crate::Result;
use crate::robot::SourceFormat;

/// One topic of a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicSurvey {
    /// Topic name.
    pub topic: String,
    /// Name of the message type.
    pub schema: String,
    /// Encoding of the messages.
    pub message_encoding: String,
    /// Encoding of the schema.
    pub schema_encoding: String,
    /// Bytes of all messages.
    pub bytes: u64,
    /// Frames that are cut off: a JPEG or PNG without its end, or a raw frame with too few bytes.
    pub truncated_frames: usize,
    /// Frames that the camera counted, but that are not in the log; 0 also where the camera's count was not recorded.
    pub missing_frames: u64,
    /// Messages per second.
    pub rate_hz: Option<f64>,
    /// How the clock of a robot's stamps went against the recorder's, where arrivals were recorded.
    pub lag: Option<Lag>,
    /// Steps of that clock.
    pub jumps: Vec<Jump>,
    /// Regularity.
    #[serde(flatten)]
    pub quality: StreamQuality,
}

impl TopicSurvey {
    /// Whether its messages are joint states, in ROS 1 or protobuf.
    #[must_use]
    pub fn has_joint_states(&self) -> bool {
        ["sensor_msgs/JointState", "foxglove.JointStates"].contains(&self.schema.as_str())
    }
}

/// What became of the tracked point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct TipCounts {
    /// Observations with a usable position.
    pub seen: usize,
    /// Observations without.
    pub occluded: usize,
    /// Observations rejected as jumps.
    pub jumped: usize,
}

/// A file stored in a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StoredFile {
    /// Name.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// Size.
    pub bytes: usize,
}

/// What is in a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// All messages that can be read.
    pub messages: u64,
    /// When the first message in the file arrived; `None` without messages.
    pub first_arrival: Option<Stamp>,
    /// What is wrong with the file.
    pub damage: Option<Damage>,
    /// Topics by name.
    pub topics: Vec<TopicSurvey>,
    /// Both cameras, if there are two.
    pub cameras: Option<CameraSkew>,
    /// Frames of each camera and what went wrong with them, where the recorder noted it.
    pub losses: BTreeMap<Side, FrameLosses>,
    /// How the recorder's clocks went, where it noted it.
    pub clock: Option<ClockSurvey>,
    /// Whether the motors' torque or force was recorded; `None` without motors.
    pub torque_recorded: Option<bool>,
    /// The tracked point; `None` without `/tip`.
    pub tip: Option<TipCounts>,
    /// Metadata record `session`.
    pub session: BTreeMap<String, String>,
    /// All other metadata records by name, as in `camera.left`.
    pub records: BTreeMap<String, BTreeMap<String, String>>,
    /// Stored files.
    pub attachments: Vec<StoredFile>,
}

impl Survey {
    /// Surveys a log as far as it can be read.
    ///
    /// # Errors
    /// If the file cannot be read, is empty or is no MCAP file.
    pub fn of(path: &Path) -> Result<Self> {
        let mut walker = Walker::open(path)?;
        let mut channels = HashMap::new();
        let mut streams = BTreeMap::new();
        let mut session = BTreeMap::new();
        let mut records: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
        let (mut losses, mut clock) = (BTreeMap::new(), Vec::new());
        let mut attachments = Vec::new();
        let mut first_arrival = None;
        walker.run(|item| {
            match item {
                Item::Start { .. } => {}
                Item::Channel(channel) => {
                    channels.insert(channel.id, Reading::new(channel));
                    streams.entry(channel.topic.clone()).or_insert_with(|| Stream::new(channel));
                }
                Item::Message(message) => {
                    first_arrival.get_or_insert(message.log_time);
                    let topic = message.channel.topic.as_str();
                    if let (Some(reading), Some(stream)) = (channels.get(&message.channel.id), streams.get_mut(topic)) {
                        stream.take(reading, &message);
                    }
                    match note_of(&message) {
                        Some(Note::Frame(side, meta)) => losses.entry(side).or_insert_with(FrameLosses::default).take(&meta),
                        Some(Note::Clock(sample)) => clock.push(sample),
                        None => {}
                    }
                }
                Item::Attachment(file) => {
                    attachments.push(StoredFile { name: file.name, media_type: file.media_type, bytes: file.data.len() });
                }
                Item::Metadata(name, pairs) if name == "session" => session.extend(pairs),
                Item::Metadata(name, pairs) => records.entry(name).or_default().extend(pairs),
            }
            Ok(())
        })?;
        let cameras = camera_skew(&streams);
        let mut survey = Self {
            path: path.to_owned(),
            bytes: walker.length(),
            messages: walker.messages(),
            first_arrival,
            damage: walker.damage().cloned(),
            topics: streams.into_values().map(Stream::finish).collect(),
            cameras,
            losses,
            clock: ClockSurvey::of(&clock),
            torque_recorded: None,
            tip: None,
            session,
            records,
            attachments,
        };
        survey.look_into_numbers();
        Ok(survey)
    }

    /// Stamps of the earliest and of the latest message; `None` without any.
    #[must_use]
    pub fn span(&self) -> Option<[Stamp; 2]> {
        let first = self.topics.iter().filter_map(|topic| topic.quality.first).min()?;
        let last = self.topics.iter().filter_map(|topic| topic.quality.last).max()?;
        Some([first, last])
    }

    /// The topic of this name, if it has messages.
    #[must_use]
    pub fn topic(&self, name: &str) -> Option<&TopicSurvey> {
        self.topics.iter().find(|topic| topic.topic == name && topic.quality.messages > 0)
    }

    /// Where the motors are: the robot's own message, or joint states, on `/motor/joint_states` before any other topic that is none of ours.
    #[must_use]
    pub fn motor_source(&self) -> Option<MotorSource> {
        let joint_states =
            |topic: &str| MotorSource { topic: topic.to_owned(), format: SourceFormat::JointState, ..MotorSource::default() };
        if let Some(state) = self.topic(topics::RAVEN_STATE) {
            return Some(if state.has_joint_states() { joint_states(topics::RAVEN_STATE) } else { MotorSource::default() });
        }
        let not_motors = [topics::JOINT_ENCODERS, topics::ESTIMATE_KINEMATIC, topics::ESTIMATE_CAMERA, topics::ESTIMATE_FILTER];
        let other =
            |topic: &&TopicSurvey| topic.quality.messages > 0 && topic.has_joint_states() && !not_motors.contains(&topic.topic.as_str());
        let motors = self.topic(topics::MOTOR_JOINT_STATES).or_else(|| self.topics.iter().find(other))?;
        Some(joint_states(&motors.topic))
    }

    /// What computations will find in motors, joints and tip. It takes a whole file.
    fn look_into_numbers(&mut self) {
        let source = self.motor_source().unwrap_or_default();
        let Ok(recording) = Recording::read(&self.path, &source) else { return };
        self.torque_recorded = recording.motor.as_ref().map(|motor| motor.effort.is_some());
        if recording.topics.contains_key(topics::TIP) {
            let count = |status| recording.tip.iter().filter(|tip| tip.status == status).count();
            let (seen, occluded, jumped) = (count(TipStatus::Seen), count(TipStatus::Occluded), count(TipStatus::Jumped));
            self.tip = Some(TipCounts { seen, occluded, jumped });
        }
        for topic in &mut self.topics {
            if let Some(quality) = recording.quality.get(&topic.topic) {
                topic.quality.non_finite = quality.non_finite;
                topic.quality.undecodable = quality.undecodable;
                topic.quality.without_stamp = quality.without_stamp;
            }
        }
    }
}

/// What the recorder noted besides what it recorded.
enum Note {
    Frame(Side, FrameMeta),
    Clock(ClockSample),
}

fn note_of(message: &RawMessage<'_>) -> Option<Note> {
    let topic = message.channel.topic.as_str();
    match schema_name(message.channel) {
        "raven_cal.FrameMeta" => {
            let side = Side::BOTH.into_iter().find(|&side| topic == topics::frame_meta(side))?;
            FrameMeta::decode(message.data).ok().map(|meta| Note::Frame(side, meta))
        }
        "raven_cal.ClockSample" if topic == topics::CLOCK => ClockSample::decode(message.data).ok().map(Note::Clock),
        _ => None,
    }
}

/// How the messages of one channel are read.
struct Reading {
    stamps: StampReader,
    frames: Option<(Side, FrameDecoder)>,
}

impl Reading {
    fn new(channel: &Channel) -> Self {
        let side = topics::camera_of(&channel.topic);
        Self { stamps: StampReader::new(channel), frames: side.zip(FrameDecoder::new(channel).ok()) }
    }
}

struct Stream {
    survey: TopicSurvey,
    stamps: Vec<Stamp>,
    /// Stamps and arrivals of what may come from another machine; cameras are on the recorder's.
    lags: Vec<(Stamp, Stamp)>,
    without_stamp: usize,
    undecodable: usize,
    last_frame: Option<u64>,
}

impl Stream {
    fn new(channel: &Channel) -> Self {
        let survey = TopicSurvey {
            topic: channel.topic.clone(),
            schema: schema_name(channel).to_owned(),
            message_encoding: channel.message_encoding.clone(),
            schema_encoding: channel.schema.as_ref().map_or_else(String::new, |schema| schema.encoding.clone()),
            bytes: 0,
            truncated_frames: 0,
            missing_frames: 0,
            rate_hz: None,
            lag: None,
            jumps: Vec::new(),
            quality: StreamQuality::default(),
        };
        Self { survey, stamps: Vec::new(), lags: Vec::new(), without_stamp: 0, undecodable: 0, last_frame: None }
    }

    fn take(&mut self, reading: &Reading, message: &RawMessage<'_>) {
        self.survey.bytes += message.data.len() as u64;
        let own = reading.stamps.read(message.data);
        self.stamps.push(own.unwrap_or(message.publish_time));
        if message.channel.message_encoding == "ros1" && topics::camera_of(&message.channel.topic).is_none() {
            self.lags.extend(own.map(|stamp| (stamp, message.log_time)));
        }
        let mut fits = true;
        if let Some((side, decoder)) = &reading.frames {
            match decoder.decode(*side, message) {
                Some(frame) => {
                    self.survey.truncated_frames += usize::from(frame.is_truncated());
                    // A count that starts again is a new recording, not a loss.
                    let jump = frame.sequence.zip(self.last_frame).and_then(|(now, before)| now.checked_sub(before + 1));
                    self.survey.missing_frames = self.survey.missing_frames.saturating_add(jump.unwrap_or(0));
                    self.last_frame = frame.sequence;
                }
                None => {
                    self.undecodable += 1;
                    fits = false;
                }
            }
        }
        // What does not fit its definition shows no stamp either, and counts once.
        self.without_stamp += usize::from(own.is_none() && fits);
    }

    fn finish(mut self) -> TopicSurvey {
        let (without_stamp, undecodable) = (self.without_stamp, self.undecodable);
        self.survey.quality = StreamQuality { without_stamp, undecodable, ..StreamQuality::of(&self.stamps) };
        self.survey.rate_hz = self.survey.quality.rate_hz();
        self.survey.lag = Lag::of(&self.lags);
        self.survey.jumps = Jump::all(&self.lags);
        self.survey
    }
}

fn camera_skew(streams: &BTreeMap<String, Stream>) -> Option<CameraSkew> {
    // A stream may be announced and stay empty; of two kinds the one counts whose frames came first.
    let first = |side: Side| {
        let kinds = [topics::compressed(side), topics::raw(side)].into_iter().filter_map(|topic| streams.get(topic));
        kinds.map(|stream| &stream.stamps).filter(|stamps| !stamps.is_empty()).min_by_key(|stamps| stamps.first().copied())
    };
    CameraSkew::of(first(Side::Left)?, first(Side::Right)?)
}
