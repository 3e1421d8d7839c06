//! Everything in a log but the images, in memory.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use super::converter::Converters;
use super::header::StampReader;
use super::joints::{JointDecoder, JointSample};
use super::robot_state::{ARM_JOINTS, StateDecoder};
use super::series::SeriesBuilder;
use super::tip::TipDecoder;
use super::{Channel, Item, JointSeries, RawMessage, Side, Stamp, StreamQuality, TipObservation, TipStatus, Walker, topics};
use crate::robot::{ArmSide, KinematicsKind, Robot, SourceFormat};
use crate::{Error, Result};

/// Where a log has the motor side, and of which arm.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MotorSource {
    /// Topic name.
    pub topic: String,
    /// Kind of message.
    pub format: SourceFormat,
    /// Arm whose joints are read from the robot's own message.
    pub arm: ArmSide,
    /// Names by which joint states are put in order, the robot file's; those of a log that has none of them stay as they are.
    pub joints: Vec<String>,
}

impl Default for MotorSource {
    fn default() -> Self {
        Self { topic: topics::RAVEN_STATE.to_owned(), format: SourceFormat::RavenState, arm: ArmSide::Gold, joints: Vec::new() }
    }
}

impl From<&Robot> for MotorSource {
    fn from(robot: &Robot) -> Self {
        let arm = match &robot.kinematics {
            KinematicsKind::Raven(kinematics) => kinematics.arm,
            KinematicsKind::Bench => ArmSide::Gold,
        };
        let joints = robot.joints.iter().map(|joint| joint.name.clone()).collect();
        Self { topic: robot.source.topic.clone(), format: robot.source.format, arm, joints }
    }
}

/// A log without its images.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The file.
    pub path: PathBuf,
    /// The earliest stamp of motors, joint encoders and tip; of the images where there is none of these.
    pub start: Stamp,
    /// From `start` to the last such stamp (s).
    pub duration_s: f64,
    /// Metadata record `session`: robot, arm, motion, operator and more.
    pub session: BTreeMap<String, String>,
    /// Motor shaft angles (rad), efforts after the gear box at the capstan (N m), joints in the order of the source's names. From `raven_state`: the
    /// first three joints of the arm, torques as the converters clipped them.
    pub motor: Option<JointSeries>,
    /// Joint angles as the robot's controller has them (rad, rad, m), from `raven_state`.
    pub controller_joints: Option<JointSeries>,
    /// Reference encoders at the joints (rad or m), in the same order, with the load there as effort.
    pub joint_encoders: Option<JointSeries>,
    /// Tip observations in the order of time. One without finite numbers counts as occluded.
    pub tip: Vec<TipObservation>,
    /// Median interval between the frames of a camera, of the faster one (s); `None` where no camera has two.
    pub frame_interval_s: Option<f64>,
    /// Stored files by name.
    pub attachments: BTreeMap<String, Vec<u8>>,
    /// Number of messages by topic.
    pub topics: BTreeMap<String, u64>,
    /// Regularity of the topics read here.
    pub quality: BTreeMap<String, StreamQuality>,
    source: MotorSource,
    /// Of each camera with images the topic of the first one.
    first_images: BTreeMap<Side, String>,
    problems: BTreeMap<String, String>,
}

impl Recording {
    /// Reads a log.
    ///
    /// # Errors
    /// If the file cannot be read, is no MCAP file, is damaged, or has no messages. A topic that is not there is no error here.
    pub fn read(path: &Path, source: &MotorSource) -> Result<Self> {
        let mut walker = Walker::open(path)?;
        let mut reader = Reader::new(source);
        walker.run(|item| {
            reader.take(item);
            Ok(())
        })?;
        walker.require_whole()?;
        reader.finish(path)
    }

    /// The motors.
    ///
    /// # Errors
    /// A sentence with the file, what the robot file asked for and the topics that are there.
    pub fn require_motor(&self) -> Result<&JointSeries> {
        let needed = format!("motor positions, which the robot file expects on `{}`", self.source.topic);
        self.motor.as_ref().ok_or_else(|| self.missing(&self.source.topic, &needed, "see `source:` in the robot file"))
    }

