//! Hypotheses fitted once more by slopes of rolled-out links, where little is between the best and none.
//!
//! Slopes of settled links leave out how cables and friction that holds follow a motion. A fit by them may stop some nats short, the nominal
//! model's by twenty-five, which an effect that is not there then makes good.

use raven::Result;

use super::fit::{Fitter, Hypothesis, side_by_side};
use super::lost::LOST_NATS;
use super::outcome::Outcome;
use super::search::WITHIN_NATS;
use super::slopes::Following;

/// Others that are as near the best as this [nat] are fitted too, so many of them at most.
const OTHERS_NATS: f64 = 10.0;
const OTHERS_MAX: usize = 3;

impl Fitter<'_> {
    /// Fits what is likely once more, and goes on with the best of it.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub(super) fn look_closely(&self, outcome: &mut Outcome) -> Result<()> {
        let Some(leading) = self.leading(outcome) else { return Ok(()) };
        if leading.evidence - outcome.none.evidence > WITHIN_NATS {
            return Ok(());
        }
        let again = |effects: &[usize], u: &[f64]| self.fit_with(effects, u, None, Following::AllRolledOut);
        let Some(none) = again(&[], &outcome.none.u)? else { return Ok(()) };
        let mut likely = self.as_likely(outcome, &leading, &none);
        // With the nominal model's numbers from either, and each effect without those that may have made good what the other fit lacked.
        let from_none = self.taking(&none.u, &leading.effects, &leading.u);
        likely.push((leading.effects.clone(), from_none.clone()));
        if leading.effects.len() > 1 {
            likely.extend(leading.effects.iter().map(|&left_out| (leading.all_but(left_out), self.without(left_out, &from_none))));
        }
        side_by_side(&likely, |(effects, u)| again(effects, u))?.iter().for_each(|hypothesis| outcome.keep(hypothesis));
        outcome.keep(&none);
        let mut best = outcome.none.clone();
        for (hypothesis, _) in outcome.fitted.values() {
            if self.better(outcome, hypothesis, &best) {
                best = hypothesis.clone();
            }
        }
        outcome.best = best;
        Ok(())
    }

    /// The best hypothesis, or where that is none the one with effects beyond their scatter that has most evidence, if more than none.
    fn leading(&self, outcome: &Outcome) -> Option<Hypothesis> {
        if !outcome.best.effects.is_empty() {
            return Some(outcome.best.clone());
        }
        let fitted = outcome.fitted.values().map(|(hypothesis, _)| hypothesis);
        let mut better: Vec<&Hypothesis> = fitted.filter(|h| !h.effects.is_empty() && h.evidence > outcome.none.evidence).collect();
        better.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        better.into_iter().find(|h| self.lost_in_scatter(outcome, h).is_none()).cloned()
    }

    /// Effects and numbers of the `best` hypothesis and of those with effects that are hardly behind it, or would not be if they had not been
    /// lost on the way to where `none` is.
    fn as_likely(&self, outcome: &Outcome, best: &Hypothesis, none: &Hypothesis) -> Vec<(Vec<usize>, Vec<f64>)> {
        let with_effects = outcome.fitted.values().map(|(h, _)| h).filter(|h| !h.effects.is_empty() && h.effects != best.effects);
        let mut near: Vec<(&Hypothesis, f64)> = with_effects.map(|h| (h, self.lost_nats(h, none))).collect();
        near.retain(|(h, lost)| h.evidence + lost > best.evidence - OTHERS_NATS);
        near.sort_by(|(a, lost_a), (b, lost_b)| (b.evidence + lost_b).total_cmp(&(a.evidence + lost_a)));
        let from = |(h, lost): (&Hypothesis, f64)| if lost > LOST_NATS { self.taking(&none.u, &h.effects, &h.u) } else { h.u.clone() };
        let near = near.into_iter().take(OTHERS_MAX).map(|known| (known.0.effects.clone(), from(known)));
        [(best.effects.clone(), best.u.clone())].into_iter().chain(near).collect()
    }
}
