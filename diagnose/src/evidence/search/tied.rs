//! Effects that the library ties to those that were found, or that alone explain about as much, each held against what it could stand in for.
//!
//! A search goes on with what explains most alone; what is behind it there may be ahead of it beside another effect. And it drops what the
//! screen sees behind. Where a misfit is large the screen's differences are, too, and what is hardly behind once the misfit counts as noise was
//! never fitted: a tie would go unsaid, and one of two be named with a probability that both share.

use raven::Result;
use raven::effects::Sited;

use super::refit::LOST_NATS;
use super::screen::Candidate;
use super::{HOPE_NATS, WITHIN_NATS};
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::outcome::Outcome;

/// Evidence within which two causes are tied, what the best hypothesis leaves counting as noise [nat].
pub const TIED_NATS: f64 = 3.0;
/// The screen from where an effect was fitted may see another one this far behind it that does as well [nat].
const DOUBT_NATS: f64 = 10.0;
/// A tie that was fitted is fitted on if it explains so much of what the effect does: of what much is explained of it may have stopped far behind.
const AS_MUCH: f64 = 0.5;
/// So many of those that alone explain about as much as an effect are held against it beside others.
const AS_GOOD_ALONE: usize = 3;

/// Whether an effect is among some, or one that no recording of motors and tip can tell from it: beside those it would be named twice.
#[must_use]
pub fn has(sited: &[Sited], effects: &[usize], effect: usize) -> bool {
    effects.iter().any(|&other| other == effect || sited[effect].is_exactly(&sited[other]))
}

/// An effect in the place of one of a hypothesis.
#[derive(Debug, Clone, Copy)]
struct Swap {
    effect: usize,
    other: usize,
}

impl Swap {
    /// The hypothesis' effects then, in rising order.
    fn in_effects_of(self, hypothesis: &Hypothesis) -> Vec<usize> {
        let mut effects: Vec<usize> = hypothesis.all_but(self.effect).into_iter().chain([self.other]).collect();
        effects.sort_unstable();
        effects
    }
}

