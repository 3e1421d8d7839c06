//! Deviations that hold where residuals are alike over time, as those of a model that is not quite right are.
//!
//! ```text
//! cov = H^-1 (sum_b g_b g_b' + L) H^-1,   H = J'J + L,   g_b = J_b' r_b
//! ```
//!
//! The sandwich of Huber 1967 and White 1980 over blocks `b` of time (Liang and Zeger 1986): what the residuals of a block add up to takes
//! the place of what they should by their stated deviations. `L` is the prior's precision. The fit has taken part of the noise out of every
//! block: of white noise of the stated deviations is left `E(g_b g_b') = M_b - M_b H^-1 M_b`, with `M_b = J_b' J_b` in place of `M_b` (Bell and
//! McCaffrey 2002). Each variance is corrected by the ratio of the two along its own direction.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::evidence::fit::linear::{dot, gram};
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::recorded::data::STRIDE_S;

/// Length of a block of torque samples, and of a bench's joints [s].
pub const BLOCK_S: f64 = 2.0;
/// Part of the noise along a direction that a fit may take out of blocks, above which they say nothing of it.
const TAKEN_OUT_MAX: f64 = 0.75;

/// Variances of the minimum of `(|r|^2 + |u / t|^2) / 2` from residuals and slopes there: by the stated noise, and by blocks of rows, where
/// these say something. `None` where nothing holds the minimum.
#[must_use]
pub fn variances(columns: &[&[f64]], residuals: &[f64], precision: &DVector<f64>, blocks: &[Range<usize>]) -> Option<Vec<[f64; 2]>> {
    let count = columns.len();
    let prior = DMatrix::from_diagonal(precision);
    let bread = (gram(columns) + &prior).cholesky()?.inverse();
    // Scores as they are, and as white noise would have them before and after the fit.
    let [mut scores, mut white, mut left] = [(); 3].map(|()| DMatrix::zeros(count, count));
    for block in blocks {
        let rows: Vec<&[f64]> = columns.iter().map(|column| column.get(block.clone()).unwrap_or_default()).collect();
        let residuals = residuals.get(block.clone()).unwrap_or_default();
        let score = DVector::from_iterator(count, rows.iter().map(|row| dot(row, residuals)));
        scores.ger(1.0, &score, &score, 1.0);
        let information = gram(&rows);
        left += &information - &information * &bread * &information;
        white += information;
    }
    let of_coordinate = |k: usize| {
        let along = bread.column(k);
        let of = |matrix: &DMatrix<f64>| along.dot(&(matrix * along));
        let kept = of(&left) / of(&white);
        let clustered = if kept > 1.0 - TAKEN_OUT_MAX { of(&scores) / kept + of(&prior) } else { bread[(k, k)] };
        [bread[(k, k)], clustered]
    };
    Some((0..count).map(of_coordinate).collect())
}

