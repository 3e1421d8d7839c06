//! Which effects: the hypothesis with the highest evidence, found one effect at a time.
//!
//! Every hypothesis is the nominal model with each of its numbers off by its tolerance, and some effects at their own, wide priors. A number
//! of the nominal model that becomes an effect changes its spike for a slab. Each round screens the whole library, refits the best, and
//! then opens what it has again: every effect may be left out, or be another one.

use nalgebra::DVector;
use raven::Result;

use super::coordinates::{ABSENT, MILDEST};
use super::fit::{Fitter, Hypothesis, STRAINED, cost, side_by_side};
use super::leftover::ACCOUNTED;
use super::outcome::Outcome;
use super::rows::Links;
use super::screen::Candidate;

/// Most effects.
pub const EFFECTS_MAX: usize = 3;
/// Most times that an effect is added: more than effects, as what was added may be left out again.
const ROUNDS_MAX: usize = 5;
/// Part of a misfit that the first effect accounts for at least, where others are looked for beside it though very much is left: half of a third.
const ACCOUNTED_BY_ONE: f64 = 1.0 / 6.0;
/// Candidates that are refitted: those whose evidence by screen is within so much of the best that was, at least, at most.
pub(super) const WITHIN_NATS: f64 = 25.0;
pub(super) const REFITTED: [usize; 2] = [2, 8];
/// The first so many are, too, if they are no farther behind than slopes were wrong by at the point they were looked at from, or if they would not
/// be were what the best leaves noise: a joint's zero that is degrees off bends what slopes say of everything, and so does a second effect. What
/// is beside two is as many as there may be, and the screen is believed.
const DOUBTED: usize = 4;
/// As many where an effect is replaced.
const REPLACEMENTS: [usize; 2] = [0, 3];
/// So many of either are fitted at a time, before the next are held against them: on every machine, or verdicts would depend on its processors.
const AT_ONCE: usize = 2;
/// A candidate is worth a fit if the screen does not see it this far behind what has to be beaten [nat]: the screen errs on either side.
pub(super) const HOPE_NATS: f64 = 2.0;

