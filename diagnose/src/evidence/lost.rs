//! Fits that lost their way, begun again.
//!
//! The screen's slopes promise far too much of a joint that is held by friction, swings or floats in slack, and a fit that begins where
//! they lead ends far from the recordings. Where the best hypothesis explains nothing, effects of that kind are fitted again from the
//! nominal model at several sizes: first all other numbers with these held, then from the best of that everything.

use raven::Result;
use rayon::prelude::*;

use super::fit::{Fitter, Following, Hypothesis};
use super::leftover::{ACCOUNTED, Leftover};
use super::search::Outcome;

/// Effects that are fitted again: the best so far.
const AGAIN: usize = 2;
/// Starts of each: some, evenly spread over those of the screen.
const STARTS_MAX: usize = 3;
/// How many of these fits go on by slopes of rolled-out links.
const CLOSELY: usize = 2;

impl Fitter<'_> {
    /// Fits effects again that the search may have lost. Tells whether one of them alone is better than the best hypothesis, which it then
    /// is itself.
    pub(super) fn found_again(&self, outcome: &mut Outcome, nominal: &Hypothesis) -> Result<bool> {
        let remains = Leftover::of(&outcome.best.residuals, self.rows.tip_rows()).remains();
        if !remains || self.accounted(&outcome.none, &outcome.best) > ACCOUNTED {
            return Ok(false);
        }
        let mut alone: Vec<(usize, f64)> = outcome
            .known()
            .filter_map(|(effects, evidence)| if let [effect] = effects[..] { Some((effect, evidence)) } else { None })
            .collect();
        alone.retain(|&(effect, _)| self.followed(effect).is_some());
        alone.sort_by(|a, b| b.1.total_cmp(&a.1));
        let of_effect = |&(effect, _): &(usize, f64)| {
            let starts = self.starts(effect, &nominal.u);
            let each = starts.len().div_ceil(STARTS_MAX);
            starts.into_iter().step_by(each.max(1)).map(move |start| (effect, start))
        };
        let starts: Vec<(usize, Vec<f64>)> = alone.iter().take(AGAIN).flat_map(of_effect).collect();
        let held = |(effect, start): &(usize, Vec<f64>)| {
            let mut u = nominal.u.clone();
            self.coordinates.of(*effect).zip(start).for_each(|(c, value)| u[c] = *value);
            self.fit_with(&[*effect], &u, Some(nominal), Following::Held)
        };
        let held: Result<Vec<Option<Hypothesis>>> = starts.par_iter().map(held).collect();
        let mut held: Vec<Hypothesis> = held?.into_iter().flatten().collect();
        held.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let near = |h: &Hypothesis| self.fit_with(&h.effects, &h.u, None, Following::RolledOut);
        let again: Result<Vec<Option<Hypothesis>>> = held[..CLOSELY.min(held.len())].par_iter().map(near).collect();
        let again: Vec<Hypothesis> = again?.into_iter().flatten().collect();
        again.iter().for_each(|hypothesis| outcome.keep(hypothesis));
        let Some(best) = again.into_iter().max_by(|a, b| a.evidence.total_cmp(&b.evidence)) else { return Ok(false) };
        let better = self.better(outcome, &best, &outcome.best);
        if better {
            outcome.best = best;
        }
        Ok(better)
    }
}
