//! A verdict as the report's JSON has it: what a blind check needs of `raven-diagnosis/1`. Other keys are ignored.

use serde::{Deserialize, Serialize};

/// The verdict on one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// In a word.
    pub verdict: Word,
    /// Effects that are blamed, the surest first.
    pub effects: Vec<Blamed>,
    /// Every hypothesis looked at, best first. One named `none` holds the probability that no effect is needed.
    #[serde(default)]
    pub candidates: Vec<Candidate>,
    /// How far the gap closes.
    #[serde(default)]
    pub gap: Vec<ChannelGap>,
}

/// The verdict in a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Word {
    /// No effect is needed.
    None,
    /// The effects leave residuals that look like noise.
    Explained,
    /// They help, and something reproducible remains.
    PartlyExplained,
    /// A gap that nothing in the library accounts for.
    Unexplained,
}

impl Word {
    /// As in the JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Explained => "explained",
            Self::PartlyExplained => "partly-explained",
            Self::Unexplained => "unexplained",
        }
    }
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

/// One hypothesis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Identifier.
    pub id: String,
    /// As of a blamed effect.
    pub joint: Option<String>,
    /// Of this hypothesis.
    pub probability: f64,
}

/// How far the gap of one channel closes, from 0 to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelGap {
    /// Joint or `tip`.
    pub channel: String,
    /// Part of the squared gap above the noise floor that the effects take away; nothing where there is none to take.
    pub closed: Option<f64>,
}