impl Fitter<'_> {
    /// Rows by blocks of time, tips before torques, where residuals say something.
    #[must_use]
    pub fn blocks(&self, residuals: &[f64]) -> Vec<Range<usize>> {
        let (rows, tip_rows) = (residuals.len(), self.rows.tip_rows());
        let says = |block: &Range<usize>| residuals[block.clone()].iter().any(|r| *r != 0.0);
        let blocks = |from: usize, to: usize, length: usize| (from..to).step_by(length).map(move |start| start..(start + length).min(to));
        let torque_block = 3 * (BLOCK_S / STRIDE_S).round() as usize;
        blocks(0, tip_rows, self.rows.tip_block()).chain(blocks(tip_rows, rows, torque_block)).filter(says).collect()
    }

    /// Deviations of the free coordinates of a hypothesis, what it leaves taken for noise: a model that is not quite right errs alike in every
    /// block.
    #[must_use]
    pub fn deviations(&self, hypothesis: &Hypothesis) -> Vec<f64> {
        let (leftover, tip_rows) = (self.leftover(hypothesis), self.rows.tip_rows());
        let columns: Vec<Vec<f64>> = hypothesis.columns.iter().map(|column| leftover.weighted(column, tip_rows)).collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let residuals = leftover.weighted(&hypothesis.residuals, tip_rows);
        let scatter = self.scatter(&columns, &residuals, &self.precision(&hypothesis.free, &hypothesis.effects));
        scatter.unwrap_or_else(|| hypothesis.free.iter().map(|&c| hypothesis.std(c)).collect())
    }

    /// Deviations of numbers with these slopes and prior precisions: by the stated noise or by what residuals are like, whichever is larger.
    /// `None` where nothing holds them.
    pub(super) fn scatter(&self, columns: &[&[f64]], residuals: &[f64], precision: &DVector<f64>) -> Option<Vec<f64>> {
        let variances = variances(columns, residuals, precision, &self.blocks(residuals))?;
        Some(variances.into_iter().map(|[stated, clustered]| stated.max(clustered).max(0.0).sqrt()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const ROWS: usize = 3000;

    fn blocks() -> Vec<Range<usize>> {
        (0..ROWS).step_by(90).map(|start| start..(start + 90).min(ROWS)).collect()
    }

    /// Root mean square of the estimates of slopes over their stated deviations: by the stated noise, and by blocks. Each sample carries on
    /// part of the one before.
    fn scatter_over_stated(slopes: usize, carry: f64) -> [f64; 2] {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let column = |k: usize| (0..ROWS).map(|i| (i as f64 * (k + 1) as f64 / 400.0 + k as f64).sin()).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..slopes).map(column).collect();
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let inverse = gram(&columns).cholesky().unwrap().inverse();
        let precision = DVector::from_element(slopes, 1e-9);
        let mut squares = [0.0; 2];
        let trials = 200;
        for _ in 0..trials {
            let mut noise: f64 = 0.0;
            let push = (1.0 - carry * carry).sqrt();
            let seen: Vec<f64> = (0..ROWS)
                .map(|_| {
                    let fresh: f64 = StandardNormal.sample(&mut rng);
                    noise = carry * noise + push * fresh;
                    noise
                })
                .collect();
            let found = &inverse * DVector::from_iterator(slopes, columns.iter().map(|column| dot(column, &seen)));
            let fitted = |i: usize| columns.iter().zip(found.iter()).map(|(column, found)| column[i] * found).sum::<f64>();
            let residuals: Vec<f64> = seen.iter().enumerate().map(|(i, y)| y - fitted(i)).collect();
            let variances = variances(&columns, &residuals, &precision, &blocks()).unwrap();
            for (found, variance) in found.iter().zip(variances) {
                squares.iter_mut().zip(variance).for_each(|(square, variance)| *square += found * found / variance);
            }
        }
        squares.map(|sum| (sum / (trials * slopes) as f64).sqrt())
    }

    #[test]
    fn deviations_are_what_estimates_scatter_by() {
        // Of one slope, and of as many as there are blocks.
        for slopes in [1, 30] {
            let [stated, clustered] = scatter_over_stated(slopes, 0.0);
            assert!((0.85..1.2).contains(&clustered) && (0.9..1.1).contains(&stated), "{slopes}: {clustered} {stated}");
            let [stated, clustered] = scatter_over_stated(slopes, 0.9);
            assert!((0.85..1.3).contains(&clustered) && stated > 3.0, "{slopes}: {clustered} {stated}");
        }
    }

    #[test]
    fn a_tight_prior_stays_and_one_block_says_nothing() {
        let column: Vec<f64> = (0..ROWS).map(|i| if i < 90 { 1.0 } else { 0.0 }).collect();
        let residuals: Vec<f64> = (0..ROWS).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let [stated, of_one] = variances(&[&column], &residuals, &DVector::from_element(1, 1e-3), &blocks()).unwrap()[0];
        assert_eq!(stated, of_one);
        let [_, tight] = variances(&[&column], &residuals, &DVector::from_element(1, 1e8), &blocks()).unwrap()[0];
        approx::assert_relative_eq!(tight, 1e-8, max_relative = 1e-4);
    }
}