    /// The tip observations.
    ///
    /// # Errors
    /// A sentence with the file and the topics that are there.
    pub fn require_tip(&self) -> Result<&[TipObservation]> {
        if self.tip.is_empty() {
            return Err(self.missing(topics::TIP, "tip observations on `/tip`", "`raven-track` writes them"));
        }
        Ok(&self.tip)
    }

    /// The tip observations in which the tip was seen.
    pub fn seen_tips(&self) -> impl Iterator<Item = &TipObservation> {
        self.tip.iter().filter(|tip| tip.status == TipStatus::Seen)
    }

    /// The reference encoders.
    ///
    /// # Errors
    /// A sentence with the file and the topics that are there.
    pub fn require_joint_encoders(&self) -> Result<&JointSeries> {
        let needed = "reference encoders on `/joint_encoders`";
        self.joint_encoders.as_ref().ok_or_else(|| self.missing(topics::JOINT_ENCODERS, needed, "record them, or do without validation"))
    }

    /// A sentence about messages that could not be used, if there are any.
    #[must_use]
    pub fn unusable(&self) -> Option<String> {
        let sum = |of: fn(&StreamQuality) -> usize| self.quality.values().map(of).sum::<usize>();
        let counts = [
            (sum(|quality| quality.non_finite), "without finite numbers"),
            (sum(|quality| quality.undecodable), "that could not be decoded"),
        ];
        let words: Vec<String> =
            counts.iter().filter(|(count, _)| *count > 0).map(|(count, which)| format!("{count} messages {which}")).collect();
        (!words.is_empty()).then(|| format!("{}: {} were left out.", self.name(), words.join(" and ")))
    }

    /// A sentence where the log says that it is of another robot than that of a robot file.
    #[must_use]
    pub fn of_another_robot(&self, robot: &Robot) -> Option<String> {
        let recorded = self.session.get("robot").filter(|recorded| **recorded != robot.name)?;
        Some(format!(
            "{} was recorded on robot `{recorded}` by its record `session`, and the robot file is of `{}`: check that they belong together.",
            self.path.display(),
            robot.name
        ))
    }

    /// The name of the file, without its folder.
    #[must_use]
    pub fn name(&self) -> String {
        self.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    /// Topic and number of the images of a camera: of the kind that comes first, which [`frames`](super::frames) takes.
    ///
    /// # Errors
    /// A sentence with the file and the topic on which they are expected.
    pub fn require_images(&self, side: Side) -> Result<(&str, u64)> {
        let first = self.first_images.get(&side).map(|topic| (topic.as_str(), self.topics.get(topic).copied().unwrap_or_default()));
        first.ok_or_else(|| {
            let message =
                format!("the log has no images of the {} camera on `{}`; both cameras are needed.", side.name(), topics::compressed(side));
            Error::file(&self.path, message)
        })
    }

    fn missing(&self, topic: &str, needed: &str, advice: &str) -> Error {
        let why = match self.problems.get(topic) {
            Some(problem) => format!("{problem}."),
            None => format!("{advice}. Topics in the file: {}.", list(&self.topics)),
        };
        Error::file(&self.path, format!("the log has no {needed}: {why}"))
    }
}

/// Topics in one line.
fn list(topics: &BTreeMap<String, u64>) -> String {
    if topics.is_empty() {
        return "none".to_owned();
    }
    topics.keys().map(|topic| format!("`{topic}`")).collect::<Vec<_>>().join(", ")
}

/// What is done with the messages of one channel.
enum Handler {
    State(StateDecoder),
    Motor(JointDecoder),
    Encoders(JointDecoder),
    Tip(TipDecoder),
    Image(Side, StampReader),
    Ignored,
}

struct Reader<'s> {
    source: &'s MotorSource,
    handlers: HashMap<u16, Handler>,
    sample: JointSample,
    motor: Option<SeriesBuilder>,
    controller: SeriesBuilder,
    converters: Converters,
    encoders: Option<SeriesBuilder>,
    tip: Vec<TipObservation>,
    tip_quality: StreamQuality,
    image_stamps: BTreeMap<String, Vec<Stamp>>,
    first_images: BTreeMap<Side, String>,
    session: BTreeMap<String, String>,
    attachments: BTreeMap<String, Vec<u8>>,
    topics: BTreeMap<String, u64>,
    problems: BTreeMap<String, String>,
}

