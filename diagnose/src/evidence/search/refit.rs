//! Fits of what the screen proposes, and of hypotheses that others show to have stopped short.
//!
//! A hypothesis with more effects can be where one with fewer is, and one with fewer nearly where one with more is. Where it is farther from the
//! recordings it is fitted again from there.

use nalgebra::DVector;
use raven::Result;

use super::screen::Candidate;
use super::{EFFECTS_MAX, WITHIN_NATS};
use crate::evidence::fit::{Fitter, Hypothesis, cost, side_by_side};
use crate::evidence::outcome::Outcome;

/// A fit is lost that is so much worse [nat] than where it could be: what is less is where joints stick.
pub(super) const LOST_NATS: f64 = 1.0;
/// The first so many candidates are fitted, too, if they are no farther behind than slopes were wrong by at the point they were looked at from, or if they would not
/// be were what the best leaves noise: a joint's zero that is degrees off bends what slopes say of everything, and so does a second effect. What
/// is beside two is as many as there may be, and the screen is believed.
const DOUBTED: usize = 4;
/// So many are fitted at a time, before the next are held against them: on every machine, or verdicts would depend on its processors.
const AT_ONCE: usize = 2;

impl Fitter<'_> {
    /// By how much a hypothesis is worse than at the numbers of a poorer one, which are among its own [nat].
    pub(crate) fn lost_nats(&self, richer: &Hypothesis, poorer: &Hypothesis) -> f64 {
        let precision = self.precision(&richer.free, &richer.effects);
        let here = cost(&richer.free, &precision, &self.mildly(&richer.effects, &poorer.u), &poorer.residuals);
        (richer.cost - here).max(0.0)
    }

    /// Whether it is lost.
    pub(super) fn is_lost(&self, richer: &Hypothesis, poorer: &Hypothesis) -> bool {
        self.lost_nats(richer, poorer) > LOST_NATS
    }

    /// A hypothesis fitted once more from where a better one came to, if that gives a better fit.
    ///
    /// Joints that stick here or there make the misfit jagged: of two fits that end a hair apart one may be ten nats higher, and one may stop on
    /// its way. That is no evidence for an effect. This one can be where the other is, at the price of the other's effects as strained numbers of
    /// the nominal model, and of those that it lacks as none, as far as the other's curvature tells. It is lost if it is farther behind; if it is
    /// hardly behind it may be as well, and the other's effects stay as it has them.
    pub(crate) fn fitted_as(&self, hypothesis: &Hypothesis, better: &Hypothesis) -> Result<Option<Hypothesis>> {
        let behind = better.evidence - hypothesis.evidence;
        let strain = |c: usize, h: &Hypothesis| 0.5 * self.over_prior_squared(c, better.u[c], &h.effects);
        let price: f64 = hypothesis.free.iter().map(|&c| strain(c, hypothesis) - strain(c, better)).sum();
        // How things stood as the recording began is nothing to go by.
        let is_lacking = |&k: &usize| !hypothesis.free.contains(&better.free[k]) && !self.scale(better.free[k]).is_state();
        let lacking: Vec<usize> = (0..better.free.len()).filter(is_lacking).collect();
        let is_lost = behind > price + self.nats_from_none(better, &lacking);
        if !is_lost && behind >= WITHIN_NATS {
            return Ok(None);
        }
        let takes = |effect: usize| is_lost || hypothesis.effects.contains(&effect) || !better.effects.contains(&effect);
        let taken = hypothesis.free.iter().filter(|&&c| takes(self.coordinates.all[c].effect));
        let mut start = hypothesis.u.clone();
        taken.for_each(|&c| start[c] = better.u[c]);
        let again = self.fit(&hypothesis.effects, &start, Some(better))?;
        Ok(again.filter(|again| again.evidence > hypothesis.evidence))
    }

    /// By how much some of a hypothesis' free coordinates are more probable where they are than at none, as far as its curvature tells [nat].
    fn nats_from_none(&self, hypothesis: &Hypothesis, some: &[usize]) -> f64 {
        let nowhere = self.nowhere();
        let off = DVector::from_iterator(some.len(), some.iter().map(|&k| hypothesis.free[k]).map(|c| hypothesis.u[c] - nowhere[c]));
        let covariance = hypothesis.covariance.select_rows(some).select_columns(some);
        covariance.cholesky().map_or(f64::INFINITY, |factor| 0.5 * off.dot(&factor.solve(&off)))
    }

    /// Fits the best candidates, and returns the best of them.
    pub(super) fn refitted(
        &self,
        outcome: &mut Outcome,
        candidates: Vec<Candidate>,
        count: &[usize; 2],
        like: &Hypothesis,
    ) -> Result<Option<Hypothesis>> {
        let [least, most] = *count;
        let from = outcome.best.clone();
        let mut fitted: Vec<Hypothesis> = Vec::new();
        let mut tried = 0;
        // The screen can promise too much: what counts is how far a promise is behind the best that was kept.
        for batch in candidates[..most.min(candidates.len())].chunks(AT_ONCE) {
            let best = fitted.iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence));
            let reached = best.map_or(f64::NEG_INFINITY, |best| best.evidence);
            let as_noise = WITHIN_NATS * best.map_or(1.0, |best| self.leftover(best).most());
            let is_near = |(k, c): &(usize, &Candidate)| {
                let hidden = if c.effects.len() < EFFECTS_MAX { as_noise } else { WITHIN_NATS };
                let within = if tried + k < DOUBTED { hidden.max(c.doubt) } else { WITHIN_NATS };
                tried + k < least || c.evidence > reached - within
            };
            let near = batch.iter().enumerate().take_while(is_near).count();
            let fit = |candidate: &Candidate| match outcome.known_from(candidate) {
                Some(known) => self.at_least(Some(known.clone()), candidate, &from),
                None => self.fitted_at_least(candidate, like, &from),
            };
            fitted.extend(side_by_side(&batch[..near], fit)?);
            batch[..near].iter().for_each(|candidate| outcome.remember(candidate));
            tried += near;
            if near < batch.len() {
                break;
            }
        }
        for hypothesis in &fitted {
            outcome.keep(hypothesis);
        }
        // What the screen thought less of is no better than the least of what was fitted.
        let least = fitted.iter().map(|h| h.evidence).fold(f64::INFINITY, f64::min);
        for candidate in candidates.into_iter().skip(tried) {
            let known = outcome.screened.get(&candidate.effects).copied().unwrap_or(f64::INFINITY);
            outcome.screened.insert(candidate.effects, candidate.evidence.min(least).min(known));
        }
        Ok(fitted.into_iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence)))
    }

    /// Fits a candidate. With one more effect than `from` it can do no worse: where it got lost on the way it starts again from there.
    pub(super) fn fitted_at_least(&self, candidate: &Candidate, like: &Hypothesis, from: &Hypothesis) -> Result<Option<Hypothesis>> {
        self.at_least(self.fit(&candidate.effects, &candidate.start, Some(like))?, candidate, from)
    }

    /// `first`, the fit of a candidate, or the one from `from` if it got lost.
    fn at_least(&self, first: Option<Hypothesis>, candidate: &Candidate, from: &Hypothesis) -> Result<Option<Hypothesis>> {
        let is_richer = from.effects.iter().all(|effect| candidate.effects.contains(effect));
        if !is_richer || first.as_ref().is_some_and(|h| !self.is_lost(h, from)) {
            return Ok(first);
        }
        let again = self.fit(&candidate.effects, &self.mildly(&candidate.effects, &from.u), Some(from))?;
        Ok([first, again].into_iter().flatten().max_by(|a, b| a.evidence.total_cmp(&b.evidence)))
    }

    /// A hypothesis without some of its effects, fitted: from its numbers, where what is known of it stopped before those. What the nominal model
    /// tolerates of the effects may be there still.
    pub(crate) fn rest(&self, outcome: &Outcome, whole: &Hypothesis, left_out: &[usize]) -> Result<Option<Hypothesis>> {
        let effects: Vec<usize> = whole.effects.iter().copied().filter(|effect| !left_out.contains(effect)).collect();
        let without = left_out.iter().fold(whole.u.clone(), |u, &effect| self.without(effect, &u));
        let mut tolerated = without.clone();
        self.free(&effects).into_iter().for_each(|c| tolerated[c] = whole.u[c]);
        let Some((cost, start)) = self.cheapest(&effects, vec![without, tolerated])? else { return Ok(None) };
        let known = outcome.fitted.get(&effects).map(|(known, _)| known);
        if known.is_some_and(|known| cost >= known.cost - LOST_NATS) {
            return Ok(known.cloned());
        }
        let again = self.fit(&effects, &start, Some(whole))?;
        Ok(again.into_iter().chain(known.cloned()).max_by(|a, b| a.evidence.total_cmp(&b.evidence)))
    }
}
