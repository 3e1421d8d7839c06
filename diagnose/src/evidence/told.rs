//! A fit that is told which effects there are: the most that any diagnosis could close of the gap, and whether it could see them at all.

use raven::Result;

use super::fit::{Fitter, Hypothesis};
use super::leftover::Leftover;

impl Fitter<'_> {
    /// Fits named effects, one after the other and at last together, and tells what each of them gains beside the others, at least [nat];
    /// `None` where the model cannot be evaluated.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn told(&self, effects: &[usize]) -> Result<Option<(Hypothesis, f64)>> {
        let Some(mut point) = self.at_nominal()? else { return Ok(None) };
        let Some(none) = self.fit(&[], &point.u, None)? else { return Ok(None) };
        for &effect in effects {
            let Some(candidate) = self.screen_some(&point, point.evidence, &[effect])?.into_iter().next() else { return Ok(None) };
            let Some(hypothesis) = self.fit(&candidate.effects, &candidate.start, Some(&point))? else { return Ok(None) };
            point = hypothesis;
        }
        let leftover = Leftover::of(&point.residuals, self.rows.tip_rows());
        let mut gain = f64::INFINITY;
        for left_out in &point.effects {
            let others = point.all_but(*left_out);
            let without = if others.is_empty() {
                none.clone()
            } else {
                let Some(without) = self.fit(&others, &self.without(*left_out, &point.u), Some(&point))? else { return Ok(None) };
                without
            };
            gain = gain.min(self.tempered(&point, &leftover) - self.tempered(&without, &leftover));
        }
        Ok(Some((point, gain)))
    }
}
