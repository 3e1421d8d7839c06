//! Which effects: the hypothesis with the highest evidence, found one effect at a time.
//!
//! Every hypothesis is the nominal model with each of its numbers off by its tolerance, and some effects at their own, wide priors. A number
//! of the nominal model that becomes an effect changes its spike for a slab. Each round screens the whole library, refits the best, and
//! then opens what it has again: every effect may be left out, or be another one.

mod again;
mod close;
mod lost;
mod points;
mod refit;
mod resized;
mod rivals;
mod same;
pub mod screen;
mod starts;
pub mod tied;
pub mod told;

use raven::Result;

use crate::evidence::fit::{Fitter, Hypothesis, STRAINED, side_by_side};
use crate::evidence::outcome::Outcome;
use crate::evidence::weighing::leftover::ACCOUNTED;
use screen::Candidate;

/// Most effects.
pub const EFFECTS_MAX: usize = 3;
/// Most times that an effect is added: more than effects, as what was added may be left out again.
const ROUNDS_MAX: usize = 5;
/// Part of a misfit that the first effect accounts for at least, where others are looked for beside it though very much is left: half of a third.
const ACCOUNTED_BY_ONE: f64 = 1.0 / 6.0;
/// Candidates that are refitted: those whose evidence by screen is within so much of the best that was, at least, at most.
pub(super) const WITHIN_NATS: f64 = 25.0;
pub(super) const REFITTED: [usize; 2] = [2, 8];
/// As many where an effect is replaced.
const REPLACEMENTS: [usize; 2] = [0, 3];
/// A candidate is worth a fit if the screen does not see it this far behind what has to be beaten [nat]: the screen errs on either side.
pub(super) const HOPE_NATS: f64 = 2.0;

