//! A law that explains most alone and leaves something, fitted from other sizes and shapes before anything is added to it.
//!
//! Slopes lead a slack astray by thousands of nats, and stop a loop short of a sharp one: settled links bounce nowhere, and what is sharp has slopes
//! that hold for nothing but the smallest steps. Other effects of the joint would make that good.

use raven::Result;

use crate::evidence::fit::slopes::Following;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::coordinates::MILDEST;
use crate::evidence::outcome::Outcome;

/// Most times that a slack is fitted from other sizes.
const RESIZED_MAX: usize = 3;
/// Starts of a slack, as parts of its size.
const SIZES: [f64; 3] = [0.6, 1.0, 1.7];
/// Starts of a law's shape from where it was found, in units of its slab.
const SHAPES: [f64; 2] = [-1.5, 1.5];

impl Fitter<'_> {
    /// `best`, or what a slack comes to from other sizes, as long as that is better and something remains, and its laws from other shapes.
    pub(crate) fn resized(&self, outcome: &mut Outcome, nominal: &Hypothesis, best: Hypothesis) -> Result<Hypothesis> {
        let before = std::mem::replace(&mut outcome.best, best);
        for _ in 0..RESIZED_MAX {
            if !self.slack_resized(outcome, nominal)? {
                break;
            }
        }
        self.reshaped(outcome)?;
        Ok(std::mem::replace(&mut outcome.best, before))
    }

    /// Fits the best hypothesis, if that is a slack alone and leaves something, from sizes about its own and the nominal numbers. Tells whether one of
    /// these fits is better, which it then is.
    pub(crate) fn slack_resized(&self, outcome: &mut Outcome, nominal: &Hypothesis) -> Result<bool> {
        let [slack] = outcome.best.effects[..] else { return Ok(false) };
        if !self.is_loose(slack) || !self.leftover(&outcome.best).remains() {
            return Ok(false);
        }
        let own = self.coordinates.own(slack, &outcome.best.u);
        let starts = SIZES.map(|part| (slack, own.iter().map(|u| part * u).collect()));
        let ways = [Following::Held, Following::Settled].map(|following| (following, Some(nominal)));
        self.begun_again(outcome, nominal, &starts, &ways)
    }

    /// Fits each effect of the best hypothesis that has a size and a shape, if that leaves something, from shapes on either side of its own, and goes on
    /// with the best of these.
    fn reshaped(&self, outcome: &mut Outcome) -> Result<()> {
        let best = outcome.best.clone();
        for &effect in &best.effects {
            let own = self.coordinates.own(effect, &best.u);
            let moved = |k: usize, by: f64| {
                let mut start = own.clone();
                start[k] = (own[k] + by).clamp(-MILDEST, MILDEST);
                (effect, start)
            };
            let parameters = self.coordinates.sited[effect].effect.parameters;
            let shapes = (0..parameters.len()).filter(|&k| parameters.len() > 1 && parameters[k].scale.is_shape());
            let starts: Vec<(usize, Vec<f64>)> = shapes.flat_map(|k| SHAPES.map(|by| moved(k, by))).collect();
            if starts.is_empty() || !self.leftover(&best).remains() {
                continue;
            }
            let rest = Hypothesis { effects: best.all_but(effect), ..best.clone() };
            self.begun_again(outcome, &rest, &starts, &[(Following::Settled, Some(&best))])?;
        }
        Ok(())
    }
}
