//! Normal equations of one Gauss-Newton step, `(J' W J + P) step = J' W miss + P (prior - x)`, from [`LANES`] pixels at a time.

use crate::centre::{Matrix, SIZE, Vector};
use crate::model::Told;
use crate::patch::{LANES, Lanes};

/// Sums over pixels, each lane's apart.
pub(crate) struct Normal {
    /// Upper triangle.
    matrix: [[Lanes; SIZE]; SIZE],
    vector: [Lanes; SIZE],
}

impl Normal {
    pub(crate) const ZERO: Self = Self { matrix: [[[0.0; LANES]; SIZE]; SIZE], vector: [[0.0; LANES]; SIZE] };

    #[inline(always)]
    pub(crate) fn add(&mut self, told: &Told, weights: &Lanes) {
        for i in 0..SIZE {
            let weighted = product(&told.rows[i], weights);
            add_product(&mut self.vector[i], &weighted, &told.miss);
            for j in i..SIZE {
                add_product(&mut self.matrix[i][j], &weighted, &told.rows[j]);
            }
        }
    }

    /// The step and the covariance, where a prior of this stiffness is so far away.
    pub(crate) fn solve(&self, stiffness: &Vector, to_prior: &Vector) -> Option<(Vector, Matrix)> {
        let sum = |lanes: &Lanes| lanes.iter().copied().map(f64::from).sum::<f64>();
        let matrix = Matrix::from_fn(|i, j| sum(&self.matrix[i.min(j)][i.max(j)])) + Matrix::from_diagonal(stiffness);
        let vector = Vector::from_fn(|i, _| sum(&self.vector[i]));
        let covariance = matrix.cholesky()?.inverse();
        let step = covariance * (vector + stiffness.component_mul(to_prior));
        step.iter().all(|v| v.is_finite()).then_some((step, covariance))
    }
}

#[inline(always)]
fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut product = *a;
    for (product, b) in product.iter_mut().zip(b) {
        *product *= b;
    }
    product
}

#[inline(always)]
fn add_product(sum: &mut Lanes, a: &Lanes, b: &Lanes) {
    for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
        *sum += a * b;
    }
}
