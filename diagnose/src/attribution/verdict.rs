//! The verdict in a word.
//!
//! A recording is explained if what the best hypothesis leaves is what the stated noise allows, at any length of time. Where it is not, and
//! the effects account for less than half of the misfit, nothing in the library explains the gap.

use serde::{Deserialize, Serialize};

use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::outcome::Outcome;
use crate::evidence::weighing::leftover::ACCOUNTED;

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

    /// Whether something reproducible remains.
    #[must_use]
    pub fn remains(self) -> bool {
        matches!(self, Self::PartlyExplained | Self::Unexplained)
    }
}

/// What the best hypothesis comes to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judgement {
    pub(super) word: Word,
    /// Part of the misfit that the named effects account for; nothing where none is named.
    pub(super) accounted: Option<f64>,
}

pub(super) fn judge(fitter: &Fitter, outcome: &Outcome, named: Option<&Hypothesis>) -> Judgement {
    let hypothesis = named.unwrap_or(&outcome.none);
    let leftover = fitter.leftover(hypothesis);
    let accounted = named.map(|best| fitter.accounted(&outcome.none, best));
    let word = match (accounted, leftover.remains()) {
        (None, false) => Word::None,
        (None, true) => Word::Unexplained,
        (Some(_), false) => Word::Explained,
        (Some(accounted), true) if accounted > ACCOUNTED => Word::PartlyExplained,
        (Some(_), true) => Word::Unexplained,
    };
    Judgement { word, accounted: accounted.filter(|_| word != Word::Unexplained) }
}
