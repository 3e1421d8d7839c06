//! Hypotheses fitted once more by slopes of rolled-out links, where little is between the best and none.
//!
//! Slopes of settled links leave out how cables and friction that holds follow a motion. A fit by them may stop some nats short, the nominal
//! model's by twenty-five, which an effect that is not there then makes good.

use raven::Result;

use super::WITHIN_NATS;
use super::refit::LOST_NATS;
use crate::evidence::fit::slopes::Following;
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::outcome::Outcome;

/// Others that are as near the best as this [nat] are fitted too, so many of them at most.
const OTHERS_NATS: f64 = 10.0;
const OTHERS_MAX: usize = 3;

impl Fitter<'_> {
    /// Fits what is likely once more, and goes on with the best of it.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn look_closely(&self, outcome: &mut Outcome) -> Result<()> {
        let Some(leading) = self.leading(outcome) else { return Ok(()) };
        if leading.evidence - outcome.none.evidence > WITHIN_NATS {
            return Ok(());
        }
        let Some(none) = self.fitted_closely(&[], &outcome.none.u, None)? else { return Ok(()) };
        let mut likely = self.as_likely(outcome, &leading, &none);
        // With the nominal model's numbers from either, and each effect without those that may have made good what the other fit lacked.
        let from_none = self.taking(&none.u, &leading.effects, &leading.u);
        likely.push((leading.effects.clone(), from_none.clone()));
        if leading.effects.len() > 1 {
            likely.extend(leading.effects.iter().map(|&left_out| (leading.all_but(left_out), self.without(left_out, &from_none))));
        }
        let mut close = side_by_side(&likely, |(effects, u)| self.fitted_closely(effects, u, Some(&none)))?;
        close.push(none);
        anchored(&mut close, &leading);
        close.iter().for_each(|hypothesis| outcome.keep(hypothesis));
        let mut best = outcome.none.clone();
        for (hypothesis, _) in outcome.fitted.values() {
            if self.better(outcome, hypothesis, &best) {
                best = hypothesis.clone();
            }
        }
        outcome.best = best;
        Ok(())
    }

    /// Fits a hypothesis from a start by slopes of rolled-out links, by those of `like` as [`Self::fit`] does: where joints stick by chance they
    /// scatter, and what two hypotheses have in common is to scatter alike.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn fitted_closely(&self, effects: &[usize], start: &[f64], like: Option<&Hypothesis>) -> Result<Option<Hypothesis>> {
        self.fit_with(effects, start, like, Following::AllRolledOut)
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

/// Puts what was fitted closely beside what was not. By slopes of rolled-out links more numbers matter, or fewer, whatever the effects: evidence of
/// all is raised by what that makes of the one that is `known` with the same effects by other slopes, its cost left as it is.
pub(super) fn anchored(close: &mut [Hypothesis], known: &Hypothesis) {
    let beyond_cost = |h: &Hypothesis| h.evidence + h.cost;
    let same = close.iter().filter(|h| h.effects == known.effects).min_by(|a, b| a.cost.total_cmp(&b.cost));
    let Some(raised) = same.map(|same| beyond_cost(known) - beyond_cost(same)) else { return };
    for hypothesis in close {
        hypothesis.evidence += raised;
        hypothesis.raised += raised;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::tests::fitted;

    /// A fit that ended at a cost, with what its slopes make of it [nat].
    fn ended(effect: usize, is_close: bool, cost: f64, beyond: f64) -> Hypothesis {
        Hypothesis { cost, evidence: beyond - cost, is_close, ..fitted(vec![effect], 0.0) }
    }

    #[test]
    fn a_closer_fit_counts_unless_it_stopped_short() {
        let known = ended(0, false, 100.0, 6.0);
        assert!(ended(0, true, 100.5, 0.0).supersedes(&known), "slopes of settled links claimed six nats too much");
        assert!(!ended(0, true, 102.0, 9.0).supersedes(&known));
        assert!(!known.supersedes(&ended(0, true, 100.5, 0.0)));
        assert!(ended(0, false, 98.0, -9.0).supersedes(&ended(0, true, 100.5, 0.0)));
        assert!(ended(0, false, 100.5, 7.0).supersedes(&known));
    }

    #[test]
    fn what_was_fitted_closely_stands_beside_what_was_not() {
        let known = ended(0, false, 100.0, 6.0);
        // Closer slopes take eight nats off both, but for two that the other one's settled links had claimed.
        let mut close = [ended(0, true, 97.0, -2.0), ended(1, true, 97.5, -4.0)];
        anchored(&mut close, &known);
        // The cost that came down counts.
        assert_eq!(close.map(|h| h.evidence), [6.0 - 97.0, 4.0 - 97.5]);
    }
}
