//! A verdict as the report's JSON has it: what a blind check needs of `raven-diagnosis/1`. Other keys are ignored.

use serde::{Deserialize, Serialize};

use crate::attribution::{Attribution, Word};
use crate::evidence::numbers::spread::Departures;

/// What a diagnosis makes of one recording.
#[derive(Debug, Clone)]
pub struct Diagnosed {
    /// The verdict.
    pub verdict: Verdict,
    /// How far it takes the model's numbers to be off; nothing where that says nothing of other recordings.
    pub departures: Option<Departures>,
}

/// The verdict on one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// In a word.
    pub verdict: Word,
    /// Effects that are blamed, the surest first.
    pub effects: Vec<Blamed>,
    /// Every effect looked at, best first. One named `none` holds the probability that no effect is needed.
    #[serde(default)]
    pub candidates: Vec<Candidate>,
    /// How far the gap closes.
    #[serde(default)]
    pub gap: Vec<ChannelGap>,
}

/// A blamed effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Blamed {
    /// Identifier.
    pub id: String,
    /// Joint, `from->to`, `12` or `23`; none for the whole.
    pub joint: Option<String>,
    /// That this effect is there.
    pub probability: f64,
    /// Its numbers, in the library's order.
    #[serde(default)]
    pub parameters: Vec<Estimate>,
}

/// One number of a blamed effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Name.
    pub name: String,
    /// In SI units.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// An effect that was looked at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Identifier.
    pub id: String,
    /// As of a blamed effect.
    pub joint: Option<String>,
    /// That it is there, alone or with others.
    pub probability: f64,
}

/// What a diagnosis that was told the effects makes of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Told {
    /// How far the gap closes.
    pub gap: Vec<ChannelGap>,
    /// Evidence that each effect adds beside the others, at least [nat].
    pub evidence_nats: f64,
}

/// How far the gap of one channel closes, from 0 to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelGap {
    /// Joint or `tip`.
    pub channel: String,
    /// Part of the squared gap above the noise floor that the effects take away; nothing where there is none to take.
    pub closed: Option<f64>,
    /// The same where the file's own numbers are moved against their tolerances as well.
    #[serde(default)]
    pub retuned: Retuned,
}

/// As [`crate::attribution::Closure::retuned`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Retuned {
    /// Part of the squared gap above the noise floor that is gone.
    pub closed: Option<f64>,
}

impl From<&crate::attribution::Closure> for ChannelGap {
    fn from(closure: &crate::attribution::Closure) -> Self {
        Self { channel: closure.channel.clone(), closed: closure.closed, retuned: Retuned { closed: closure.retuned.closed } }
    }
}

impl From<&crate::attribution::Told> for Told {
    fn from(told: &crate::attribution::Told) -> Self {
        Self { gap: told.gap.iter().map(ChannelGap::from).collect(), evidence_nats: told.evidence_nats }
    }
}

impl From<&Attribution> for Verdict {
    fn from(found: &Attribution) -> Self {
        let estimate = |e: &crate::attribution::Estimate| Estimate { name: e.name.to_owned(), value: e.value, std: e.std };
        let blamed = |e: &crate::attribution::Blamed| Blamed {
            id: e.id.to_owned(),
            joint: e.joint.clone(),
            probability: e.probability,
            parameters: e.parameters.iter().map(estimate).collect(),
        };
        let candidate =
            |c: &crate::attribution::Candidate| Candidate { id: c.id.to_owned(), joint: c.joint.clone(), probability: c.probability };
        Self {
            verdict: found.verdict,
            effects: found.effects.iter().map(blamed).collect(),
            candidates: found.candidates.iter().map(candidate).collect(),
            gap: found.gap.iter().map(ChannelGap::from).collect(),
        }
    }
}
