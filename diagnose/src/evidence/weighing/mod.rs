//! Which of two hypotheses is the better one, and which effects are worth naming.
//!
//! Evidence alone takes rows to err independently and the model to be right. What a hypothesis leaves counts as noise, an effect has to matter
//! in a channel, its size has to be beyond what sizes scatter by, and it has to outweigh its prior by what blocks of time allow.

mod beyond;
pub mod clustered;
pub mod leftover;
mod paired;

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::prior;
use crate::evidence::outcome::Outcome;
use crate::evidence::search::tied::TIED_NATS;

/// An effect matters if it explains at least this part of what effects explain in one of the channels by laws that may not be quite right, and so much
/// at all [nat].
const MATERIAL: f64 = 0.005;
const LEAST_NATS: f64 = 3.0;
/// Or if it takes so much strain off the tolerances of the nominal model [nat].
const STRAIN_NATS: f64 = 6.0;

impl Fitter<'_> {
    /// Whether a hypothesis is more probable than another when what the richer one leaves counts as noise.
    pub(super) fn better(&self, outcome: &Outcome, one: &Hypothesis, other: &Hypothesis) -> bool {
        if other.effects.iter().all(|e| one.effects.contains(e)) && !self.is_material(outcome, one, other) {
            return false;
        }
        let richer = if other.effects.len() > one.effects.len() { other } else { one };
        let leftover = self.leftover(richer);
        // Whether a hypothesis is lost in scatter takes long to tell, and is asked where the answer turns on it.
        let gained = self.tempered(one, &leftover) - self.tempered(other, &leftover);
        let is_better = |prior: fn(usize, usize) -> f64| {
            let [one, other] = [one, other].map(|h| prior(h.effects.len(), self.coordinates.sited.len()));
            gained + one > other
        };
        let [by_evidence, if_beyond_scatter] = [prior::log, prior::log_beyond_scatter].map(is_better);
        if by_evidence == if_beyond_scatter || self.lost_in_scatter(outcome, richer).is_some() { by_evidence } else { if_beyond_scatter }
    }

    /// Whether what a richer hypothesis explains beyond a poorer one matters in any channel beside all that the laws of effects explain there, or is
    /// all that remains beside a huge one.
    fn is_material(&self, outcome: &Outcome, richer: &Hypothesis, poorer: &Hypothesis) -> bool {
        let tip_rows = self.rows.tip_rows();
        let channel = |k: usize| if k < tip_rows { 0 } else { 1 + (k - tip_rows) % 3 };
        let squares = |residuals: &[f64]| {
            residuals.iter().enumerate().fold([0.0; 4], |mut sum, (k, r)| {
                sum[channel(k)] += r * r;
                sum
            })
        };
        let before = self.by_exact_laws(outcome, poorer);
        let [all, without, with] = [before, poorer, richer].map(|hypothesis| squares(&hypothesis.residuals));
        self.strain_squared(poorer) - self.strain_squared(richer) > 2.0 * STRAIN_NATS
            || (0..4).any(|k| without[k] - with[k] > (MATERIAL * (all[k] - with[k])).max(2.0 * LEAST_NATS))
            || (self.leftover(poorer).remains() && !self.leftover(richer).remains())
    }

    /// The hypothesis with those effects of one whose laws are exact, if it was fitted, and else the one without effects: what they explain leaves
    /// nothing for others to make good.
    fn by_exact_laws<'a>(&self, outcome: &'a Outcome, hypothesis: &'a Hypothesis) -> &'a Hypothesis {
        let is_exact = |effect: &usize| self.coordinates.sited[*effect].effect.stage.has_exact_laws();
        let exact: Vec<usize> = hypothesis.effects.iter().copied().filter(is_exact).collect();
        if exact == hypothesis.effects {
            return hypothesis;
        }
        outcome.fitted.get(&exact).map_or(&outcome.none, |(known, _)| known)
    }

    /// What numbers of the nominal model have to bear, in squared tolerances.
    pub(super) fn strain_squared(&self, hypothesis: &Hypothesis) -> f64 {
        let spiked = hypothesis.free.iter().filter(|&&c| !hypothesis.effects.contains(&self.coordinates.all[c].effect));
        spiked.map(|&c| self.strain(c, &hypothesis.u).powi(2)).sum()
    }

    /// Judges all hypotheses alike: what the best of them leaves counts as noise.
    pub(super) fn temper(&self, outcome: &mut Outcome) {
        outcome.leftover = self.leftover(&outcome.best);
        let before = outcome.fitted.values().map(|(h, _)| h.evidence).fold(f64::NEG_INFINITY, f64::max);
        let leftover = outcome.leftover;
        outcome.fitted.par_iter_mut().for_each(|(_, (h, evidence))| *evidence = self.tempered(h, &leftover));
        let after = outcome.fitted.values().map(|(_, evidence)| *evidence).fold(f64::NEG_INFINITY, f64::max);
        // Nothing is known of these but that they fell behind, by differences that shrink as all do.
        let shrink = outcome.leftover.most().recip();
        outcome.screened.values_mut().for_each(|evidence| *evidence = after + (*evidence - before) * shrink);
        let (material, mut gone): (Vec<_>, Vec<_>) = outcome.fitted.par_iter().partition(|(_, (h, _))| !self.has_immaterial(outcome, h));
        let (sure, lost): (Vec<_>, Vec<_>) = material.into_par_iter().partition(|(_, (h, _))| self.lost_in_scatter(outcome, h).is_none());
        // What does as well as an effect that is beyond its scatter, and is the same or nearly so, is as likely to be there.
        let stands_in = |(h, z): &(Hypothesis, f64)| {
            let ties = |(_, (other, of_other)): &(_, &(Hypothesis, f64))| {
                *z > of_other - TIED_NATS && h.swapped(other).is_some_and(|[effect, instead]| self.are_tied(effect, instead))
            };
            sure.iter().any(ties)
        };
        gone.extend(lost.into_iter().filter(|(_, known)| !stands_in(known)));
        let gone: BTreeMap<Vec<usize>, f64> = gone.into_iter().map(|(effects, (_, z))| (effects.clone(), *z)).collect();
        outcome.fitted.retain(|effects, _| !gone.contains_key(effects));
        // What the screen promised of more effects than these rests on them.
        outcome.screened.retain(|effects, _| !gone.keys().any(|gone| gone.iter().all(|effect| effects.contains(effect))));
        outcome.spurious = gone;
        outcome.choose();
    }

    fn has_immaterial(&self, outcome: &Outcome, hypothesis: &Hypothesis) -> bool {
        let without = |left_out: &usize| {
            let effects = hypothesis.all_but(*left_out);
            outcome.fitted.get(&effects).filter(|_| !effects.is_empty() || self.file_has_effects())
        };
        let is_needed = |poorer: &Hypothesis| self.is_material(outcome, hypothesis, poorer) && self.outweighs(outcome, hypothesis, poorer);
        hypothesis.effects.iter().filter_map(without).any(|(poorer, _)| !is_needed(poorer))
    }

    /// Whether the file is more than a nominal model: it lists effects, or has numbers that were estimated from recordings. What is found beside these is
    /// held to what a second effect is.
    fn file_has_effects(&self) -> bool {
        let robot = self.rows.robot();
        let has_loop = robot.joints.iter().any(|joint| joint.hysteresis.half_loop > 0.0);
        has_loop || !robot.effects.is_empty() || !robot.calibration.is_empty()
    }

    /// Whether a hypothesis is more probable than a poorer one when residuals that are alike over time count for what they hold.
    fn outweighs(&self, outcome: &Outcome, richer: &Hypothesis, poorer: &Hypothesis) -> bool {
        let evidence = |h: &Hypothesis| outcome.fitted.get(&h.effects).map_or(f64::NEG_INFINITY, |(_, evidence)| *evidence);
        let score = |h: &Hypothesis| outcome.score(h, evidence(h));
        let [r, others] = [richer, poorer].map(|h| outcome.leftover.weighted(&h.residuals, self.rows.tip_rows()));
        let [stated, agreed] = paired::ratio(&r, &others, &self.blocks(&richer.residuals));
        score(richer) - score(poorer) - stated + agreed > 0.0
    }
}
