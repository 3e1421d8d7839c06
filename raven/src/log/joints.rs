//! Joint states: `sensor_msgs/JointState` in ROS 1, `foxglove.JointStates` in protobuf.

use foxglove::messages::JointStates;
use prost::Message;

use super::header::{ros1_extractor, schema_name, unreadable};
use super::ros1::{Extractor, HEADER_STAMPS, header_stamp};
use super::{Channel, Stamp, protobuf};

/// One message, in buffers that are used again for the next.
#[derive(Debug, Default)]
pub(super) struct JointSample {
    pub(super) stamp: Option<Stamp>,
    pub(super) names: Vec<String>,
    pub(super) position: Vec<f64>,
    /// Empty if not recorded.
    pub(super) effort: Vec<f64>,
}

pub(super) enum JointDecoder {
    Ros1(Extractor),
    Protobuf,
}

impl JointDecoder {
    /// # Errors
    /// Half a sentence about the channel.
    pub(super) fn new(channel: &Channel) -> Result<Self, String> {
        match (channel.message_encoding.as_str(), schema_name(channel)) {
            ("ros1", _) => {
                let [header, hdr] = HEADER_STAMPS;
                let extractor = ros1_extractor(channel, &[header, hdr, "name", "position", "effort"])?;
                if extractor.has(3) { Ok(Self::Ros1(extractor)) } else { Err("its messages have no field `position`".to_owned()) }
            }
            ("protobuf", "foxglove.JointStates") => Ok(Self::Protobuf),
            _ => Err(unreadable(channel, "joint states")),
        }
    }

    /// Decodes one message into `sample`; `None` if it does not fit its definition.
    pub(super) fn decode(&self, message: &[u8], sample: &mut JointSample) -> Option<()> {
        sample.names.clear();
        sample.position.clear();
        sample.effort.clear();
        match self {
            Self::Ros1(extractor) => {
                let [header, hdr, names, position, effort] = extractor.walk(message).ok()?;
                sample.stamp = header_stamp([header, hdr]);
                sample.names.extend(names.into_iter().flat_map(|names| names.texts().map(String::from).collect::<Vec<_>>()));
                for (value, numbers) in [(position, &mut sample.position), (effort, &mut sample.effort)] {
                    for i in 0..value.map_or(0, |value| value.len()) {
                        numbers.push(value.and_then(|value| value.number(i))?);
                    }
                }
            }
            Self::Protobuf => {
                let states = JointStates::decode(message).ok()?;
                sample.stamp = protobuf::stamp(states.timestamp);
                for joint in states.joints {
                    sample.position.push(joint.position.unwrap_or(f64::NAN));
                    sample.effort.push(joint.effort.unwrap_or(f64::NAN));
                    sample.names.push(joint.name);
                }
            }
        }
        if sample.names.is_empty() {
            sample.names.extend((1..=sample.position.len()).map(|number| format!("joint {number}")));
        }
        Some(())
    }
}
