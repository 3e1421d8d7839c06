//! Whether an effect's size is beyond what sizes scatter by where residuals are alike over time.
//!
//! Evidence takes rows to err independently, and promises too much where they do not. A size is held against none, family-wise over the
//! library and over what the effect was looked for with (Bonferroni). Without the effect a shape says nothing: a size counts as it scatters at
//! the shape that was found. An effect is held against the hypothesis without it as well, by twice the ratio of their likelihoods (Wilks 1938)
//! as far as blocks of time allow, which takes the same number in whatever terms: one of the two has to be beyond. Where an effect has a shape
//! alone, or lets a joint float so that slopes say nothing of it, that ratio alone tells.

use nalgebra::DVector;
use raven::stats::{chi_square_quantile, normal_quantile};

use super::paired;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::outcome::Outcome;

/// Chance that any effect of the library counts as beyond its scatter where there is none. It has to be more probable than none besides: of 64
/// recordings of the virtual lab without an effect none is blamed on one.
const FALSE_CHANCE: f64 = 0.2;

impl Fitter<'_> {
    /// The first effect of a hypothesis that is not.
    pub(crate) fn lost_in_scatter(&self, outcome: &Outcome, hypothesis: &Hypothesis) -> Option<usize> {
        hypothesis.effects.iter().copied().find(|&effect| !self.is_beyond_scatter(outcome, hypothesis, effect))
    }

    fn is_beyond_scatter(&self, outcome: &Outcome, hypothesis: &Hypothesis, effect: usize) -> bool {
        let free = &hypothesis.free;
        // What the nominal model knows no better than the effect does is among the others.
        let is_own = |&k: &usize| self.coordinates.all[free[k]].effect == effect && !self.coordinates.all[free[k]].is_unknown();
        let (own, others): (Vec<usize>, Vec<usize>) = (0..free.len()).partition(is_own);
        if own.is_empty() {
            return true;
        }
        let sizes: Vec<usize> = own.iter().copied().filter(|&k| self.scale(free[k]).is_size()).collect();
        let shapes = self.shapes_looked_at(effect);
        let chance = |looks: usize| FALSE_CHANCE / (self.coordinates.sited.len() * looks) as f64;
        let is_likelier = outcome.fitted.get(&hypothesis.all_but(effect)).map(|(without, _)| {
            let beyond = chi_square_quantile(sizes.len().max(1), 1.0 - chance(shapes)).unwrap_or(f64::INFINITY);
            2.0 * self.likelihood_ratio(hypothesis, without) > beyond
        });
        match is_likelier {
            Some(true) => true,
            Some(false) if sizes.is_empty() || self.is_loose(effect) => false,
            None if sizes.is_empty() => true,
            _ => {
                let shaped = own.len() > sizes.len();
                let beyond = normal_quantile(1.0 - 0.5 * chance(if shaped { shapes } else { sizes.len() }));
                self.is_any_beyond(hypothesis, &sizes, &others, beyond)
            }
        }
    }

    /// Whether any of `sizes` is so many of its deviations from none beside the `others`, all of which are among the free coordinates.
    fn is_any_beyond(&self, hypothesis: &Hypothesis, sizes: &[usize], others: &[usize], beyond: f64) -> bool {
        let free = &hypothesis.free;
        let kept: Vec<usize> = sizes.iter().chain(others).copied().collect();
        let columns: Vec<&[f64]> = kept.iter().map(|&k| hypothesis.columns[k].as_slice()).collect();
        let coordinates: Vec<usize> = kept.iter().map(|&k| free[k]).collect();
        let precision: DVector<f64> = self.precision(&coordinates, &hypothesis.effects);
        let scatter = self.scatter(&columns, &hypothesis.residuals, &precision).unwrap_or_default();
        sizes.iter().zip(scatter).any(|(&k, deviation)| hypothesis.u[free[k]].abs() > beyond * deviation)
    }

    /// How much likelier a hypothesis is than a poorer one at their best [nat]: by the recordings, as far as blocks of time allow, and by what the
    /// tolerances of the nominal model bear.
    fn likelihood_ratio(&self, richer: &Hypothesis, poorer: &Hypothesis) -> f64 {
        let [_, agreed] = paired::ratio(&richer.residuals, &poorer.residuals, &self.blocks(&richer.residuals));
        agreed + 0.5 * (self.strain_squared(poorer) - self.strain_squared(richer))
    }
}
