//! Effects that no number of the robot file can say. They stand in its list `effects` as plain data; their laws are in [`crate::effects`].

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use serde::Deserialize;

use super::{Arm, MotorTrack};

/// One entry of `effects:`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListedEffect {
    /// Identifier, as `raven-diagnose` names it.
    pub id: String,
    /// Joint; none where it belongs to the rig.
    #[serde(default)]
    pub joint: Option<String>,
    /// Its numbers by name, in SI units.
    pub values: BTreeMap<String, f64>,
}

/// How recorded motor angles become those that wind the cables: encoder faults and whatever the cable does at the capstan. It hears of the
/// arm with all its numbers and of the whole recording's motors [s, rad], and changes them in place.
pub type MotorLaw = Box<dyn Fn(&Arm, &mut MotorTrack) + Send + Sync>;

/// Laws of the motors' side, applied in order.
#[derive(Clone, Default)]
pub struct MotorLaws(Arc<[MotorLaw]>);

impl MotorLaws {
    /// The motors' side as the cables of `arm` have it.
    #[must_use]
    pub fn applied<'a>(&self, arm: &Arm, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        if self.0.is_empty() {
            return Cow::Borrowed(recorded);
        }
        let mut track = recorded.clone();
        self.0.iter().for_each(|law| law(arm, &mut track));
        Cow::Owned(track)
    }
}

impl From<Vec<MotorLaw>> for MotorLaws {
    fn from(laws: Vec<MotorLaw>) -> Self {
        Self(laws.into())
    }
}

impl fmt::Debug for MotorLaws {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} motor laws", self.0.len())
    }
}
