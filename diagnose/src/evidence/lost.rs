//! Fits that lost their way, begun again.
//!
//! The screen's slopes promise far too much of a joint that is held by friction, swings or floats in slack, and a fit that goes by them ends
//! far from the recordings; so does the nominal model's where a soft cable is within its tolerance. Where something remains, the best
//! hypothesis and the one without effects go on by slopes of rolled-out links. Where the best explains nothing, effects of that kind are
//! fitted again from the nominal model at several sizes, and so is a slack that leaves something: first all other numbers with these held, then
//! everything. A slack whose size is known begins by settled slopes as well: held, a large one can go astray.

use raven::Result;
use rayon::prelude::*;

use super::fit::{Fitter, Following, Hypothesis};
use super::leftover::ACCOUNTED;
use super::search::Outcome;

/// Effects that are fitted again: the best so far.
const AGAIN: usize = 2;
/// Starts of each: some, evenly spread over those of the screen.
const STARTS_MAX: usize = 3;
/// Starts of a slack that was found, as parts of its size.
const SLACKS: [f64; STARTS_MAX] = [0.6, 1.0, 1.7];
/// How many of these fits go on by slopes of rolled-out links.
const CLOSELY: usize = 2;

impl Fitter<'_> {
    /// Fits again what the search may have lost. Tells whether the best hypothesis is another one afterwards.
    pub(super) fn found_again(&self, outcome: &mut Outcome, nominal: &Hypothesis) -> Result<bool> {
        if !self.leftover(&outcome.best).remains() {
            return Ok(false);
        }
        if self.accounted(&outcome.none, &outcome.best) < ACCOUNTED {
            return self.at_several_sizes(outcome, nominal);
        }
        let mut other = self.closely(outcome, &[outcome.best.clone(), outcome.none.clone()])?;
        // What strains the nominal model may be an effect.
        let none = &outcome.none;
        if let Some(effect) = self.strained(none).into_iter().find(|&effect| self.followed(effect).is_some()) {
            let freed = Hypothesis { effects: vec![effect], ..none.clone() };
            other |= self.closely(outcome, &[freed])?;
        }
        if self.leftover(&outcome.best).remains() {
            let best = outcome.best.clone();
            let slack = |&effect: &usize| (effect, self.coordinates.of(effect).map(|c| best.u[c]).collect::<Vec<f64>>());
            let slacks = best.effects.iter().filter(|&&effect| self.is_loose(effect)).map(slack);
            let starts = slacks.flat_map(|(effect, u)| SLACKS.map(|part| (effect, u.iter().map(|u| part * u).collect())));
            other |= self.begun_again(outcome, nominal, &starts.collect::<Vec<_>>(), &[Following::Held, Following::Settled])?;
        }
        Ok(other)
    }

    /// Goes on with hypotheses by slopes of rolled-out links. Tells whether one of them is better than the best, which it then is.
    fn closely(&self, outcome: &mut Outcome, hypotheses: &[Hypothesis]) -> Result<bool> {
        let closely = |h: &Hypothesis| self.fit_with(&h.effects, &h.u, None, Following::RolledOut);
        let fitted: Result<Vec<Option<Hypothesis>>> = hypotheses.par_iter().map(closely).collect();
        let mut other = false;
        for hypothesis in fitted?.into_iter().flatten() {
            outcome.keep(&hypothesis);
            let is_better = if hypothesis.effects == outcome.best.effects {
                hypothesis.evidence > outcome.best.evidence
            } else {
                self.better(outcome, &hypothesis, &outcome.best)
            };
            if is_better {
                outcome.best = hypothesis;
                other = true;
            }
        }
        Ok(other)
    }

    /// Fits effects of how joints follow their cables from several sizes; as [`Self::closely`].
    fn at_several_sizes(&self, outcome: &mut Outcome, nominal: &Hypothesis) -> Result<bool> {
        let mut alone: Vec<(usize, f64)> = outcome
            .known()
            .filter_map(|(effects, evidence)| if let [effect] = effects[..] { Some((effect, evidence)) } else { None })
            .collect();
        alone.retain(|&(effect, _)| self.followed(effect).is_some());
        alone.sort_by(|a, b| b.1.total_cmp(&a.1));
        let of_effect = |&(effect, _): &(usize, f64)| {
            let starts = self.starts(effect, &nominal.u);
            let (last, count) = (starts.len().saturating_sub(1), starts.len().min(STARTS_MAX));
            (0..count).map(|k| (effect, starts[k * last / (count - 1).max(1)].clone())).collect::<Vec<_>>()
        };
        let starts: Vec<_> = alone.iter().take(AGAIN).flat_map(of_effect).collect();
        self.begun_again(outcome, nominal, &starts, &[Following::Held])
    }

    /// Fits single effects from the nominal model and these numbers of theirs in several ways; as [`Self::closely`].
    fn begun_again(&self, outcome: &mut Outcome, nominal: &Hypothesis, starts: &[(usize, Vec<f64>)], ways: &[Following]) -> Result<bool> {
        let fitted = |(effect, start): &(usize, Vec<f64>)| {
            let mut u = nominal.u.clone();
            self.coordinates.of(*effect).zip(start).for_each(|(c, value)| u[c] = *value);
            let fits = ways.iter().map(|&following| self.fit_with(&[*effect], &u, Some(nominal), following));
            fits.collect::<Result<Vec<Option<Hypothesis>>>>()
        };
        let fitted: Result<Vec<Vec<Option<Hypothesis>>>> = starts.par_iter().map(fitted).collect();
        let mut fitted: Vec<Hypothesis> = fitted?.into_iter().flatten().flatten().collect();
        fitted.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        fitted.truncate(CLOSELY);
        self.closely(outcome, &fitted)
    }
}