impl<'s> Reader<'s> {
    fn new(source: &'s MotorSource) -> Self {
        Self {
            source,
            handlers: HashMap::new(),
            sample: JointSample::default(),
            motor: None,
            controller: SeriesBuilder::new(ARM_JOINTS.map(String::from).to_vec()),
            converters: Converters::default(),
            encoders: None,
            tip: Vec::new(),
            tip_quality: StreamQuality::default(),
            image_stamps: BTreeMap::new(),
            first_images: BTreeMap::new(),
            session: BTreeMap::new(),
            attachments: BTreeMap::new(),
            topics: BTreeMap::new(),
            problems: BTreeMap::new(),
        }
    }

    fn take(&mut self, item: Item<'_>) {
        match item {
            Item::Channel(channel) => {
                self.topics.entry(channel.topic.clone()).or_default();
                let handler = self.handler(channel).unwrap_or_else(|problem| {
                    self.problems.insert(channel.topic.clone(), problem);
                    Handler::Ignored
                });
                self.handlers.insert(channel.id, handler);
            }
            Item::Message(message) => self.message(&message),
            Item::Attachment(attachment) => {
                self.attachments.insert(attachment.name, attachment.data);
            }
            Item::Start { .. } => {}
            Item::Metadata(name, pairs) => {
                if name == "session" {
                    self.session.extend(pairs);
                }
            }
        }
    }

    fn handler(&self, channel: &Channel) -> Result<Handler, String> {
        Ok(match channel.topic.as_str() {
            topic if topic == self.source.topic => match self.source.format {
                SourceFormat::RavenState => Handler::State(StateDecoder::new(channel, self.source.arm)?),
                SourceFormat::JointState => Handler::Motor(JointDecoder::new(channel)?),
            },
            topics::JOINT_ENCODERS => Handler::Encoders(JointDecoder::new(channel)?),
            topics::TIP => Handler::Tip(TipDecoder::new(channel)?),
            topic => topics::camera_of(topic).map_or(Handler::Ignored, |side| Handler::Image(side, StampReader::new(channel))),
        })
    }

    fn message(&mut self, message: &RawMessage<'_>) {
        if let Some(count) = self.topics.get_mut(&message.channel.topic) {
            *count += 1;
        }
        let Some(handler) = self.handlers.get(&message.channel.id) else { return };
        match handler {
            Handler::State(decoder) => {
                let motor = self.motor.get_or_insert_with(|| SeriesBuilder::new(ARM_JOINTS.map(String::from).to_vec()));
                let Some(sample) = decoder.decode(message.data) else {
                    motor.undecodable += 1;
                    return;
                };
                let stamp = stamp_or_publication(sample.stamp, message, &mut motor.without_stamp);
                motor.push(stamp, &sample.motor, sample.torque.as_ref().map_or(&[], |torque| torque));
                if let Some(angles) = sample.controller {
                    self.controller.push(stamp, &angles, &[]);
                }
                if let Some((torque, steps)) = sample.torque.zip(sample.steps) {
                    self.converters.push(&torque, &steps);
                }
            }
            Handler::Motor(decoder) => push_joints(&mut self.motor, decoder, message, &mut self.sample),
            Handler::Encoders(decoder) => push_joints(&mut self.encoders, decoder, message, &mut self.sample),
            Handler::Tip(decoder) => match decoder.decode(message.data) {
                Some(tip) => self.push_tip(tip, message),
                None => self.tip_quality.undecodable += 1,
            },
            Handler::Image(side, stamps) => {
                self.first_images.entry(*side).or_insert_with(|| message.channel.topic.clone());
                let stamp = stamps.read(message.data).unwrap_or(message.publish_time);
                self.image_stamps.entry(message.channel.topic.clone()).or_default().push(stamp);
            }
            Handler::Ignored => {}
        }
    }

    fn push_tip(&mut self, mut tip: TipObservation, message: &RawMessage<'_>) {
        let own = Some(tip.stamp).filter(|stamp| stamp.0 > 0);
        tip.stamp = stamp_or_publication(own, message, &mut self.tip_quality.without_stamp);
        let finite = tip.position_m.iter().chain(tip.covariance_m2.iter()).all(|number| number.is_finite());
        if tip.status == TipStatus::Seen && !finite {
            tip.status = TipStatus::Occluded;
            self.tip_quality.non_finite += 1;
        }
        self.tip.push(tip);
    }

