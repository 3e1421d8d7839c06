//! Normal equations of one Gauss-Newton step, `(J' W J + P) step = J' W miss + P (prior - x)`, from
//! [`LANES`](crate::patch::LANES) pixels at a time.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use nalgebra::{Cholesky, Const};

use crate::centre::{Matrix, SIZE, Vector};
use crate::model::Told;

/// Sums over pixels, those of each lane apart.
pub(crate) struct Sums<S: Simd> {
    /// Upper triangle.
    matrix: [[f32x16<S>; SIZE]; SIZE],
    vector: [f32x16<S>; SIZE],
    square: f32x16<S>,
}

/// `J' W J`, `J' W miss` and `miss' W miss`.
pub(crate) struct Normal {
    matrix: Matrix,
    vector: Vector,
    pub(crate) square: f64,
}

impl<S: Simd> Sums<S> {
    #[inline(always)]
    pub(crate) fn zero(simd: S) -> Self {
        let zero = f32x16::splat(simd, 0.0);
        Self { matrix: [[zero; SIZE]; SIZE], vector: [zero; SIZE], square: zero }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, told: &Told<S>, weights: f32x16<S>) {
        self.square = (told.miss * weights).mul_add(told.miss, self.square);
        for i in 0..SIZE {
            let weighted = told.rows[i] * weights;
            self.vector[i] = weighted.mul_add(told.miss, self.vector[i]);
            for j in i..SIZE {
                self.matrix[i][j] = weighted.mul_add(told.rows[j], self.matrix[i][j]);
            }
        }
    }

    #[inline(always)]
    pub(crate) fn over_lanes(&self) -> Normal {
        let matrix = Matrix::from_fn(|i, j| f64::from(self.matrix[i.min(j)][i.max(j)].reduce_sum()));
        let vector = Vector::from_fn(|i, _| f64::from(self.vector[i].reduce_sum()));
        Normal { matrix, vector, square: f64::from(self.square.reduce_sum()) }
    }
}

impl Normal {
    /// From its parts.
    pub(crate) const fn new(matrix: Matrix, vector: Vector, square: f64) -> Self {
        Self { matrix, vector, square }
    }

    /// The step, where a prior of this stiffness is so far away, and the factors of the matrix, whose inverse is the covariance.
    pub(crate) fn solve(&self, stiffness: &Vector, to_prior: &Vector) -> Option<(Vector, Cholesky<f64, Const<SIZE>>)> {
        let factors = (self.matrix + Matrix::from_diagonal(stiffness)).cholesky()?;
        let step = factors.solve(&(self.vector + stiffness.component_mul(to_prior)));
        step.iter().all(|v| v.is_finite()).then_some((step, factors))
    }
}