impl Fitter<'_> {
    /// `u` of the nominal model.
    #[must_use]
    pub fn nowhere(&self) -> Vec<f64> {
        let shape_alone = |c: usize| {
            let coordinate = self.coordinates.all[c];
            let parameters = self.coordinates.sited[coordinate.effect].effect.parameters;
            parameters.len() == 1 && parameters[0].scale.is_shape()
        };
        (0..self.coordinates.all.len()).map(|c| if shape_alone(c) { ABSENT } else { 0.0 }).collect()
    }

    /// `u` of the nominal model with the effects of a hypothesis and nothing else.
    #[must_use]
    pub fn effects_alone(&self, hypothesis: &Hypothesis) -> Vec<f64> {
        self.taking(&self.nowhere(), &hypothesis.effects, &hypothesis.u)
    }

    /// `u` with some effects' numbers from elsewhere.
    pub(super) fn taking(&self, u: &[f64], effects: &[usize], from: &[f64]) -> Vec<f64> {
        let mut taking = u.to_vec();
        effects.iter().flat_map(|&effect| self.coordinates.of(effect)).for_each(|c| taking[c] = from[c]);
        taking
    }

    /// `u` with other numbers of one effect.
    pub(super) fn placing(&self, u: &[f64], effect: usize, numbers: &[f64]) -> Vec<f64> {
        let mut placing = u.to_vec();
        self.coordinates.of(effect).zip(numbers).for_each(|(c, &number)| placing[c] = number);
        placing
    }

    /// `u` where effects that have nothing but a shape and are not there are there as mildly as they can be.
    pub(super) fn mildly(&self, effects: &[usize], u: &[f64]) -> Vec<f64> {
        let mut mildly = u.to_vec();
        effects.iter().flat_map(|&effect| self.coordinates.of(effect)).filter(|&c| u[c] == ABSENT).for_each(|c| mildly[c] = MILDEST);
        mildly
    }

    /// `u` where one effect is as the nominal model has it.
    pub(super) fn without(&self, effect: usize, u: &[f64]) -> Vec<f64> {
        self.taking(u, &[effect], &self.nowhere())
    }

    /// Looks for the most probable hypothesis; `None` where not even the nominal model can be evaluated. `each` hears of every step.
    ///
    /// # Errors
    /// If the robot is no arm.
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
            // Of what three equal effects cause two account for two thirds, and of others for more.
            if round > EFFECTS_MAX || round == EFFECTS_MAX && self.explains_little(outcome) || round == 2 && self.explains_nothing(outcome)
            {
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

    /// Looks closely at what is likely, and weighs all of it.
    pub(super) fn decide(&self, outcome: &mut Outcome) -> Result<()> {
        if !self.leaves_most(outcome) {
            self.look_closely(outcome)?;
            if outcome.compared.as_ref() != Some(&outcome.best.effects) {
                self.hold_against_ties(outcome)?;
                if !self.leaves_much(outcome) && !self.is_beyond_effects(outcome) {
                    self.hold_against_rivals(outcome)?;
                }
                outcome.compared = Some(outcome.best.effects.clone());
            }
        }
        self.temper(outcome);
        self.hold_against_less(outcome)
    }

    /// Whether as many effects as there may be leave something: each is one in five then, whichever of its rivals it is.
    fn is_beyond_effects(&self, outcome: &Outcome) -> bool {
        outcome.best.effects.len() == EFFECTS_MAX && self.leftover(&outcome.best).remains()
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

    /// A hypothesis fitted once more from where a better one came to, if that gives a better fit.
    ///
    /// Joints that stick here or there make the misfit jagged: of two fits that end a hair apart one may be ten nats higher, and one may stop on
    /// its way. That is no evidence for an effect. This one can be where the other is, at the price of the other's effects as strained numbers of
    /// the nominal model, and of those that it lacks as none, as far as the other's curvature tells. It is lost if it is farther behind; if it is
    /// hardly behind it may be as well, and the other's effects stay as it has them.
    pub(super) fn fitted_as(&self, hypothesis: &Hypothesis, better: &Hypothesis) -> Result<Option<Hypothesis>> {
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

    /// The nominal model with its slopes, nothing fitted.
    pub fn at_nominal(&self) -> Result<Option<Hypothesis>> {
        self.at(&[], self.nowhere())
    }

    /// Effects and numbers with their slopes, nothing fitted; `None` where the model cannot be evaluated.
    pub(super) fn at(&self, effects: &[usize], u: Vec<f64>) -> Result<Option<Hypothesis>> {
        let residuals = self.exact(&u)?;
        let free = self.free(effects);
        let columns = self.slopes(&u, &free, Links::Settled)?;
        let finite = residuals.iter().chain(columns.iter().flat_map(|column| column.iter())).all(|v| v.is_finite());
        let covariance = nalgebra::DMatrix::zeros(free.len(), free.len());
        let cost = cost(&free, &self.precision(&free, effects), &u, &residuals);
        let effects = effects.to_vec();
        let evidence = f64::NEG_INFINITY;
        Ok(finite.then_some(Hypothesis { effects, u, free, covariance, cost, evidence, is_close: false, residuals, columns }))
    }

    /// Fits the best candidates, and returns the best of them.
    fn refitted(
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

    /// Effects that could stand in for one.
    pub(super) fn alike(&self, effect: usize) -> Vec<usize> {
        let sited = &self.coordinates.sited;
        (0..sited.len()).filter(|&other| other != effect && sited[effect].shows_where(&sited[other])).collect()
    }

    /// A hypothesis without some of its effects, fitted: from its numbers, where what is known of it stopped before those. What the nominal model
    /// tolerates of the effects may be there still.
    pub(super) fn rest(&self, outcome: &Outcome, whole: &Hypothesis, left_out: &[usize]) -> Result<Option<Hypothesis>> {
        let effects: Vec<usize> = whole.effects.iter().copied().filter(|effect| !left_out.contains(effect)).collect();
        let without = left_out.iter().fold(whole.u.clone(), |u, &effect| self.without(effect, &u));
        let mut tolerated = without.clone();
        self.free(&effects).into_iter().for_each(|c| tolerated[c] = whole.u[c]);
        let from = if tolerated != without && self.cost_at(&effects, &tolerated)? < self.cost_at(&effects, &without)? {
            tolerated
        } else {
            without
        };
        let known = outcome.fitted.get(&effects).map(|(known, _)| known);
        let start = match known {
            Some(known) => self.cheaper(known, from)?,
            None => Some(from),
        };
        let Some(start) = start else { return Ok(known.cloned()) };
        let again = self.fit(&effects, &start, Some(whole))?;
        Ok(again.into_iter().chain(known.cloned()).max_by(|a, b| a.evidence.total_cmp(&b.evidence)))
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
