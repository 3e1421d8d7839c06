//! Single effects that explain about as much as the best one, each fitted once more by slopes of rolled-out links.
//!
//! A fit by slopes of settled links stops some nats short, of two that describe the same robot one may by ten or twenty. Where much is explained that
//! is little, but which of two effects it is turns on it. Not where the best hypothesis has several: fits that end farther on make good by a third
//! effect what the laws of the first two are not quite.

use raven::Result;
use rayon::prelude::*;

use super::fit::{Fitter, Hypothesis, cost};
use super::outcome::Outcome;
use super::slopes::Following;

/// Rivals are as near the best as this, what that leaves counting as noise [nat], so many of them at most.
const RIVALS_NATS: f64 = 10.0;
const RIVALS_MAX: usize = 3;

impl Fitter<'_> {
    /// Fits the best hypothesis, if it has one effect, and its rivals once more, these from their own numbers or with the best's beside their effect, and
    /// goes on with the best of them.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub(super) fn hold_against_rivals(&self, outcome: &mut Outcome) -> Result<()> {
        let best = outcome.best.clone();
        let &[found] = best.effects.as_slice() else { return Ok(()) };
        let within = RIVALS_NATS * self.leftover(&best).most();
        let is_rival = |h: &&Hypothesis| h.effects.len() == 1 && h.effects != best.effects && h.evidence > best.evidence - within;
        let mut rivals: Vec<&Hypothesis> = outcome.fitted.values().map(|(h, _)| h).filter(is_rival).collect();
        rivals.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        rivals.truncate(RIVALS_MAX);
        if rivals.is_empty() {
            return Ok(());
        }
        let without = self.without(found, &best.u);
        let again = |h: &&Hypothesis| {
            let start = if h.effects == best.effects { h.u.clone() } else { self.cheaper(h, self.taking(&without, &h.effects, &h.u))? };
            self.fit_with(&h.effects, &start, None, Following::AllRolledOut)
        };
        rivals.push(&best);
        let fitted: Result<Vec<Option<Hypothesis>>> = rivals.par_iter().map(again).collect();
        self.taken(outcome, fitted?.into_iter().flatten());
        Ok(())
    }

    /// The numbers of a hypothesis, or others where they cost less.
    fn cheaper(&self, hypothesis: &Hypothesis, other: Vec<f64>) -> Result<Vec<f64>> {
        let precision = self.precision(&hypothesis.free, &hypothesis.effects);
        let here = cost(&hypothesis.free, &precision, &hypothesis.u, &hypothesis.residuals);
        let there = cost(&hypothesis.free, &precision, &other, &self.exact(&other)?);
        Ok(if there < here { other } else { hypothesis.u.clone() })
    }
}
