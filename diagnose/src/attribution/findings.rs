//! What recordings say of causes, as reports and verdicts have it.

use serde::Serialize;

use super::words::number;
use super::{Closure, Detectable, FileNumber, Remaining, Tied, Word};
use crate::evidence::numbers::spread::{Departures, Spread};
use crate::evidence::recorded::settings::Setting;

/// What the recordings say of causes.
#[derive(Debug, Clone, Serialize)]
pub struct Attribution {
    /// In a word.
    pub verdict: Word,
    /// Causes, the surest first.
    pub effects: Vec<Blamed>,
    /// Part of the misfit that they account for; nothing without effects.
    pub misfit_accounted: Option<f64>,
    /// Every effect looked at, and none: the most probable first.
    pub candidates: Vec<Candidate>,
    /// Effects that these recordings cannot show.
    pub not_observable: Vec<NotObservable>,
    /// Smallest sizes that they could have shown.
    pub minimum_detectable: Vec<Detectable>,
    /// Probability that there are effects, all of them too small to show.
    pub probability_too_small: f64,
    /// Probability that the cause is not in the library, and that what is named stands in for it.
    pub probability_outside: f64,
    /// Numbers of the robot file that are off by more than it allows them, beside the effects.
    pub file_numbers: Vec<FileNumber>,
    /// What part of its tolerances counted, by kind of effect; empty where no other recording says.
    pub tolerance_parts: Spread,
    /// How far these recordings take its numbers to be off; nothing where they hold something that is not explained.
    #[serde(skip)]
    pub departures: Option<Departures>,
    /// How far the gap closes.
    pub gap: Vec<Closure>,
    /// What is left over time, before and after the effects; empty without effects.
    #[serde(skip)]
    pub remaining: Vec<Remaining>,
    /// What else there is to say.
    pub remarks: Vec<String>,
    /// Where recordings were held against a simulation, which of the two has the effects.
    #[serde(skip)]
    pub side: Option<Side>,
    /// Where the search ended, for another one to be held against.
    #[serde(skip)]
    pub point: Point,
}

#[cfg(test)]
impl Attribution {
    /// With nothing to say but a verdict.
    pub(crate) fn without_findings(verdict: Word) -> Self {
        Self {
            verdict,
            effects: Vec::new(),
            misfit_accounted: None,
            candidates: Vec::new(),
            not_observable: Vec::new(),
            minimum_detectable: Vec::new(),
            probability_too_small: 0.0,
            probability_outside: 0.0,
            file_numbers: Vec::new(),
            tolerance_parts: Spread::default(),
            departures: None,
            gap: Vec::new(),
            remaining: Vec::new(),
            remarks: Vec::new(),
            side: None,
            point: Point::default(),
        }
    }
}

/// Where the numbers of a model are best, with the effects that are named.
#[derive(Debug, Clone, Default)]
pub struct Point {
    pub(super) settings: Vec<Setting>,
    /// Evidence with the prior of so many effects, but for the misfit [nat].
    pub(super) beside_misfit_nats: f64,
}

/// Which of a robot and its simulation has what the other lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The robot.
    Robot,
    /// The simulation.
    Simulation,
}

/// A cause.
#[derive(Debug, Clone, Serialize)]
pub struct Blamed {
    /// Identifier.
    pub id: &'static str,
    /// Joint, `from->to`, `12` or `23`; nothing for the whole.
    pub joint: Option<String>,
    /// That it is there, or what no recording of motors and tip can tell from it.
    pub probability: f64,
    /// What the evidence loses without it [nat].
    pub evidence_nats: f64,
    /// Its numbers.
    pub parameters: Vec<Estimate>,
    /// What cannot be told from it, or hardly.
    pub ties: Vec<Tied>,
}

impl Blamed {
    /// Its numbers as sentences have them.
    #[must_use]
    pub fn numbers(&self) -> Vec<String> {
        self.parameters.iter().filter(|estimate| !estimate.aside).map(number).collect()
    }
}

/// A number of a cause.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Name.
    pub name: &'static str,
    /// In `unit`.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// SI.
    pub unit: String,
    /// Whether it belongs to the law and says nothing of whether the effect is there: left out of sentences.
    #[serde(skip)]
    pub aside: bool,
    /// Whether it is one of the whole numbers, which has no deviation.
    #[serde(skip)]
    pub whole: bool,
}

impl Attribution {
    /// The effect that is looked at first if there should be one after all, where that is probable enough to be said.
    #[must_use]
    pub fn leading(&self) -> Option<&Candidate> {
        let first = self.candidates.iter().find(|candidate| candidate.id != NONE)?;
        (self.effects.is_empty() && first.probability > LEADING_MIN).then_some(first)
    }
}

/// The candidate that there is no effect.
pub const NONE: &str = "none";

/// An effect that was looked at.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Identifier; [`NONE`] for no effect.
    pub id: &'static str,
    /// As of a cause.
    pub joint: Option<String>,
    /// That it is there, alone or with others.
    pub probability: f64,
    /// The best evidence with it, above that of no effect [nat].
    pub evidence_nats: f64,
    /// Whether that is set aside: its size is not beyond what sizes scatter by, or what it explains does not matter beside what others do.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub set_aside: bool,
}

/// An effect that cannot show.
#[derive(Debug, Clone, Serialize)]
pub struct NotObservable {
    /// Identifier.
    pub id: &'static str,
    /// Why.
    pub because: String,
}

/// Probability from which on the leading candidate is spoken of where none is named, and an effect is named beside others.
pub(super) const LEADING_MIN: f64 = 0.05;
