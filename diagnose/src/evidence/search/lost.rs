//! Fits that lost their way, begun again.
//!
//! The screen's slopes promise far too much of a joint that is held by friction, swings or floats in slack, and a fit that goes by them ends
//! far from the recordings; so does the nominal model's where a soft cable is within its tolerance. Where something remains, the best
//! hypothesis and the one without effects go on by slopes of rolled-out links. Where the best explains nothing, effects of that kind are
//! fitted again from the nominal model at several sizes, and so is a slack that leaves something: first all other numbers with these held, then
//! everything. A slack whose size is known begins by settled slopes as well: held, a large one can go astray.
//!
//! Several effects of how one joint follows its cable may stand in for a slack, which settled links do not see beside another effect. Where something
//! remains, a slack that as it stands brings the links nearer to the recordings is fitted beside the best hypothesis.
//!
//! A soft cable is fitted on by slopes of rolled-out links before anything is looked for beside it, and what an effect is known to stand in for is
//! fitted from the values that do about the same: from far away a soft cable's slopes lead anywhere, but creep that is over within seconds is one.

use std::collections::BTreeSet;

use raven::Result;
use raven::effects::{Effect, Element, Sited};

use super::{EFFECTS_MAX, HOPE_NATS, WITHIN_NATS};
use crate::evidence::fit::linear::dot;
use crate::evidence::fit::slopes::Following;
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::outcome::Outcome;

/// Effects that are fitted again: the best so far.
const AGAIN: usize = 2;
/// Starts of each: some, evenly spread over those of the screen; and of slacks that help beside the best hypothesis as they stand.
const STARTS_MAX: usize = 3;
/// Starts of a slack that leaves nothing, beside numbers that have not followed it. A slack joint's torque is jagged: the nominal model's slopes lead
/// half of the fits astray, those beside the slack the other half.
const SLACKS_BESIDE_REST: [f64; 5] = [0.2, 0.4, 0.7, 1.0, 1.5];
/// Part of its stiffness below which a cable is soft: with the nominal dampers its joint follows a tenth of a second late and more.
const SOFT: f64 = 0.1;
/// How many of these fits go on by slopes of rolled-out links.
const CLOSELY: usize = 2;

