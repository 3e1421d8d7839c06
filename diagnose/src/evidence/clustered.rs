//! Deviations that hold where residuals are alike over time, as those of a model that is not quite right are.
//!
//! ```text
//! cov = H^-1 (f sum_b g_b g_b' + L) H^-1,   H = J'J + L,   g_b = J_b' r_b,   f = B / (B - tr(H^-1 J'J))
//! ```
//!
//! The sandwich of Huber 1967 and White 1980 over blocks `b` of time (Liang and Zeger 1986): what the residuals of a block add up to takes
//! the place of what they should by their stated deviations. `L` is the prior's precision, `f` makes up for what the fit took out of `B`
//! blocks.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::fit::{Fitter, Hypothesis, gram};
use super::linear::dot;

/// Rows of a block: two seconds of tips at fifteen a second and of torque samples at fifty, three components each.
const TIP_BLOCK: usize = 3 * 30;
const TORQUE_BLOCK: usize = 3 * 100;
/// Blocks beyond what a fit takes out, below which they say nothing.
const SPARE_MIN: f64 = 4.0;

/// Covariances of the minimum of `(|r|^2 + |u / t|^2) / 2` from residuals and slopes there: by the stated noise, and by blocks of rows, where
/// there are enough of them. `None` where nothing holds the minimum.
#[must_use]
pub fn covariances(columns: &[&[f64]], residuals: &[f64], precision: &DVector<f64>, blocks: &[Range<usize>]) -> Option<[DMatrix<f64>; 2]> {
    let information = gram(columns);
    let bread = (&information + DMatrix::from_diagonal(precision)).cholesky()?.inverse();
    let spare = blocks.len() as f64 - (&bread * &information).trace();
    if spare < SPARE_MIN {
        return Some([bread.clone(), bread]);
    }
    let mut scores = DMatrix::zeros(columns.len(), columns.len());
    for block in blocks {
        let score = |column: &&[f64]| column.get(block.clone()).zip(residuals.get(block.clone())).map_or(0.0, |(j, r)| dot(j, r));
        let score = DVector::from_iterator(columns.len(), columns.iter().map(score));
        scores.ger(blocks.len() as f64 / spare, &score, &score, 1.0);
    }
    let clustered = &bread * (scores + DMatrix::from_diagonal(precision)) * &bread;
    Some([bread, clustered])
}

impl Fitter<'_> {
    /// Rows by blocks of time, tips before torques, where residuals say something.
    #[must_use]
    pub fn blocks(&self, residuals: &[f64]) -> Vec<Range<usize>> {
        let (rows, tip_rows) = (residuals.len(), self.rows.tip_rows());
        let says = |block: &Range<usize>| residuals[block.clone()].iter().any(|r| *r != 0.0);
        let blocks = |from: usize, to: usize, length: usize| (from..to).step_by(length).map(move |start| start..(start + length).min(to));
        blocks(0, tip_rows, TIP_BLOCK).chain(blocks(tip_rows, rows, TORQUE_BLOCK)).filter(says).collect()
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
        let [stated, clustered] = covariances(columns, residuals, precision, &self.blocks(residuals))?;
        Some((0..columns.len()).map(|k| stated[(k, k)].max(clustered[(k, k)]).max(0.0).sqrt()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Root mean square of the estimate of a slope over its stated deviation: of the clustered covariance, and of the stated noise.
    fn scatter_over_stated(carry: f64) -> [f64; 2] {
        const ROWS: usize = 3000;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let column: Vec<f64> = (0..ROWS).map(|k| (k as f64 / 400.0).sin()).collect();
        let precision = DVector::from_element(1, 1e-9);
        let blocks: Vec<_> = (0..ROWS).step_by(90).map(|start| start..(start + 90).min(ROWS)).collect();
        let mut squares = [0.0; 2];
        let trials = 400;
        for _ in 0..trials {
            let mut noise: f64 = 0.0;
            let push = (1.0 - carry * carry).sqrt();
            let seen: Vec<f64> = column
                .iter()
                .map(|_| {
                    let fresh: f64 = StandardNormal.sample(&mut rng);
                    noise = carry * noise + push * fresh;
                    noise
                })
                .collect();
            let found = dot(&column, &seen) / dot(&column, &column);
            let residuals: Vec<f64> = seen.iter().zip(&column).map(|(y, x)| y - found * x).collect();
            let [_, clustered] = covariances(&[&column], &residuals, &precision, &blocks).unwrap();
            squares[0] += found * found / clustered[(0, 0)];
            squares[1] += found * found * dot(&column, &column);
        }
        squares.map(|sum| (sum / f64::from(trials)).sqrt())
    }

    #[test]
    fn deviations_are_what_estimates_scatter_by() {
        let [clustered, stated] = scatter_over_stated(0.0);
        assert!((0.85..1.2).contains(&clustered) && (0.9..1.1).contains(&stated), "{clustered} {stated}");
        let [clustered, stated] = scatter_over_stated(0.9);
        assert!((0.85..1.3).contains(&clustered) && stated > 3.0, "{clustered} {stated}");
    }

    #[test]
    fn a_tight_prior_stays_and_few_blocks_say_nothing() {
        let column = vec![1.0; 100];
        let residuals: Vec<f64> = (0..100).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let blocks: Vec<_> = (0..100).step_by(10).map(|start| start..start + 10).collect();
        let [_, tight] = covariances(&[&column], &residuals, &DVector::from_element(1, 1e8), &blocks).unwrap();
        approx::assert_relative_eq!(tight[(0, 0)], 1e-8, max_relative = 1e-4);
        let [stated, few] = covariances(&[&column], &residuals, &DVector::from_element(1, 1e-3), &blocks[..4]).unwrap();
        assert_eq!(stated, few);
    }
}
