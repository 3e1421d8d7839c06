//! The tracked point, as `raven_cal/TipObservation` has it.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::Stamp;

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
    /// Marker centre in the raw (distorted) left image, u to the right, v down [px]; NaN where it was not seen or another tracker was used.
    pub left_px: [f64; 2],
    /// The same in the right image.
    pub right_px: [f64; 2],
    /// Tracked point in frame 0 [m]; NaN unless it was triangulated.
    pub position_m: Vector3<f64>,
    /// Covariance of `position_m` [m^2].
    pub covariance_m2: Matrix3<f64>,
}
