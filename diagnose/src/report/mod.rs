//! The report on one page: HTML without scripts or anything from elsewhere, for a screen, bright or dark, and for A4 paper.

mod bars;
mod causes;
mod gap;
mod html;
mod remaining;
#[cfg(test)]
mod sample;
mod traces;

pub use causes::{Files, add_causes};
pub use gap::gap_page;
pub use html::html;

use crate::gap::MotorMotion;

/// What the page says. Empty parts are left out.
#[derive(Debug, Clone, Default)]
pub struct Page {
    /// Robot, or whatever the page is about.
    pub title: String,
    /// The verdict in a word: `explained`.
    pub verdict: String,
    /// The verdict in a sentence.
    pub verdict_sentence: String,
    /// What else there is to say of how it came about.
    pub remarks: Vec<String>,
    /// Recordings behind it.
    pub recordings: Vec<String>,
    /// The gap of each channel.
    pub gaps: Vec<GapBar>,
    /// Causes that were looked at, best first.
    pub candidates: Vec<Candidate>,
    /// Where the gap lies, in sentences.
    pub places: Vec<String>,
    /// How far motors come that the recorded torque drives through the model, joint by joint.
    pub motors: Vec<MotorMotion>,
    /// Residuals over time, channel by channel.
    pub traces: Vec<Trace>,
    /// Residuals by phase, channel by channel.
    pub phases: Vec<PhaseBars>,
    /// Causes that this recording cannot tell apart, in sentences.
    pub ties: Vec<String>,
    /// Whether recordings were held against simulations.
    pub is_against: bool,
    /// Numbers of the robot file that are off, or that robot and simulation have apart, in words.
    pub file_numbers: Vec<String>,
    /// What part of the robot file's tolerances counts, by the kind of effect its numbers would be.
    pub tolerance_parts: Vec<(String, f64)>,
    /// What to do next, in sentences.
    pub next_steps: Vec<String>,
    /// Smallest sizes that the recording could have shown.
    pub detectable: Vec<Detectable>,
    /// Causes that cannot show in these recordings: identifier and reason.
    pub not_observable: Vec<(String, String)>,
}

/// RMS before and after the causes found are in the model.
#[derive(Debug, Clone, Default)]
pub struct GapBar {
    /// Joint, or `tip`.
    pub channel: String,
    /// Unit of the numbers; channels of one unit share a scale.
    pub unit: String,
    /// RMS that the measurement's noise alone leaves.
    pub noise_floor: f64,
    /// RMS before.
    pub before: f64,
    /// RMS after; `None` where nothing was added to the model.
    pub after: Option<f64>,
    /// Share of the gap above the noise floor that was closed, with its 95 % interval.
    pub closed: Option<(f64, [f64; 2])>,
    /// RMS with the file's own numbers moved against their tolerances as well.
    pub retuned: Option<f64>,
}

/// A cause.
#[derive(Debug, Clone, Default)]
pub struct Candidate {
    /// Identifier of the effect.
    pub effect: String,
    /// Joint; `None` for the whole robot or rig.
    pub joint: Option<String>,
    /// From 0 to 1, that it is there, alone or with others.
    pub probability: f64,
    /// What no recording can tell from it, and how probable it is with that, in words.
    pub together: Option<String>,
    /// The best evidence with it, above that of no effect [nat].
    pub evidence_nats: f64,
    /// Its numbers in words: `relative_error -0.0518 +- 0.0004`.
    pub parameters: Vec<String>,
    /// Whether the verdict takes it for a cause.
    pub chosen: bool,
    /// Whether its evidence is set aside.
    pub set_aside: bool,
}

/// Residuals of one channel over time.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    /// Joint, or `tip`.
    pub channel: String,
    /// Unit of the residuals.
    pub unit: String,
    /// Standard deviation of the measurement's noise.
    pub noise_floor: f64,
    /// [s].
    pub time_s: Vec<f64>,
    /// Residuals before.
    pub before: Vec<f64>,
    /// Residuals after; empty where nothing was added to the model.
    pub after: Vec<f64>,
}

/// Pause that is drawn between recordings [s].
const BETWEEN_S: f64 = 5.0;

impl Trace {
    /// Appends the times of another recording [s], after a pause.
    fn follow(&mut self, time_s: &[f64]) {
        let offset = self.time_s.last().zip(time_s.first()).map_or(0.0, |(last, first)| last + BETWEEN_S - first);
        self.time_s.extend(time_s.iter().map(|t| t + offset));
    }
}

/// RMS of one channel by phase.
#[derive(Debug, Clone, Default)]
pub struct PhaseBars {
    /// Joint.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: String,
    /// The phases.
    pub phases: Vec<PhaseBar>,
}

/// RMS in one phase.
#[derive(Debug, Clone, Default)]
pub struct PhaseBar {
    /// Name of the phase.
    pub phase: String,
    /// Share of the time.
    pub share_of_time: f64,
    /// RMS that the measurement's noise alone leaves.
    pub noise_floor: f64,
    /// RMS before.
    pub before: f64,
    /// RMS after; `None` where nothing was added to the model.
    pub after: Option<f64>,
}

/// The smallest size of an effect that would have been named.
#[derive(Debug, Clone, Default)]
pub struct Detectable {
    /// Identifier of the effect.
    pub effect: String,
    /// Joint; `None` for the whole robot or rig.
    pub joint: Option<String>,
    /// Size in words: `0.31 %`, `up to 12 N m`.
    pub size: String,
}