impl Fitter<'_> {
    /// Looks for the most probable hypothesis; `None` where not even the nominal model can be evaluated. `each` hears of every step.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn search(&self, mut each: impl FnMut()) -> Result<Option<Outcome>> {
        let Some((nominal, mut outcome)) = self.begun()? else { return Ok(None) };
        each();
        self.add_and_shed(&mut outcome, &nominal, &mut each)?;
        if self.found_again(&mut outcome, &nominal)? && !self.leaves_most(&outcome) {
            self.add_and_shed(&mut outcome, &nominal, each)?;
        }
        self.decide(&mut outcome)?;
        Ok(Some(outcome))
    }

    /// The nominal model as it is, and fitted within its tolerances.
    pub(super) fn begun(&self) -> Result<Option<(Hypothesis, Outcome)>> {
        let Some(nominal) = self.at_nominal()? else { return Ok(None) };
        let Some(none) = self.fit(&[], &nominal.u, None)? else { return Ok(None) };
        let outcome = Outcome::begun(none, self.coordinates.sited.len());
        Ok(Some((nominal, outcome)))
    }

    /// Adds effects to the best hypothesis, one at a time, as long as that makes it more probable.
    fn add_effects(&self, outcome: &mut Outcome, nominal: &Hypothesis, mut each: impl FnMut()) -> Result<()> {
        for _ in 0..ROUNDS_MAX {
            let round = outcome.best.effects.len() + 1;
            let is_in_vain = match round {
                // Of what three equal effects cause two account for two thirds, and of others for more.
                EFFECTS_MAX => self.explains_little(outcome) || self.were_beyond_effects(outcome),
                2 => self.explains_nothing(outcome),
                _ => round > EFFECTS_MAX,
            };
            if is_in_vain {
                break;
            }
            // Numbers of the nominal model that made up for a large effect are a bad place to look from.
            let point = if round == 1 { nominal.clone() } else { outcome.best.clone() };
            let mut candidates = self.screen(&point, outcome.best.evidence)?;
            candidates.retain(|candidate| !outcome.shed.contains(&candidate.effects));
            if round > 1 {
                outcome.screens.insert(point.effects.clone(), candidates.clone());
            }
            let hopeful = |c: &&Candidate| c.evidence > outcome.best.evidence + HOPE_NATS;
            let least = if round == 1 { REFITTED[0] } else { 0 };
            let count = [least, candidates.iter().filter(hopeful).count().clamp(least, REFITTED[1])];
            let Some(mut best) = self.refitted(outcome, candidates, &count, &point)? else { break };
            let again = self.fitted_as(&outcome.best, &best)?;
            let is_elsewhere = again.as_ref().is_some_and(|again| again.evidence > outcome.best.evidence + HOPE_NATS);
            if let Some(again) = again {
                outcome.keep(&again);
                outcome.best = again;
            }
            if round == 1 {
                best = self.freed(outcome, best)?;
                if !self.leftover(&outcome.none).remains() {
                    best = self.beside_none(outcome, best)?;
                }
                best = self.followed_closely(outcome, best)?;
                best = self.resized(outcome, nominal, best)?;
            }
            each();
            // What is lost in scatter will not be named, whatever stands in for the others.
            if round > 1 && self.better(outcome, &best, &outcome.best) && self.lost_in_scatter(outcome, &best).is_none() {
                best = self.reopened(outcome, best)?;
                each();
            }
            // Where the best hypothesis has been fitted again, what the screen said of others beside it no longer holds.
            if self.better(outcome, &best, &outcome.best) {
                outcome.best = best;
            } else if round == 1 || !is_elsewhere {
                break;
            }
        }
        Ok(())
    }

    /// Adds effects to the best hypothesis, and to what is left of it without those that are lost in scatter. Where even with them most of a
    /// misfit remained, others will not account for it.
    pub(super) fn add_and_shed(&self, outcome: &mut Outcome, nominal: &Hypothesis, mut each: impl FnMut()) -> Result<()> {
        self.add_effects(outcome, nominal, &mut each)?;
        let added = outcome.best.effects.len();
        let explains_little = self.explains_little(outcome);
        while let Some(lost) = self.lost_in_scatter(outcome, &outcome.best).filter(|_| outcome.best.effects.len() > 1) {
            let best = outcome.best.clone();
            let Some(rest) = self.fit(&best.all_but(lost), &self.without(lost, &best.u), Some(&best))? else { break };
            outcome.keep(&rest);
            outcome.shed.insert(best.effects);
            outcome.best = outcome.fitted.get(&rest.effects).map_or(rest, |(known, _)| known.clone());
        }
        if outcome.best.effects.len() < added && !explains_little { self.add_effects(outcome, nominal, each) } else { Ok(()) }
    }

    /// Whether the best hypothesis leaves something, and more of the misfit than it accounts for.
    pub(super) fn explains_little(&self, outcome: &Outcome) -> bool {
        self.leftover(&outcome.best).remains() && self.accounted(&outcome.none, &outcome.best) < ACCOUNTED
    }

    /// Whether one effect leaves very much and accounts for hardly any of it: of what three equal effects cause it would be a third.
    fn explains_nothing(&self, outcome: &Outcome) -> bool {
        self.leaves_much(outcome) && self.accounted(&outcome.none, &outcome.best) < ACCOUNTED_BY_ONE
    }

    /// Whether as many effects as there may be were fitted before, and the best of those leave something: they are not looked for twice.
    fn were_beyond_effects(&self, outcome: &Outcome) -> bool {
        let best = outcome.fitted.values().map(|(h, _)| h).filter(|h| h.effects.len() == EFFECTS_MAX);
        best.max_by(|a, b| a.evidence.total_cmp(&b.evidence)).is_some_and(|best| self.is_beyond_effects(best))
    }

    /// Looks closely at what is likely, and weighs all of it.
    pub(super) fn decide(&self, outcome: &mut Outcome) -> Result<()> {
        if !self.leaves_most(outcome) {
            self.look_closely(outcome)?;
            if outcome.compared.as_ref() != Some(&outcome.best.effects) {
                self.hold_against_ties(outcome)?;
                if !self.leaves_much(outcome) && !self.is_beyond_effects(&outcome.best) {
                    self.hold_against_rivals(outcome)?;
                }
                outcome.compared = Some(outcome.best.effects.clone());
            }
        }
        self.temper(outcome);
        Ok(())
    }

    /// Whether as many effects as there may be leave something: each is one in five then, whichever of its rivals it is.
    fn is_beyond_effects(&self, hypothesis: &Hypothesis) -> bool {
        hypothesis.effects.len() == EFFECTS_MAX && self.leftover(hypothesis).remains()
    }

    /// Whether the best hypothesis explains little and leaves very much.
    pub(super) fn leaves_most(&self, outcome: &Outcome) -> bool {
        self.explains_little(outcome) && self.leaves_much(outcome)
    }

    /// Whether the best hypothesis leaves so much that what a closer look is worth is less than a nat: it decides nothing.
    pub(super) fn leaves_much(&self, outcome: &Outcome) -> bool {
        self.leftover(&outcome.best).most() > WITHIN_NATS
    }

    /// The better of `best` and of effects that the fitted nominal model has as strained numbers.
    fn freed(&self, outcome: &mut Outcome, best: Hypothesis) -> Result<Hypothesis> {
        let none = outcome.none.clone();
        let mut strained = self.strained(&none);
        strained.retain(|&effect| !outcome.fitted.contains_key(&vec![effect]));
        strained.truncate(REPLACEMENTS[1]);
        let fitted = side_by_side(&strained, |&effect| self.fit(&[effect], &none.u, Some(&none)))?;
        fitted.iter().for_each(|hypothesis| outcome.keep(hypothesis));
        Ok(fitted.into_iter().chain([best]).max_by(|a, b| a.evidence.total_cmp(&b.evidence)).unwrap_or(none))
    }

    /// Effects whose numbers strain the tolerances of the nominal model in a hypothesis without them, most strained first.
    pub(super) fn strained(&self, hypothesis: &Hypothesis) -> Vec<usize> {
        let strain = |effect: usize| self.coordinates.of(effect).map(|c| self.strain(c, &hypothesis.u)).fold(0.0, f64::max);
        let others = (0..self.coordinates.sited.len()).filter(|effect| !hypothesis.effects.contains(effect));
        let mut strained: Vec<(usize, f64)> = others.map(|effect| (effect, strain(effect))).filter(|(_, s)| *s > STRAINED).collect();
        strained.sort_by(|a, b| b.1.total_cmp(&a.1));
        strained.into_iter().map(|(effect, _)| effect).collect()
    }

    /// The better of `best` and of what is found from the fitted nominal model: where that leaves little, an effect is small, and slopes there
    /// promise what they can keep.
    fn beside_none(&self, outcome: &mut Outcome, best: Hypothesis) -> Result<Hypothesis> {
        let none = outcome.none.clone();
        let mut hopeful = self.screen(&none, none.evidence)?;
        let lost = |(h, _): &(Hypothesis, f64)| self.is_lost(h, &none);
        hopeful.retain(|c| c.evidence > none.evidence + HOPE_NATS && outcome.fitted.get(&c.effects).is_none_or(lost));
        let other = self.refitted(outcome, hopeful, &REPLACEMENTS, &none)?;
        Ok(other.filter(|other| other.evidence > best.evidence).unwrap_or(best))
    }

    /// Effects that could stand in for one.
    pub(super) fn alike(&self, effect: usize) -> Vec<usize> {
        let sited = &self.coordinates.sited;
        (0..sited.len()).filter(|&other| other != effect && sited[effect].shows_where(&sited[other])).collect()
    }

    /// The best hypothesis that differs from `best` by one effect, as long as that is better.
    fn reopened(&self, outcome: &mut Outcome, mut best: Hypothesis) -> Result<Hypothesis> {
        for _ in 0..EFFECTS_MAX {
            let mut better: Option<Hypothesis> = None;
            let rest_of = |&left_out: &usize| {
                let Some(rest) = self.rest(outcome, &best, &[left_out])? else { return Ok(None) };
                Ok(Some((left_out, self.fitted_as(&rest, &best)?.unwrap_or(rest))))
            };
            for (left_out, rest) in side_by_side(&best.effects, rest_of)? {
                outcome.keep(&rest);
                let screened = match outcome.screens.get(&rest.effects) {
                    Some(whole) => whole.clone(),
                    None => self.screen_some(&rest, rest.evidence, &self.alike(left_out))?,
                };
                let hopeful = |c: &Candidate| c.evidence > best.evidence - HOPE_NATS && !outcome.fitted.contains_key(&c.effects);
                let candidates = screened.into_iter().filter(hopeful).collect();
                let replaced = self.refitted(outcome, candidates, &REPLACEMENTS, &rest)?;
                for hypothesis in [Some(rest), replaced].into_iter().flatten() {
                    if self.better(outcome, &hypothesis, better.as_ref().unwrap_or(&best)) {
                        better = Some(hypothesis);
                    }
                }
            }
            match better {
                Some(better) => best = better,
                None => break,
            }
        }
        Ok(best)
    }
}