impl Fitter<'_> {
    /// Fits what the library ties to an effect of the best hypothesis in that effect's place, where the screen does not rule it out, and what
    /// is left of those that are tied without any one of their effects: either may come first in the end.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(crate) fn hold_against_ties(&self, outcome: &mut Outcome) -> Result<()> {
        let best = outcome.best.clone();
        // Differences of evidence shrink by so much when what is left counts as noise.
        let shrink = self.leftover(&best).most();
        let rest_of = |&effect: &usize| Ok(self.rest(outcome, &best, &[effect])?.map(|rest| (effect, rest)));
        let rests: Vec<(usize, Hypothesis)> = side_by_side(&best.effects, rest_of)?;
        rests.iter().for_each(|(_, rest)| outcome.keep(rest));
        let at_place = |(effect, _): &(usize, Hypothesis)| {
            let (effect, ties) = (*effect, self.ties_of(&best, *effect));
            ties.into_iter().map(move |other| Swap { effect, other })
        };
        let ties: Vec<Swap> = rests.iter().flat_map(at_place).collect();
        self.fit_likely(outcome, &best, &rests, &ties, shrink)?;
        // What was fitted may have stopped on its way, behind what is the same.
        let behind = |swap: &Swap| {
            let rest = rests.iter().find(|(effect, _)| *effect == swap.effect).map(|(_, rest)| rest)?;
            let within = WITHIN_NATS.max(AS_MUCH * (best.evidence - rest.evidence));
            let known = outcome.fitted.get(&swap.in_effects_of(&best)).map(|(known, _)| known);
            let known = known.filter(|known| known.evidence < best.evidence && known.evidence > best.evidence - within);
            Some((*swap, known?.u.clone()))
        };
        self.fit_from_best(outcome, &best, &ties.iter().filter_map(behind).collect::<Vec<_>>())?;
        let as_good_alone: Vec<(Swap, Vec<f64>)> =
            rests.iter().flat_map(|(effect, _)| self.as_good_alone(outcome, &best, *effect)).collect();
        let is_unfitted = |(swap, _): &&(Swap, Vec<f64>)| !outcome.fitted.contains_key(&swap.in_effects_of(&best));
        self.fit_from_best(outcome, &best, &as_good_alone.iter().filter(is_unfitted).cloned().collect::<Vec<_>>())?;
        for swap in ties.iter().chain(as_good_alone.iter().map(|(swap, _)| swap)) {
            let tied = outcome.fitted.get(&swap.in_effects_of(&best)).map(|(hypothesis, _)| hypothesis.clone());
            let Some(tied) = tied.filter(|tied| tied.evidence > best.evidence - TIED_NATS * shrink) else { continue };
            let rests = side_by_side(&tied.effects, |&left_out| self.rest(outcome, &tied, &[left_out]))?;
            rests.iter().for_each(|rest| outcome.keep(rest));
            if self.better(outcome, &tied, &outcome.best) {
                outcome.best = tied;
            }
        }
        self.fitted_on(outcome, &best, &rests)
    }

    /// Fits what was the best hypothesis once more from the numbers of what is left without one of its effects, if it is better there: a tie may have led
    /// these farther, by numbers that all have, and what stopped short of them is not less probable for that.
    fn fitted_on(&self, outcome: &mut Outcome, best: &Hypothesis, rests: &[(usize, Hypothesis)]) -> Result<()> {
        let rests = rests.iter().filter_map(|(_, rest)| outcome.fitted.get(&rest.effects)).map(|(rest, _)| rest);
        let starts = rests.flat_map(|rest| [self.mildly(&best.effects, &rest.u), self.taking(&rest.u, &best.effects, &best.u)]);
        let nearest = self.cheapest(&best.effects, starts.collect())?.filter(|(cost, _)| *cost < best.cost - LOST_NATS);
        let Some((_, start)) = nearest else { return Ok(()) };
        let Some(again) = self.fit(&best.effects, &start, Some(best))? else { return Ok(()) };
        outcome.keep(&again);
        if self.better(outcome, &again, &outcome.best) {
            outcome.best = again;
        }
        Ok(())
    }

    /// Fits those of some ties that have not been fitted and may do as well, where `rests` are what is left of the best without each effect.
    fn fit_likely(
        &self,
        outcome: &mut Outcome,
        best: &Hypothesis,
        rests: &[(usize, Hypothesis)],
        ties: &[Swap],
        shrink: f64,
    ) -> Result<()> {
        let likely = side_by_side(rests, |(effect, rest)| {
            let unfitted = |swap: &&Swap| swap.effect == *effect && !outcome.fitted.contains_key(&swap.in_effects_of(best));
            let unfitted: Vec<usize> = ties.iter().filter(unfitted).map(|swap| swap.other).collect();
            self.likely_ties(best, *effect, rest, &unfitted, shrink).map(Some)
        })?;
        let likely: Vec<(Candidate, &Hypothesis)> = likely.into_iter().flatten().collect();
        let fitted = side_by_side(&likely, |(candidate, like)| self.fit(&candidate.effects, &candidate.start, Some(like)))?;
        fitted.iter().for_each(|hypothesis| outcome.keep(hypothesis));
        Ok(())
    }

    /// Fits the best hypothesis with another effect in the place of one, each from the best's numbers and the other's own in some `u`.
    fn fit_from_best(&self, outcome: &mut Outcome, best: &Hypothesis, swaps: &[(Swap, Vec<f64>)]) -> Result<()> {
        let fit = |(swap, own): &(Swap, Vec<f64>)| {
            let start = self.taking(&self.without(swap.effect, &best.u), &[swap.other], own);
            self.fit(&swap.in_effects_of(best), &start, Some(best))
        };
        side_by_side(swaps, fit)?.iter().for_each(|hypothesis| outcome.keep(hypothesis));
        Ok(())
    }

    /// Which of some effects may do as well as one of a hypothesis: those that the screen does not see far behind it from the `rest` without it, or from
    /// where the hypothesis is, as numbers that make up for an effect are a bad place to look from. Each with what it is to be fitted like.
    fn likely_ties<'a>(
        &self,
        best: &'a Hypothesis,
        effect: usize,
        rest: &'a Hypothesis,
        others: &[usize],
        shrink: f64,
    ) -> Result<Vec<(Candidate, &'a Hypothesis)>> {
        if others.is_empty() {
            return Ok(Vec::new());
        }
        let mut likely = self.screen_some(rest, rest.evidence, others)?;
        likely.retain(|candidate| candidate.evidence > best.evidence - (TIED_NATS + HOPE_NATS) * shrink);
        let mut likely: Vec<(Candidate, &Hypothesis)> = likely.into_iter().map(|candidate| (candidate, rest)).collect();
        let Some(there) = self.at(&rest.effects, self.without(effect, &best.u))? else { return Ok(likely) };
        let seen = self.screen_some(&there, rest.evidence, &[others, &[effect]].concat())?;
        let own = seen.iter().find(|candidate| candidate.effects == best.effects).map_or(f64::INFINITY, |own| own.evidence);
        let near = |c: &Candidate| c.effects != best.effects && c.evidence > own - DOUBT_NATS * shrink;
        for candidate in seen.into_iter().filter(near) {
            if likely.iter().all(|(other, _)| other.effects != candidate.effects) {
                likely.push((candidate, best));
            }
        }
        Ok(likely)
    }

    /// Effects that alone are hardly behind one of a hypothesis alone, the best first, in that one's place, each with where it is alone. None
    /// where there is no other beside it.
    fn as_good_alone(&self, outcome: &Outcome, hypothesis: &Hypothesis, effect: usize) -> Vec<(Swap, Vec<f64>)> {
        let alone = |effect: usize| outcome.fitted.get(&vec![effect]).map(|(alone, _)| alone);
        let Some(least) = alone(effect).map(|alone| (alone.evidence - WITHIN_NATS).max(outcome.none.evidence + HOPE_NATS)) else {
            return Vec::new();
        };
        let can_replace = |other: &usize| hypothesis.effects.len() > 1 && self.can_replace(hypothesis, effect, *other);
        let others = self.alike(effect).into_iter().filter(can_replace);
        let mut others: Vec<(usize, &Hypothesis)> = others.filter_map(|other| Some((other, alone(other)?))).collect();
        others.retain(|(_, alone)| alone.evidence > least);
        others.sort_by(|(_, a), (_, b)| b.evidence.total_cmp(&a.evidence));
        others.truncate(AS_GOOD_ALONE);
        others.into_iter().map(|(other, alone)| (Swap { effect, other }, alone.u.clone())).collect()
    }

    /// What the library ties to an effect of a hypothesis, at the places where it shows.
    fn ties_of(&self, hypothesis: &Hypothesis, effect: usize) -> Vec<usize> {
        let is_tied = |other: &usize| {
            self.coordinates.can_be_named(*other) && self.are_tied(effect, *other) && self.can_replace(hypothesis, effect, *other)
        };
        (0..self.coordinates.sited.len()).filter(is_tied).collect()
    }

    /// Whether another effect can stand in for one of a hypothesis, which holds nothing else that is the same.
    pub(super) fn can_replace(&self, hypothesis: &Hypothesis, effect: usize, other: usize) -> bool {
        other != effect && !has(&self.coordinates.sited, &hypothesis.all_but(effect), other)
    }

    /// Whether the library ties an effect to another one that shows where it does.
    pub(crate) fn are_tied(&self, effect: usize, other: usize) -> bool {
        let sited = &self.coordinates.sited;
        let names = |one: usize, another: usize| sited[one].effect.ties.iter().any(|tie| tie.id == sited[another].effect.id);
        (names(effect, other) || names(other, effect)) && sited[other].shows_where(&sited[effect])
    }
}