impl Fitter<'_> {
    /// Fits again what the search may have lost. Tells whether the best hypothesis is another one afterwards.
    pub(crate) fn found_again(&self, outcome: &mut Outcome, nominal: &Hypothesis) -> Result<bool> {
        if self.stood_in(outcome)? || self.one_for_several(outcome)? {
            return Ok(true);
        }
        if self.explains_little(outcome) {
            return self.at_several_sizes(outcome, nominal);
        }
        if !self.leftover(&outcome.best).remains() {
            return self.slacks_beside_rest(outcome);
        }
        if self.slacks_beside(outcome)? {
            return Ok(true);
        }
        let mut other = self.closely(outcome, &[outcome.best.clone(), outcome.none.clone()])?;
        // What strains the nominal model may be an effect.
        let none = &outcome.none;
        if let Some(effect) = self.strained(none).into_iter().find(|&effect| self.followed(effect).is_some()) {
            let freed = Hypothesis { effects: vec![effect], ..none.clone() };
            other |= self.closely(outcome, &[freed])?;
        }
        Ok(self.slack_resized(outcome, nominal)? || other)
    }

    /// The better of `best`, if it changes how a joint follows its cable, and of cables that are hardly behind it and so soft that their joints follow
    /// slowly, fitted on by slopes of rolled-out links: those of settled links stop tens to hundreds of nats short, which another effect then makes good.
    pub(crate) fn followed_closely(&self, outcome: &mut Outcome, mut best: Hypothesis) -> Result<Hypothesis> {
        let is_soft = |h: &Hypothesis, effect: usize| {
            let Sited { effect: Effect { element, parameters, .. }, .. } = self.coordinates.sited[effect];
            let is_factor = *element == Some(Element::Spring) && parameters[0].scale.is_factor();
            is_factor && self.coordinates.values(effect, &h.u)[0] < SOFT
        };
        let has_soft = |h: &&Hypothesis| h.effects.iter().any(|&effect| is_soft(h, effect));
        let near = |h: &&Hypothesis| h.effects != best.effects && h.evidence > best.evidence - WITHIN_NATS;
        let soft = outcome.fitted.values().map(|(hypothesis, _)| hypothesis).filter(near).filter(has_soft);
        let follows = |h: &&Hypothesis| h.effects.iter().any(|&effect| self.followed(effect).is_some() && !self.is_loose(effect));
        let followed: Vec<Hypothesis> = Some(&best).filter(follows).into_iter().chain(soft).cloned().collect();
        let closely = |other: &Hypothesis| {
            let closely = self.fit_with(&other.effects, &other.u, None, Following::RolledOut)?;
            Ok(closely.filter(|closely| closely.evidence > other.evidence))
        };
        for closely in side_by_side(&followed, closely)? {
            outcome.keep(&closely);
            if closely.evidence > best.evidence {
                best = closely;
            }
        }
        Ok(best)
    }

    /// Fits what an effect of the best hypothesis may stand in for, with the values that do about the same; as [`Self::closely`].
    fn stood_in(&self, outcome: &mut Outcome) -> Result<bool> {
        let sited = &self.coordinates.sited;
        let best = outcome.best.clone();
        let mut others = Vec::new();
        for &found in &best.effects {
            let values = self.coordinates.values(found, &best.u);
            for tie in sited[found].effect.ties {
                let Some(alike) = tie.values else { continue };
                let is_tied = |other: &Sited| other.effect.id == tie.id && other.place == sited[found].place;
                let Some(other) = sited.iter().position(is_tied).filter(|&other| self.can_replace(&best, found, other)) else { continue };
                let mut u = self.without(found, &best.u);
                for (c, value) in self.coordinates.of(other).zip(alike(self.rows.robot(), sited[found].place, &values)) {
                    u[c] = self.coordinates.parameter(c).u(value, sited[other].measure);
                }
                let effects = best.effects.iter().map(|&effect| if effect == found { other } else { effect });
                others.push(Hypothesis { effects: effects.collect(), u, ..best.clone() });
            }
        }
        self.closely(outcome, &others)
    }

    /// Fits a slack in place of several effects of the best hypothesis that change how one joint follows its cable; as [`Self::closely`].
    fn one_for_several(&self, outcome: &mut Outcome) -> Result<bool> {
        let sited = &self.coordinates.sited;
        let best = outcome.best.clone();
        let joints: BTreeSet<usize> = best.effects.iter().filter_map(|&effect| self.followed(effect)).collect();
        let mut other = false;
        for joint in joints {
            let follows = |effect: &usize| self.followed(*effect) == Some(joint);
            let several: Vec<usize> = best.effects.iter().copied().filter(follows).collect();
            if several.len() < 2 || several.iter().any(|&effect| self.is_loose(effect)) {
                continue;
            }
            let Some(rest) = self.rest(outcome, &best, &several)? else { continue };
            outcome.keep(&rest);
            let slacks = (0..sited.len()).filter(|&effect| follows(&effect) && self.is_loose(effect));
            let starts: Vec<_> =
                slacks.flat_map(|effect| self.starts(effect, &rest.u).into_iter().map(move |start| (effect, start))).collect();
            let ways = [Following::Held, Following::Settled].map(|following| (following, Some(&rest)));
            other |= self.begun_again(outcome, &rest, &starts, &ways)?;
        }
        Ok(other)
    }

    /// Goes on with hypotheses by slopes of rolled-out links. Tells whether one of them is better than the best, which it then is.
    fn closely(&self, outcome: &mut Outcome, hypotheses: &[Hypothesis]) -> Result<bool> {
        let closely = |h: &Hypothesis| self.fit_with(&h.effects, &h.u, None, Following::RolledOut);
        Ok(self.taken(outcome, side_by_side(hypotheses, closely)?.into_iter()))
    }

    /// Takes in hypotheses. Tells whether one of them is better than the best, which it then is.
    pub(super) fn taken(&self, outcome: &mut Outcome, fitted: impl Iterator<Item = Hypothesis>) -> bool {
        let mut other = false;
        for hypothesis in fitted {
            outcome.keep(&hypothesis);
            let is_better = if hypothesis.effects == outcome.best.effects {
                hypothesis.supersedes(&outcome.best)
            } else {
                self.better(outcome, &hypothesis, &outcome.best)
            };
            if is_better {
                outcome.best = hypothesis;
                other = true;
            }
        }
        other
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
        self.begun_again(outcome, nominal, &starts, &[(Following::Held, Some(nominal))])
    }

    /// Fits each slack of the best hypothesis, or where that is none those that are likelier alone, from several sizes and the numbers that the
    /// rest comes to without it; as [`Self::closely`].
    fn slacks_beside_rest(&self, outcome: &mut Outcome) -> Result<bool> {
        let best = outcome.best.clone();
        let found: Vec<Hypothesis> = if best.effects.is_empty() {
            let likelier = |h: &&Hypothesis| h.effects.len() == 1 && h.evidence > best.evidence + HOPE_NATS;
            outcome.fitted.values().map(|(h, _)| h).filter(likelier).cloned().collect()
        } else {
            vec![best]
        };
        let mut other = false;
        for hypothesis in found {
            for &slack in hypothesis.effects.iter().filter(|&&effect| self.is_loose(effect)) {
                let Some(rest) = self.rest(outcome, &hypothesis, &[slack])? else { continue };
                let size = self.coordinates.own(slack, &hypothesis.u);
                let starts = SLACKS_BESIDE_REST.map(|part| (slack, size.iter().map(|u| part * u).collect()));
                let ways = [(Following::Settled, Some(&rest)), (Following::Settled, None)];
                other |= self.begun_again(outcome, &rest, &starts, &ways)?;
            }
        }
        Ok(other)
    }

    /// Fits slacks beside the best hypothesis that help there as they stand, whatever settled links, which know nothing of them, say; as
    /// [`Self::closely`].
    fn slacks_beside(&self, outcome: &mut Outcome) -> Result<bool> {
        let best = outcome.best.clone();
        let slack_joint = |effect: usize| self.followed(effect).filter(|_| self.is_loose(effect));
        let has_slack = |joint: usize| best.effects.iter().any(|&effect| slack_joint(effect) == Some(joint));
        if best.effects.is_empty() || best.effects.len() == EFFECTS_MAX {
            return Ok(false);
        }
        let slacks = (0..self.coordinates.sited.len()).filter(|&effect| slack_joint(effect).is_some_and(|joint| !has_slack(joint)));
        let starts: Vec<_> = slacks.flat_map(|slack| self.starts(slack, &best.u).into_iter().map(move |start| (slack, start))).collect();
        let mut helping = side_by_side(&starts, |(slack, start)| {
            let there = self.exact(&self.placing(&best.u, *slack, start))?;
            let gained = 0.5 * (dot(&best.residuals, &best.residuals) - dot(&there, &there));
            Ok((gained > WITHIN_NATS).then(|| (gained, (*slack, start.clone()))))
        })?;
        helping.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        let helping: Vec<_> = helping.into_iter().take(STARTS_MAX).map(|(_, start)| start).collect();
        self.begun_again(outcome, &best, &helping, &[(Following::Held, Some(&best)), (Following::Settled, Some(&best))])
    }

    /// Fits effects, each beside those of `base`, from there and these numbers of theirs in several ways, each with the slopes to begin with; as
    /// [`Self::closely`].
    pub(super) fn begun_again(
        &self,
        outcome: &mut Outcome,
        base: &Hypothesis,
        starts: &[(usize, Vec<f64>)],
        ways: &[(Following, Option<&Hypothesis>)],
    ) -> Result<bool> {
        let fitted = |(effect, start): &(usize, Vec<f64>)| {
            let u = self.placing(&base.u, *effect, start);
            let effects = [base.effects.as_slice(), &[*effect]].concat();
            side_by_side(ways, |&(following, like)| self.fit_with(&effects, &u, like, following)).map(Some)
        };
        let mut fitted: Vec<Hypothesis> = side_by_side(starts, fitted)?.into_iter().flatten().collect();
        fitted.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        fitted.truncate(CLOSELY);
        let better = self.taken(outcome, fitted.iter().cloned());
        Ok(self.closely(outcome, &fitted)? || better)
    }
}
