//! The tracked point, as `raven_cal/TipObservation` has it.

use nalgebra::{Matrix3, Vector3};
use prost::Message;
use serde::{Deserialize, Serialize};

use super::header::{ros1_extractor, schema_name, unreadable};
use super::protobuf::{self, TipMessage};
use super::ros1::Extractor;
use super::{Channel, Stamp};

/// What became of one attempt to see the tracked point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TipStatus {
    /// Seen and accepted.
    Seen,
    /// Not seen in at least one camera.
    Occluded,
    /// Seen, but rejected as a jump.
    Jumped,
}

impl TipStatus {
    /// The number in the message.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Seen => 0,
            Self::Occluded => 1,
            Self::Jumped => 2,
        }
    }

    /// The status a number in a message stands for; a number of a later version counts as not usable.
    #[must_use]
    pub const fn from_code(code: u64) -> Self {
        match code {
            0 => Self::Seen,
            1 => Self::Occluded,
            _ => Self::Jumped,
        }
    }
}

/// One observation of the tracked point.
#[derive(Debug, Clone, PartialEq)]
pub struct TipObservation {
    /// Middle of the exposure on the robot's clock.
    pub stamp: Stamp,
    /// The arm's frame 0.
    pub frame_id: String,
    /// Whether `position_m` may be used.
    pub status: TipStatus,
    /// Marker centre in the raw (distorted) left image, u to the right, v down (px); NaN where it was not seen or another tracker was used.
    pub left_px: [f64; 2],
    /// The same in the right image.
    pub right_px: [f64; 2],
    /// Tracked point in frame 0 (m); NaN unless it was triangulated.
    pub position_m: Vector3<f64>,
    /// Covariance of `position_m` (m^2).
    pub covariance_m2: Matrix3<f64>,
}

/// Reads observations in either encoding.
pub(super) enum TipDecoder {
    Ros1(Extractor),
    Protobuf,
}

impl TipDecoder {
    /// # Errors
    /// Half a sentence about the channel.
    pub(super) fn new(channel: &Channel) -> Result<Self, String> {
        match (channel.message_encoding.as_str(), schema_name(channel)) {
            ("ros1", _) => {
                let wanted = ["header.stamp", "header.frame_id", "status", "left_px", "right_px", "position", "covariance"];
                let extractor = ros1_extractor(channel, &wanted)?;
                match wanted.iter().enumerate().find(|(slot, _)| !extractor.has(*slot)) {
                    None => Ok(Self::Ros1(extractor)),
                    Some((_, field)) => Err(format!("its messages have no field `{field}`")),
                }
            }
            ("protobuf", "raven_cal.TipObservation") => Ok(Self::Protobuf),
            _ => Err(unreadable(channel, "tip observations")),
        }
    }

    /// The observation, with a zero stamp where the message has none; `None` if the message does not fit its definition.
    pub(super) fn decode(&self, message: &[u8]) -> Option<TipObservation> {
        match self {
            Self::Ros1(extractor) => {
                let [stamp, frame_id, status, left, right, position, covariance] = extractor.walk(message).ok()?;
                Some(TipObservation {
                    stamp: stamp?.stamp()?,
                    frame_id: frame_id?.texts().next()?.into_owned(),
                    status: TipStatus::from_code(u64::try_from(status?.integer(0)?).ok()?),
                    left_px: left?.numbers()?,
                    right_px: right?.numbers()?,
                    position_m: Vector3::from(position?.numbers()?),
                    covariance_m2: Matrix3::from_row_slice(&covariance?.numbers::<9>()?),
                })
            }
            Self::Protobuf => {
                let tip = TipMessage::decode(message).ok()?;
                Some(TipObservation {
                    stamp: protobuf::stamp(tip.timestamp).unwrap_or_default(),
                    frame_id: tip.frame_id,
                    status: TipStatus::from_code(u64::from(tip.status)),
                    left_px: tip.left_px.try_into().ok()?,
                    right_px: tip.right_px.try_into().ok()?,
                    position_m: Vector3::from(<[f64; 3]>::try_from(tip.position).ok()?),
                    covariance_m2: Matrix3::from_row_slice(&<[f64; 9]>::try_from(tip.covariance).ok()?),
                })
            }
        }
    }
}

impl TipObservation {
    /// The observation as the protobuf message that logs carry.
    pub(super) fn to_message(&self) -> TipMessage {
        TipMessage {
            timestamp: protobuf::timestamp(self.stamp),
            frame_id: self.frame_id.clone(),
            status: self.status.code().into(),
            left_px: self.left_px.to_vec(),
            right_px: self.right_px.to_vec(),
            position: self.position_m.as_slice().to_vec(),
            // nalgebra is column-major, the message row-major.
            covariance: self.covariance_m2.transpose().as_slice().to_vec(),
        }
    }
}
