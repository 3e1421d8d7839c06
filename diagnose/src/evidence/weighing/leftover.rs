//! What a hypothesis leaves: by how much its residuals are larger, and more alike from one to the next, than their stated deviations.
//!
//! ```text
//! v_n = mean over blocks of n of (sum of r)^2 / n,   lambda = max over n of v_n / chi2_0.99
//! ```
//!
//! White residuals of unit variance have `v_n = 1` at every length. Evidence with variances `lambda` times the stated ones counts as many
//! samples as there are independent ones, and what no hypothesis explains as noise.

use nalgebra::{DVector, Vector3};
use raven::stats::chi_square_quantile;

use crate::evidence::fit::linear::{Quadratic, dot, evidence};
use crate::evidence::fit::{Fitter, Hypothesis};

/// Variance over what was stated beyond which something remains: stated deviations of tips are good to some ten per cent.
const REMAINS: f64 = 1.5;
/// Part of the misfit that effects have to account for, or they explain nothing.
pub const ACCOUNTED: f64 = 0.5;
/// Lengths of blocks: tips at some ten a second, torque samples fifty.
const TIP_BLOCKS: [usize; 4] = [1, 8, 30, 120];
const TORQUE_BLOCKS: [usize; 3] = [10, 50, 250];
/// A block sum is believed to be too large beyond this quantile.
const QUANTILE: f64 = 0.99;

/// Variance of residuals over what was stated, 1 at least.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leftover {
    /// Of tips.
    pub tip: f64,
    /// Of each joint's torque.
    pub torque: Vector3<f64>,
}

impl Leftover {
    /// As stated.
    #[must_use]
    pub fn none() -> Self {
        Self { tip: 1.0, torque: Vector3::repeat(1.0) }
    }

    /// Of residuals, tips before torques, three components each.
    #[must_use]
    pub fn of(residuals: &[f64], tip_rows: usize) -> Self {
        let (tips, torques) = residuals.split_at(tip_rows);
        let component = |rows: &[f64], j: usize| -> Vec<f64> { rows.iter().skip(j).step_by(3).copied().filter(|v| *v != 0.0).collect() };
        let tips: Vec<Vec<f64>> = (0..3).map(|j| component(tips, j)).collect();
        Self { tip: inflation(&tips, &TIP_BLOCKS), torque: Vector3::from_fn(|j, _| inflation(&[component(torques, j)], &TORQUE_BLOCKS)) }
    }

    /// Of the channel that has the most left.
    #[must_use]
    pub fn most(&self) -> f64 {
        self.tip.max(self.torque.max())
    }

    /// Whether something reproducible is left.
    #[must_use]
    pub fn remains(&self) -> bool {
        self.most() > REMAINS
    }

    /// Whitened rows, over deviations that are so much larger.
    #[must_use]
    pub fn weighted(&self, rows: &[f64], tip_rows: usize) -> Vec<f64> {
        let (tip, torque) = (self.tip.sqrt().recip(), self.torque.map(|v| v.sqrt().recip()));
        rows.iter().enumerate().map(|(k, v)| v * if k < tip_rows { tip } else { torque[(k - tip_rows) % 3] }).collect()
    }
}

fn inflation(components: &[Vec<f64>], lengths: &[usize]) -> f64 {
    let of_length = |&n: &usize| {
        let sums: Vec<f64> =
            components.iter().flat_map(|rows| rows.chunks_exact(n).map(|block| block.iter().sum::<f64>().powi(2))).collect();
        let expected = chi_square_quantile(sums.len(), QUANTILE)? * n as f64;
        Some(sums.iter().sum::<f64>() / expected)
    };
    lengths.iter().filter_map(of_length).fold(1.0, f64::max)
}

