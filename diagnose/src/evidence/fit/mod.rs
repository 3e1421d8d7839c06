//! The most probable numbers of one hypothesis: a descent on exact residuals with slopes of settled links.
//!
//! Slopes of the numbers that the nominal model has change little; they are carried over from step to step, and from another hypothesis where
//! there is one.

mod descent;
pub mod linear;
pub(crate) mod slopes;

use nalgebra::{DMatrix, DVector};
use raven::Result;
use raven::effects::{Above, Scale};
use raven::stats::normal_cdf;
use rayon::prelude::*;

use crate::evidence::numbers::coordinates::{Coordinates, MILDEST};
use crate::evidence::numbers::sizes;
use crate::evidence::recorded::rows::{ALL, Links, Observed};
use descent::Descent;
use linear::{Quadratic, dot, evidence};
use slopes::{Column, Following, Slopes};

/// Most steps of a fit, and of one that goes by slopes of rolled-out links where an effect is.
const STEPS_MAX: usize = 20;
const CLOSE_STEPS_MAX: usize = 8;
/// Where a fit ends, slopes by how joints follow their cables, which go by all numbers, are taken anew as long as that brought so much the last
/// time [nat]: without, the nominal model's fit stops up to twenty nats short.
const RENEWED_MIN: f64 = 1.0;
/// A fit by closer slopes counts in place of another unless it ended so much higher [nat].
const CLOSER_WITHIN: f64 = 1.0;
/// A number of the nominal model is strained if it is so many of its tolerances off.
pub const STRAINED: f64 = 4.0;
/// Farthest a number is moved at once, in units of the slab.
const STEP_MAX: f64 = 1.5;
/// That of a shape, in deviations of its logarithm, and of a moment, as a part of the recording.
const SHAPE_STEP_MAX: f64 = 0.7;
const MOMENT_STEP_MAX: f64 = 0.02;
/// Least size of what cannot be negative, in units of the slab.
const MAGNITUDE_MIN: f64 = 1e-3;

/// A hypothesis, fitted.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Effects at their slabs, of [`Coordinates::sited`], in rising order.
    pub effects: Vec<usize>,
    /// All coordinates.
    pub u: Vec<f64>,
    /// Coordinates that are free.
    pub free: Vec<usize>,
    /// Covariance of those.
    pub covariance: DMatrix<f64>,
    /// `F` there [nat].
    pub cost: f64,
    /// `ln Z` [nat].
    pub evidence: f64,
    /// Part of that which it was raised by, to stand beside fits by other slopes [nat].
    pub raised: f64,
    /// Whether slopes are those of rolled-out links throughout. By others a number may seem to matter more or less than it does, and `ln Z` be off
    /// by several nats.
    pub is_close: bool,
    /// Whitened residuals there.
    pub residuals: Vec<f64>,
    /// Slopes there, one per free coordinate.
    pub columns: Vec<Column>,
}

impl Hypothesis {
    /// Whether this fit counts in place of `known`, with the same effects: of two that were made alike the one with more evidence, and else the closer
    /// one, unless the other ended lower.
    #[must_use]
    pub fn supersedes(&self, known: &Self) -> bool {
        match (self.is_close, known.is_close) {
            (true, false) => self.cost < known.cost + CLOSER_WITHIN,
            (false, true) => self.cost < known.cost - CLOSER_WITHIN,
            _ => self.evidence > known.evidence,
        }
    }

    /// Its effects but one.
    #[must_use]
    pub fn all_but(&self, left_out: usize) -> Vec<usize> {
        self.effects.iter().copied().filter(|&effect| effect != left_out).collect()
    }

    /// The one effect that it has and another hypothesis has not, and the one that this has in its place; nothing where they differ otherwise.
    #[must_use]
    pub fn swapped(&self, other: &Self) -> Option<[usize; 2]> {
        let lacking = |one: &Self, another: &Self| {
            let mut lacking = one.effects.iter().copied().filter(|effect| !another.effects.contains(effect));
            lacking.next().filter(|_| lacking.next().is_none())
        };
        Some([lacking(self, other)?, lacking(other, self)?])
    }

    /// What steps from here make of squared residuals where slopes hold.
    #[must_use]
    pub fn quadratic(&self) -> Quadratic {
        Quadratic::new(&self.columns.iter().map(|column| column.as_slice()).collect::<Vec<_>>(), &self.residuals)
    }

    /// Deviation of a coordinate; 0 if it is not free.
    #[must_use]
    pub fn std(&self, c: usize) -> f64 {
        self.free.iter().position(|&f| f == c).map_or(0.0, |k| self.covariance[(k, k)].max(0.0).sqrt())
    }
}

/// Fits hypotheses to recordings.
pub struct Fitter<'a> {
    /// Recordings.
    pub rows: &'a dyn Observed,
    /// Numbers.
    pub coordinates: &'a Coordinates,
}

