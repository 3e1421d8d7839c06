//! The search once more where rows have other weights: what came near the best is fitted anew, and effects are added to the best of that.

use std::collections::BTreeMap;

use raven::Result;

use super::{REFITTED, WITHIN_NATS};
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::outcome::Outcome;

impl Fitter<'_> {
    /// As [`Self::search`] where the same was searched `before`.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn search_again(&self, before: &Outcome, mut each: impl FnMut()) -> Result<Option<Outcome>> {
        let Some((nominal, mut outcome)) = self.begun()? else { return Ok(None) };
        outcome.compared.clone_from(&before.compared);
        each();
        if let Some(best) = self.fit(&before.best.effects, &before.best.u, None)? {
            let refit = |(effects, u): &(Vec<usize>, Vec<f64>)| self.fit(effects, u, Some(&best));
            let refitted = side_by_side(&self.near(before, &best), refit)?;
            for hypothesis in [best].into_iter().chain(refitted) {
                outcome.keep(&hypothesis);
                if self.better(&outcome, &hypothesis, &outcome.best) {
                    outcome.best = hypothesis;
                }
            }
            each();
        }
        if !self.leaves_most(&outcome) {
            self.add_and_shed(&mut outcome, &nominal, each)?;
        }
        self.decide(&mut outcome)?;
        Ok(Some(outcome))
    }

    /// Effects of hypotheses that came near the best, with where they were: at least what is left of it without each of its effects.
    fn near(&self, before: &Outcome, best: &Hypothesis) -> Vec<(Vec<usize>, Vec<f64>)> {
        let score = |(h, evidence): &(Hypothesis, f64)| before.score(h, *evidence);
        let reached = before.fitted.get(&best.effects).map_or(f64::NEG_INFINITY, score);
        let is_part = |h: &Hypothesis| h.effects.iter().all(|e| best.effects.contains(e));
        let mut near: Vec<&(Hypothesis, f64)> =
            before.fitted.values().filter(|known| is_part(&known.0) || score(known) > reached - WITHIN_NATS).collect();
        near.retain(|(h, _)| !h.effects.is_empty() && h.effects != best.effects);
        near.sort_by(|a, b| is_part(&b.0).cmp(&is_part(&a.0)).then(score(b).total_cmp(&score(a))));
        near.truncate(REFITTED[1]);
        let mut starts: BTreeMap<Vec<usize>, Vec<f64>> = near.into_iter().map(|(h, _)| (h.effects.clone(), h.u.clone())).collect();
        for &left_out in best.effects.iter().filter(|_| best.effects.len() > 1) {
            starts.entry(best.all_but(left_out)).or_insert_with(|| self.without(left_out, &best.u));
        }
        starts.into_iter().collect()
    }
}