impl Fitter<'_> {
    /// What a hypothesis leaves.
    #[must_use]
    pub fn leftover(&self, hypothesis: &Hypothesis) -> Leftover {
        Leftover::of(&hypothesis.residuals, self.rows.tip_rows())
    }

    /// Part of what `none` leaves beyond noise, and strains its tolerances by, that a hypothesis accounts for; 0 where that is nothing. What it makes good
    /// counts below the stated noise too, which may be stated too large.
    #[must_use]
    pub fn accounted(&self, none: &Hypothesis, hypothesis: &Hypothesis) -> f64 {
        let strain = |h: &Hypothesis| h.free.iter().map(|&c| self.over_prior_squared(c, h.u[c], &h.effects)).sum::<f64>();
        let square = |h: &Hypothesis| dot(&h.residuals, &h.residuals);
        let rows = hypothesis.residuals.iter().filter(|r| **r != 0.0).count() as f64;
        let left = (square(hypothesis) - rows).max(0.0) + strain(hypothesis);
        let made_good = (square(none) + strain(none) - square(hypothesis) - strain(hypothesis)).max(0.0);
        if made_good > 0.0 { made_good / (made_good + left) } else { 0.0 }
    }

    /// Evidence of a hypothesis [nat] where variances are `leftover` times the stated ones, by its slopes where it was fitted: where numbers would
    /// move to as priors count for more, but for what the slopes promise of stated variances and the fit did not find.
    #[must_use]
    pub fn tempered(&self, hypothesis: &Hypothesis, leftover: &Leftover) -> f64 {
        if *leftover == Leftover::none() {
            return hypothesis.evidence;
        }
        let at = DVector::from_iterator(hypothesis.free.len(), hypothesis.free.iter().map(|&c| hypothesis.u[c]));
        let precision = self.precision(&hypothesis.free, &hypothesis.effects);
        let stated = Quadratic::new(&hypothesis.columns.iter().map(|column| column.as_slice()).collect::<Vec<_>>(), &hypothesis.residuals);
        let weighted = |rows: &[f64]| leftover.weighted(rows, self.rows.tip_rows());
        let columns: Vec<Vec<f64>> = hypothesis.columns.iter().map(|column| weighted(column)).collect();
        let model = Quadratic::new(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>(), &weighted(&hypothesis.residuals));
        let best = stated.minimum(&at, &precision).zip(model.minimum(&at, &precision)).and_then(|((_, promised), (_, cost))| {
            let not_found = (hypothesis.cost - promised).max(0.0) * model.square / stated.square;
            evidence(&model.information, &precision, cost + not_found)
        });
        let Some((found, covariance)) = best else { return f64::NEG_INFINITY };
        let std = |c: usize| hypothesis.free.iter().position(|&f| f == c).map_or(1.0, |k| covariance[(k, k)].sqrt());
        found + self.beyond_normal(&hypothesis.effects, &|c| hypothesis.u[c], &std) + hypothesis.raised
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::numbers::coordinates::Coordinates;
    use crate::evidence::recorded::rows::Links;
    use crate::evidence::tests::{Seen, fitted, tips};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn white_residuals_are_as_stated_and_wandering_ones_are_not() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let white: Vec<f64> = (0..6000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let of_white = Leftover::of(&white, 3000);
        assert!(of_white.tip < 1.1 && of_white.torque.max() < 1.1, "{of_white:?}");
        let mut state = [0.0; 3];
        let wandering: Vec<f64> = (0..6000)
            .map(|k| {
                let push: f64 = StandardNormal.sample(&mut rng);
                state[k % 3] = 0.9 * state[k % 3] + (1.0_f64 - 0.81).sqrt() * push;
                state[k % 3]
            })
            .collect();
        // An AR(1) of unit variance sums like (1 + a) / (1 - a) = 19 as many.
        let of_wandering = Leftover::of(&wandering, 6000);
        assert!((8.0..25.0).contains(&of_wandering.tip), "{of_wandering:?}");
    }

    #[test]
    fn what_is_accounted_for_is_a_part_whatever_noise_is_stated() {
        let rows = Seen::new(&[("joint-offset", [0, 0])], |_: &[Option<&[f64]>], _| tips(f64::sin));
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let leaving =
            |each: f64, offset: f64| Hypothesis { residuals: vec![each; 100], u: vec![offset], free: vec![0], ..fitted(vec![0], 0.0) };
        let accounted = |none, hypothesis| fitter.accounted(&none, &hypothesis);
        approx::assert_relative_eq!(accounted(leaving(2.0, 0.0), leaving(1.0, 0.0)), 1.0);
        approx::assert_relative_eq!(accounted(leaving(3.0, 0.0), leaving(2.0, 0.0)), 500.0 / 800.0);
        // Below it, an effect of three slabs makes good 30 where nothing but its own size is left.
        approx::assert_relative_eq!(accounted(leaving(0.8, 0.0), leaving(0.5, 3.0)), 30.0 / 39.0, epsilon = 1e-12);
        assert_eq!(accounted(leaving(0.5, 0.0), leaving(0.5, 3.0)), 0.0);
    }

    /// Settled links promise tens of nats of what rolled-out ones do not show; the fit ends where it began.
    #[test]
    fn evidence_does_not_jump_where_something_begins_to_be_left() {
        let rows = Seen::new(&[("joint-offset", [0, 0])], |numbers: &[Option<&[f64]>], links| {
            let offset = numbers[0].map_or(0.0, |u| u[0]);
            tips(|k| k.sin() * (1.0 - if links == Links::RolledOut { 0.0 } else { offset }))
        });
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let mut fitted = fitter.fit(&[rows.effect(&coordinates, 0)], &fitter.nowhere(), None).unwrap().unwrap();
        fitted.evidence += 7.0;
        fitted.raised += 7.0;
        let little = Leftover { tip: 1.0 + 1e-9, torque: Vector3::repeat(1.0) };
        approx::assert_relative_eq!(fitter.tempered(&fitted, &little), fitted.evidence, epsilon = 1e-3);
        // Noise of twice the variance makes half of the cost, which is hundreds of nats, and numbers wider.
        let twice = Leftover { tip: 2.0, torque: Vector3::repeat(1.0) };
        let wider = fitter.tempered(&fitted, &twice) - fitted.evidence - 0.5 * fitted.cost;
        assert!((0.0..3.0).contains(&wider), "{wider}");
    }
}
