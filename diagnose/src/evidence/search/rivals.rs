//! What explains about as much as the best hypothesis by another effect, each fitted once more by slopes of rolled-out links.
//!
//! A fit by slopes of settled links stops some nats short, of two that describe the same robot one may by ten or twenty. Where much is explained that
//! is little, but which of two effects it is turns on it. Where the best hypothesis has several effects that holds for what the library ties to one of
//! them: others, fitted on, make good what the laws of those that are there are not quite.

use raven::Result;

use super::close::anchored;
use super::refit::LOST_NATS;
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::outcome::Outcome;

/// Rivals are as near the best as this, what that leaves counting as noise [nat], so many of them at most.
const RIVALS_NATS: f64 = 10.0;
const RIVALS_MAX: usize = 3;

impl Fitter<'_> {
    /// Fits the best hypothesis and its rivals once more, these from their own numbers or with the best's beside their own effect, and goes on with the
    /// best of them.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(crate) fn hold_against_rivals(&self, outcome: &mut Outcome) -> Result<()> {
        let best = outcome.best.clone();
        let within = RIVALS_NATS * self.leftover(&best).most();
        let is_near = |h: &&Hypothesis| h.evidence > best.evidence - within;
        let rival = |h| Some((h, self.rivalling(&best, h)?));
        let mut rivals: Vec<(&Hypothesis, [usize; 2])> =
            outcome.fitted.values().map(|(h, _)| h).filter(is_near).filter_map(rival).collect();
        rivals.sort_by(|(a, _), (b, _)| b.evidence.total_cmp(&a.evidence));
        rivals.truncate(RIVALS_MAX);
        if rivals.is_empty() {
            return Ok(());
        }
        let Some(again) = self.fitted_closely(&best.effects, &best.u, None)? else { return Ok(()) };
        let of_rival = |(h, [found, other]): &(&Hypothesis, [usize; 2])| {
            let instead = self.taking(&self.without(*found, &best.u), &[*other], &h.u);
            let is_nearer = self.cost_at(&h.effects, &instead)? < h.cost - LOST_NATS;
            self.fitted_closely(&h.effects, if is_nearer { &instead } else { &h.u }, Some(&again))
        };
        let mut close = side_by_side(&rivals, of_rival)?;
        close.push(again);
        let same = self.level_the_same(&mut close)?;
        anchored(&mut close, &best);
        same.into_iter().for_each(|k| outcome.put(&close[k]));
        self.taken(outcome, close.into_iter());
        Ok(())
    }

    /// The effect of the best hypothesis in whose place another one has an effect of its own, and that, if this makes them rivals.
    fn rivalling(&self, best: &Hypothesis, other: &Hypothesis) -> Option<[usize; 2]> {
        let [found, instead] = best.swapped(other)?;
        (best.effects.len() == 1 || self.are_tied(found, instead)).then_some([found, instead])
    }
}
