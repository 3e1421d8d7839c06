//! The verdict in a word.
//!
//! A recording is explained if what the best hypothesis leaves is what the stated noise allows, at any length of time. Where it is not, and
//! the effects account for less than half of the misfit, nothing in the library explains the gap.

use serde::{Deserialize, Serialize};

use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::leftover::Leftover;
use crate::evidence::linear::dot;
use crate::evidence::search::Outcome;

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

/// Variance over what was stated beyond which something remains: stated deviations of tips are good to some ten per cent.
const REMAINS: f64 = 1.5;
/// Part of the misfit that effects have to account for.
const ACCOUNTED: f64 = 0.5;

/// What the best hypothesis comes to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Judgement {
    pub(super) word: Word,
    /// Part of the misfit that the named effects account for; nothing where none is named.
    pub(super) accounted: Option<f64>,
}

pub(super) fn judge(fitter: &Fitter, outcome: &Outcome, named: Option<&Hypothesis>) -> Judgement {
    let hypothesis = named.unwrap_or(&outcome.none);
    let leftover = Leftover::of(&hypothesis.residuals, fitter.rows.tip_rows());
    let remains = leftover.tip.max(leftover.torque.max()) > REMAINS;
    let misfit = |h: &Hypothesis| {
        let prior = |&c: &usize| fitter.prior(c, &h.effects).map_or(0.0, |t| (h.u[c] / t).powi(2));
        let rows = h.residuals.iter().filter(|r| **r != 0.0).count() as f64;
        let excess = (dot(&h.residuals, &h.residuals) - rows).max(0.0);
        excess + h.free.iter().map(prior).sum::<f64>()
    };
    let accounted = named.map(|best| 1.0 - misfit(best) / misfit(&outcome.none));
    let word = match (accounted, remains) {
        (None, false) => Word::None,
        (None, true) => Word::Unexplained,
        (Some(_), false) => Word::Explained,
        (Some(accounted), true) if accounted > ACCOUNTED => Word::PartlyExplained,
        (Some(_), true) => Word::Unexplained,
    };
    Judgement { word, accounted: accounted.filter(|_| word != Word::Unexplained) }
}
