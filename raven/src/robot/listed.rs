//! Effects that no number of the robot file can say. They stand in its list `effects` as plain data; their laws are in [`crate::effects`].

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::Deserialize;

use super::{Arm, MotorTrack, Transmission};

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
/// cables with all their numbers and of the whole recording's motors [s, rad], and changes them in place.
pub type MotorLaw = Box<dyn Fn(&Cables, &mut MotorTrack) + Send + Sync>;

/// Tension differences of the cables [N] at a time [s], with the motors at angles [rad] and turning [rad/s].
pub type TensionLaw<'a> = dyn Fn(f64, &Vector3<f64>, &Vector3<f64>) -> Vector3<f64> + 'a;

/// What a law of the motors' side hears of.
pub struct Cables<'a> {
    /// Pulleys.
    pub transmission: &'a Transmission,
    /// `k_e` of each [N].
    pub stiffness_n: [f64; 3],
    /// What they carry.
    pub tension_n: &'a TensionLaw<'a>,
}

/// What laws make of recorded motors on an arm, whose cables carry its weight and its friction.
#[must_use]
pub fn wound<'a>(laws: &[MotorLaw], arm: &Arm, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
    let transmission = &arm.transmission;
    let tension_n = |_: f64, motor: &Vector3<f64>, rate: &Vector3<f64>| {
        let way = arm.rubbing(&transmission.joint_rate_from_motor(rate));
        let drag = Vector3::from_fn(|j, _| arm.link_friction[j].coulomb * way[j]);
        transmission.tension_n(&(arm.dynamics.gravity(&transmission.joint_from_motor(motor)) + drag))
    };
    wound_by(laws, &Cables { transmission, stiffness_n: arm.cables.map(|cable| cable.stiffness), tension_n: &tension_n }, recorded)
}

/// What laws make of recorded motors on cables.
#[must_use]
pub fn wound_by<'a>(laws: &[MotorLaw], cables: &Cables, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
    let mut track = Cow::Borrowed(recorded);
    laws.iter().for_each(|law| law(cables, track.to_mut()));
    track
}

/// Laws of the motors' side, applied in order.
#[derive(Clone, Default)]
pub struct MotorLaws(Arc<[MotorLaw]>);

impl MotorLaws {
    /// The motors' side as the cables of `arm` have it.
    #[must_use]
    pub fn applied<'a>(&self, arm: &Arm, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        wound(&self.0, arm, recorded)
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