impl<'a> Fitter<'a> {
    /// Of recordings, by these numbers.
    #[must_use]
    pub fn new(rows: &'a dyn Observed, coordinates: &'a Coordinates) -> Self {
        Self { rows, coordinates }
    }
}

impl Fitter<'_> {
    /// Prior deviation of a coordinate under a hypothesis; `None` if it is not free.
    #[must_use]
    pub fn prior(&self, c: usize, effects: &[usize]) -> Option<f64> {
        let coordinate = self.coordinates.all[c];
        if effects.contains(&coordinate.effect) { Some(1.0) } else { coordinate.spike }
    }

    /// Free coordinates of a hypothesis.
    #[must_use]
    pub fn free(&self, effects: &[usize]) -> Vec<usize> {
        (0..self.coordinates.all.len()).filter(|&c| self.prior(c, effects).is_some()).collect()
    }

    /// How many of its tolerances a number of the nominal model is off; 0 for what the nominal model does not have.
    pub(super) fn strain(&self, c: usize, u: &[f64]) -> f64 {
        self.coordinates.all[c].spike.map_or(0.0, |spike| u[c].abs() / spike)
    }

    pub(super) fn scale(&self, c: usize) -> Scale {
        self.coordinates.parameter(c).scale
    }

    /// A coordinate over its prior deviation under a hypothesis, squared; 0 if it is not free.
    pub(super) fn over_prior_squared(&self, c: usize, u: f64, effects: &[usize]) -> f64 {
        self.prior(c, effects).map_or(0.0, |t| (u / t).powi(2))
    }

    /// Prior precisions of coordinates that are free under a hypothesis.
    #[must_use]
    pub fn precision(&self, free: &[usize], effects: &[usize]) -> DVector<f64> {
        DVector::from_iterator(free.len(), free.iter().filter_map(|&c| self.prior(c, effects)).map(|t| t.powi(-2)))
    }

    /// Exact residuals at a point.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn exact(&self, u: &[f64]) -> Result<Vec<f64>> {
        self.rows.residuals(&self.coordinates.settings(u), Links::RolledOut, &ALL)
    }

    /// Fits a hypothesis from a start by slopes of settled links. Those of `like` serve for the coordinates that are free there too, as long as
    /// they do not move far. `None` where nothing finite was found.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn fit(&self, effects: &[usize], start: &[f64], like: Option<&Hypothesis>) -> Result<Option<Hypothesis>> {
        self.fit_with(effects, start, like, Following::Settled)
    }

    /// As [`Self::fit`], with the numbers of how joints follow their cables treated as `following` says.
    ///
    /// # Errors
    /// As [`Self::fit`].
    pub fn fit_with(
        &self,
        effects: &[usize],
        start: &[f64],
        like: Option<&Hypothesis>,
        following: Following,
    ) -> Result<Option<Hypothesis>> {
        let mut effects = effects.to_vec();
        effects.sort_unstable();
        let free = self.free(&effects);
        let precision = self.precision(&free, &effects);
        let is_close = following == Following::AllRolledOut;
        let Some(mut at) = Descent::begun(self, &free, &precision, start, is_close)? else { return Ok(None) };
        let mut slopes = Slopes::begun(self, &effects, &free, start, like, following);
        let of_joints = slopes.of_joints();
        let steps = if following == Following::RolledOut { CLOSE_STEPS_MAX } else { STEPS_MAX };
        // What took more damping would take it again; slopes of rolled-out links cost more than such a step in vain.
        let remembers = matches!(following, Following::Settled | Following::Held);
        let mut holds = following == Following::Held;
        let mut information = DMatrix::zeros(0, 0);
        // What the fit had come to when slopes were last taken anew, and whether they are to be.
        let (mut renewed, mut renews): (Option<f64>, bool) = (None, false);
        for _ in 0..steps {
            slopes.take_anew(&at.u, renews)?;
            renews = false;
            let columns = slopes.columns();
            let model = Quadratic::new(&columns.iter().map(|column| column.as_slice()).collect::<Vec<_>>(), &at.residuals);
            let mut direction = at.direction(&model);
            information = model.information;
            if holds {
                direction.hold(&of_joints);
            }
            let Some(gained) = at.step(&direction, remembers)? else { return Ok(None) };
            if gained >= at.least() {
                continue;
            }
            if !holds && at.is_stuck() && !of_joints.is_empty() {
                // Slopes of settled links may promise what no step keeps, and keep the others from what they promise.
                holds = true;
            } else if renewed.is_none_or(|then| then - at.cost > RENEWED_MIN) && slopes.are_old(&at.u) {
                (renewed, renews) = (Some(at.cost), true);
            } else {
                break;
            }
            at.loosen();
        }
        at.settle_on_miscounts()?;
        let Descent { u, residuals, cost, .. } = at;
        let Some((evidence, covariance)) = evidence(&information, &precision, cost) else { return Ok(None) };
        let columns = slopes.columns();
        let mut hypothesis = Hypothesis { effects, u, free, covariance, cost, evidence, raised: 0.0, is_close, residuals, columns };
        hypothesis.evidence += self.beyond_normal(&hypothesis.effects, &|c| hypothesis.u[c], &|c| hypothesis.std(c));
        Ok(Some(hypothesis))
    }

    /// The moment next to that of a coordinate, if it is one, at which readings alone show a miscount: slopes know of it by what tips see before and
    /// after.
    pub(super) fn nearest_miscount(&self, c: usize, u: f64) -> Option<f64> {
        if !matches!(self.scale(c), Scale::Moment) {
            return None;
        }
        let seen = self.rows.miscounts(self.coordinates.sited[self.coordinates.all[c].effect].joint_measured());
        seen.iter().copied().min_by(|a, b| (a - u).abs().total_cmp(&(b - u).abs()))
    }

    /// The coordinate after a step from `u`: not through zero where the number cannot be negative, not out of the recording, not too far at once.
    #[must_use]
    pub fn stepped(&self, c: usize, u: f64, step: f64) -> f64 {
        let scale = self.scale(c);
        // Beyond these it would have no slope, and what is believed of it would lead it far back.
        let [least, largest] = scale.limits_u();
        match scale {
            // At zero it would have none either.
            Scale::Magnitude(_) | Scale::Part => (u + step.clamp(-STEP_MAX, STEP_MAX)).clamp(MAGNITUDE_MIN, largest),
            Scale::Shape { .. } => (u + step.clamp(-SHAPE_STEP_MAX, SHAPE_STEP_MAX)).clamp(-MILDEST, MILDEST),
            Scale::Whole { .. } => u,
            Scale::Moment => (u + step.clamp(-MOMENT_STEP_MAX, MOMENT_STEP_MAX)).clamp(least, largest),
            Scale::State { .. } => (u + step).clamp(least, largest),
            Scale::Offset(_) => u + step,
            Scale::Factor { .. } => (u + step.clamp(-STEP_MAX, STEP_MAX)).min(largest),
        }
    }

    /// What priors that are not normal add to the evidence [nat], at `u` with posterior deviations `std`: those of sizes ([`sizes`]), of which
    /// a magnitude's are above zero, where part of the posterior is cut away, and some factors below one; and of one among whole numbers or
    /// moments.
    #[must_use]
    pub fn beyond_normal(&self, effects: &[usize], u: &dyn Fn(usize) -> f64, std: &dyn Fn(usize) -> f64) -> f64 {
        let of_effect = |&effect: &usize| {
            let found: Vec<(f64, f64)> = self.coordinates.sizes(effect).map(|c| (u(c), std(c))).collect();
            let magnitudes = self.coordinates.sizes(effect).filter(|&c| matches!(self.scale(c), Scale::Magnitude(_) | Scale::Part));
            // One of so many, or any, which the normal prior of `u` says nothing of.
            let one_of = |c: usize| match self.scale(c) {
                Scale::Whole { most } => 0.5 * u(c).powi(2) - f64::from(most).ln(),
                Scale::Moment => sizes::moment_beyond_normal(u(c), std(c)),
                Scale::Factor { above: Above::Seldom, .. } => sizes::side_beyond_normal(u(c), std(c)),
                _ => 0.0,
            };
            let uniform: f64 = self.coordinates.of(effect).map(one_of).sum();
            let above_zero: f64 = magnitudes.map(|c| (2.0 * normal_cdf(u(c) / std(c)).max(f64::MIN_POSITIVE)).ln()).sum();
            sizes::beyond_normal(&found) + uniform + above_zero
        };
        effects.iter().map(of_effect).sum()
    }
}

/// Does several things side by side, in their order; those that come to nothing are left out.
pub(super) fn side_by_side<'a, J, T>(jobs: &'a [J], work: impl Fn(&'a J) -> Result<Option<T>> + Send + Sync) -> Result<Vec<T>>
where
    J: Sync,
    T: Send,
{
    let done: Result<Vec<Option<T>>> = jobs.par_iter().map(work).collect();
    Ok(done?.into_iter().flatten().collect())
}

/// `F` [nat] of residuals at `u`, by the prior precisions of the coordinates that are free.
pub(super) fn cost(free: &[usize], precision: &DVector<f64>, u: &[f64], residuals: &[f64]) -> f64 {
    let prior: f64 = free.iter().zip(precision.iter()).map(|(&c, p)| p * u[c] * u[c]).sum();
    0.5 * (dot(residuals, residuals) + prior)
}
