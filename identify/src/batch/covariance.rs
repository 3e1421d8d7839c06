//! How far the estimate may be from the truth: a sandwich over blocks of time, with the prior and the held unknowns in it.
//!
//! Residuals are not white: hysteresis, latency and the cameras' flaws last. With the information `A` of all residuals, `A_b` and the
//! score `g_b` of a block, and the prior `N(0, 1)`, `H = A + 1`, the error has three independent parts:
//!
//! ```text
//! noise   sum_b d_b d_b',  d_b = (H - A_b)^-1 (g_b - mean g)      jackknife over blocks (MacKinnon and White 1985, by clusters)
//! prior   H^-1 H^-1                                              the prior's own error, as far as the data leave it
//! held    S S',  S = -H^-1 A_free,held                            unknowns kept at their prior (consider covariance; Tapley, Schutz,
//!                                                                 Born 2004, section 6)
//! ```
//!
//! Few blocks may show too little noise by chance, so the sandwich over single residuals bounds it from below; one block shows none, and
//! that sandwich is all there is. Blocks are hardly more than unknowns, and scatter in too few directions to tell how these hang together: correlations
//! are those of `H^-1 + S S'`.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::gauss_newton::{Jacobian, Minimum};

/// Information at a minimum, and how the blocks' scores scatter.
#[derive(Debug, Clone)]
pub struct Curvature {
    /// `A`, over all unknowns.
    information: DMatrix<f64>,
    /// `A_b` and `g_b - mean g` of each block.
    blocks: Vec<(DMatrix<f64>, DVector<f64>)>,
    /// `sum g_i g_i'` over single residuals.
    single: DMatrix<f64>,
}

impl Curvature {
    /// At a minimum. `block` numbers the block of each residual, from 0 on.
    #[must_use]
    pub fn new(minimum: &Minimum, jacobian: &Jacobian, block: &[usize], tempering: f64) -> Self {
        let n = jacobian.len();
        let zeros = || (DMatrix::zeros(n, n), DVector::zeros(n));
        let mut blocks: Vec<_> = (0..block.last().map_or(0, |last| last + 1)).map(|_| zeros()).collect();
        let mut single = DMatrix::zeros(n, n);
        for (i, (residual, &b)) in minimum.residuals.iter().zip(block).enumerate() {
            let weight = minimum.loss.weight(residual) / tempering;
            let curvature = minimum.loss.curvature(residual) / tempering;
            let along = DVector::from_iterator(n, jacobian.iter().map(|column| column[i].dot(residual)));
            let (information, score) = &mut blocks[b];
            for k in 0..n {
                for l in 0..n {
                    information[(k, l)] += weight * jacobian[k][i].dot(&jacobian[l][i]) + curvature * along[k] * along[l];
                }
            }
            score.axpy(weight, &along, 1.0);
            single.ger(weight * weight, &along, &along, 1.0);
        }
        let information = blocks.iter().fold(DMatrix::zeros(n, n), |sum, (a, _)| sum + a);
        let mean = blocks.iter().fold(DVector::zeros(n), |sum, (_, g)| sum + g) / blocks.len().max(1) as f64;
        blocks.iter_mut().for_each(|(_, g)| *g -= &mean);
        Self { information, blocks, single }
    }

    /// Scatter of the blocks' scores against that of independent residuals, which is 1.
    #[must_use]
    pub fn overdispersion(&self, free: &[usize]) -> f64 {
        let Some(posterior) = self.posterior(free) else { return 1.0 };
        let expected = posterior.solve(&self.information.select_rows(free).select_columns(free)).trace();
        let scatter: f64 = self.blocks.iter().map(|(_, g)| g.select_rows(free)).map(|g| g.dot(&posterior.solve(&g))).sum();
        // The scores add up to what the prior pulls, so each determined unknown takes one block's worth of scatter away.
        let count = self.blocks.len() as f64;
        let left = (count - expected).max(count / 3.0);
        scatter / expected * count / left
    }

    /// Covariance of the unknowns in `free`, in prior deviations, while those in `held` stay at their prior.
    #[must_use]
    pub fn covariance(&self, free: &[usize], held: &[usize]) -> DMatrix<f64> {
        let n = free.len();
        let Some(posterior) = self.posterior(free) else { return DMatrix::identity(n, n) };
        let inverse = posterior.inverse();
        let singly = (&inverse * self.single.select_rows(free).select_columns(free) * &inverse).diagonal();
        let mut by_blocks = DVector::zeros(n);
        for (information, score) in &self.blocks {
            let rest = self.with_prior(free) - information.select_rows(free).select_columns(free);
            let Some(shift) = rest.lu().solve(&score.select_rows(free)) else { continue };
            by_blocks += shift.component_mul(&shift);
        }
        let moved = &inverse * self.information.select_rows(free).select_columns(held);
        let of_held = &moved * moved.transpose();
        let std = (singly.zip_map(&by_blocks, f64::max) + (&inverse * &inverse).diagonal() + of_held.diagonal()).map(f64::sqrt);
        let by_information = inverse + of_held;
        let correlation = |k: usize, l: usize| by_information[(k, l)] / (by_information[(k, k)] * by_information[(l, l)]).sqrt();
        DMatrix::from_fn(n, n, |k, l| std[k] * std[l] * correlation(k, l))
    }

    /// Standard deviations of the unknowns in `free` if residuals scatter as their covariance says.
    #[must_use]
    pub fn std_by_information(&self, free: &[usize]) -> DVector<f64> {
        self.posterior(free).map_or_else(|| DVector::repeat(free.len(), 1.0), |posterior| posterior.inverse().diagonal().map(f64::sqrt))
    }

    fn with_prior(&self, free: &[usize]) -> DMatrix<f64> {
        self.information.select_rows(free).select_columns(free) + DMatrix::identity(free.len(), free.len())
    }

    /// `H`, factored.
    fn posterior(&self, free: &[usize]) -> Option<Cholesky<f64, Dyn>> {
        self.with_prior(free).cholesky()
    }
}