    fn finish(mut self, path: &Path) -> Result<Recording> {
        let stamps: Vec<Stamp> = self.tip.iter().map(|tip| tip.stamp).collect();
        let builders = [&self.motor, &self.encoders];
        let firsts = builders.iter().filter_map(|builder| builder.as_ref()?.first()).chain(stamps.iter().min().copied());
        let lasts = builders.iter().filter_map(|builder| builder.as_ref()?.last()).chain(stamps.iter().max().copied());
        let images = || self.image_stamps.values().flatten().copied();
        let span = firsts.min().zip(lasts.max()).or_else(|| images().min().zip(images().max()));
        let Some((start, end)) = span else {
            let topics = list(&self.topics);
            return Err(Error::file(path, format!("the log has no robot, tip or camera messages. Topics in the file: {topics}.")));
        };

        let intervals = self.image_stamps.values().filter_map(|stamps| StreamQuality::of(stamps).median_interval_s);
        let frame_interval_s = intervals.min_by(f64::total_cmp);
        let mut quality = BTreeMap::new();
        let mut tip_quality = StreamQuality::of(&stamps);
        (tip_quality.without_stamp, tip_quality.non_finite, tip_quality.undecodable) =
            (self.tip_quality.without_stamp, self.tip_quality.non_finite, self.tip_quality.undecodable);
        let mut problems = self.problems;
        let mut finish = |builder: Option<SeriesBuilder>, topic: &str, joints: &[String]| {
            let (series, of_topic) = builder?.finish(start);
            if series.is_empty() {
                let bad = of_topic.undecodable + of_topic.non_finite;
                problems.insert(topic.to_owned(), format!("none of its {bad} messages holds a finite position"));
            }
            quality.insert(topic.to_owned(), of_topic);
            let ordered = series.ordered_by(joints).map_err(|problem| problems.insert(topic.to_owned(), problem)).ok()?;
            (!ordered.is_empty()).then_some(ordered)
        };
        // The robot's own message has its joints at their places, whatever the robot file calls them.
        let of_motor: &[String] = match self.source.format {
            SourceFormat::RavenState => &[],
            SourceFormat::JointState => &self.source.joints,
        };
        let mut motor = finish(self.motor, &self.source.topic, of_motor);
        if let Some(torques) = motor.as_mut().and_then(|series| series.effort.as_mut()) {
            self.converters.clip(torques);
        }
        let encoders = finish(self.encoders, topics::JOINT_ENCODERS, &self.source.joints);
        if self.topics.contains_key(topics::TIP) {
            quality.insert(topics::TIP.to_owned(), tip_quality);
        }
        // Of several with one stamp, one that was seen stays.
        self.tip.sort_by_key(|tip| (tip.stamp, tip.status.code()));
        self.tip.dedup_by_key(|tip| tip.stamp);
        let (controller, _) = self.controller.finish(start);
        Ok(Recording {
            path: path.to_owned(),
            start,
            duration_s: end.seconds_since(start),
            session: self.session,
            motor,
            controller_joints: (!controller.is_empty()).then_some(controller),
            joint_encoders: encoders,
            tip: self.tip,
            frame_interval_s,
            attachments: self.attachments,
            topics: self.topics,
            quality,
            source: self.source.clone(),
            first_images: self.first_images,
            problems,
        })
    }
}

fn push_joints(builder: &mut Option<SeriesBuilder>, decoder: &JointDecoder, message: &RawMessage<'_>, sample: &mut JointSample) {
    let decoded = decoder.decode(message.data, sample);
    let builder = builder.get_or_insert_with(SeriesBuilder::default);
    let names_any = decoded.is_some() && !sample.names.is_empty();
    if names_any && builder.names().is_empty() {
        builder.begin(sample.names.clone());
    }
    if !names_any || sample.names != builder.names() {
        builder.undecodable += 1;
        return;
    }
    let stamp = stamp_or_publication(sample.stamp, message, &mut builder.without_stamp);
    builder.push(stamp, &sample.position, &sample.effort);
}

fn stamp_or_publication(stamp: Option<Stamp>, message: &RawMessage<'_>, without_stamp: &mut usize) -> Stamp {
    stamp.unwrap_or_else(|| {
        *without_stamp += 1;
        message.publish_time
    })
}
