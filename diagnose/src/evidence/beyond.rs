//! Whether an effect's size is beyond what sizes scatter by where residuals are alike over time.
//!
//! Evidence takes rows to err independently, and promises too much where they do not. A size is held against none, family-wise over the
//! library and over what the effect was looked for with (Bonferroni). Without the effect a shape says nothing: a size counts as it scatters at
//! the shape that was found, and an effect that has a shape alone is as large as what it moves.

use nalgebra::DVector;
use raven::Result;
use raven::stats::normal_quantile;

use super::fit::{Fitter, Hypothesis};

/// Chance that any effect of the library counts as beyond its scatter where there is none.
const FALSE_CHANCE: f64 = 0.05;

impl Fitter<'_> {
    /// Whether each effect of a hypothesis is.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub(super) fn are_beyond_scatter(&self, hypothesis: &Hypothesis) -> Result<bool> {
        for &effect in &hypothesis.effects {
            if !self.is_beyond_scatter(hypothesis, effect)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn is_beyond_scatter(&self, hypothesis: &Hypothesis, effect: usize) -> Result<bool> {
        let Hypothesis { free, columns, residuals, u, .. } = hypothesis;
        let is_own = |&k: &usize| self.coordinates.all[free[k]].effect == effect;
        let (own, others): (Vec<usize>, Vec<usize>) = (0..free.len()).partition(is_own);
        let says = own.into_iter().filter(|&k| !self.coordinates.all[free[k]].is_unknown());
        let (sizes, shapes): (Vec<usize>, Vec<usize>) = says.partition(|&k| self.scale(free[k]).is_size());
        let mut found: Vec<f64> = sizes.iter().map(|&k| u[free[k]].abs()).collect();
        let kept: Vec<usize> = sizes.iter().chain(&others).copied().collect();
        let mut slopes: Vec<&[f64]> = kept.iter().map(|&k| columns[k].as_slice()).collect();
        let coordinates: Vec<usize> = kept.iter().map(|&k| free[k]).collect();
        let mut precision: Vec<f64> = self.precision(&coordinates, &hypothesis.effects).iter().copied().collect();
        let moved: Vec<f64>;
        match (sizes.is_empty(), shapes.is_empty()) {
            (true, true) => return Ok(true),
            (true, false) => {
                let absent = self.exact(&self.without(effect, u))?;
                moved = absent.iter().zip(residuals).map(|(absent, there)| absent - there).collect();
                found.insert(0, 1.0);
                slopes.insert(0, &moved);
                precision.insert(0, 0.0);
            }
            _ => {}
        }
        let Some(scatter) = self.scatter(&slopes, residuals, &DVector::from_vec(precision)) else { return Ok(false) };
        let looks = if shapes.is_empty() { found.len() } else { self.shapes_looked_at(effect) };
        let beyond = normal_quantile(1.0 - 0.5 * FALSE_CHANCE / (self.coordinates.sited.len() * looks) as f64);
        Ok(found.iter().zip(&scatter).any(|(size, deviation)| *size > beyond * deviation))
    }
}
