//! Points that hypotheses are fitted from: numbers `u` of all coordinates, put together from those of others.

use nalgebra::DMatrix;
use raven::Result;

use crate::evidence::fit::{Fitter, Hypothesis, cost, side_by_side};
use crate::evidence::numbers::coordinates::{ABSENT, MILDEST};
use crate::evidence::recorded::rows::Links;

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
    pub(crate) fn taking(&self, u: &[f64], effects: &[usize], from: &[f64]) -> Vec<f64> {
        let mut taking = u.to_vec();
        effects.iter().flat_map(|&effect| self.coordinates.of(effect)).for_each(|c| taking[c] = from[c]);
        taking
    }

    /// `u` with other numbers of one effect.
    pub(crate) fn placing(&self, u: &[f64], effect: usize, numbers: &[f64]) -> Vec<f64> {
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

    /// Which of several numbers cost least under a hypothesis of these effects, the first of those that cost the same, and how much [nat].
    pub(super) fn cheapest(&self, effects: &[usize], mut starts: Vec<Vec<f64>>) -> Result<Option<(f64, Vec<f64>)>> {
        starts.dedup();
        let costs = side_by_side(&starts, |start| self.cost_at(effects, start).map(Some))?;
        Ok(costs.into_iter().zip(starts).min_by(|(a, _), (b, _)| a.total_cmp(b)))
    }

    /// What some numbers cost under a hypothesis of these effects [nat].
    pub(super) fn cost_at(&self, effects: &[usize], u: &[f64]) -> Result<f64> {
        let free = self.free(effects);
        Ok(cost(&free, &self.precision(&free, effects), u, &self.exact(u)?))
    }

    /// The nominal model with its slopes, nothing fitted.
    pub fn at_nominal(&self) -> Result<Option<Hypothesis>> {
        self.at(&[], self.nowhere())
    }

    /// Effects and numbers with their slopes, nothing fitted; `None` where the model cannot be evaluated.
    pub(crate) fn at(&self, effects: &[usize], u: Vec<f64>) -> Result<Option<Hypothesis>> {
        let residuals = self.exact(&u)?;
        let free = self.free(effects);
        let columns = self.slopes(&u, &free, Links::Settled)?;
        let finite = residuals.iter().chain(columns.iter().flat_map(|column| column.iter())).all(|v| v.is_finite());
        let covariance = DMatrix::zeros(free.len(), free.len());
        let cost = cost(&free, &self.precision(&free, effects), &u, &residuals);
        let effects = effects.to_vec();
        let evidence = f64::NEG_INFINITY;
        Ok(finite.then_some(Hypothesis { effects, u, free, covariance, cost, evidence, raised: 0.0, is_close: false, residuals, columns }))
    }
}
