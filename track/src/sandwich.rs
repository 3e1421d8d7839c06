//! How far off a fitted centre is where errors are independent, but of a size that nobody knows: as the residuals say.
//!
//! With whitened residuals `z_i` and `a_i` what one of them moves the centre by,
//!
//! ```text
//! covariance = sum_i a_i a_i' z_i^2 / (1 - h_i)^2,   h_i = j_i' V j_i,   a_i = V j_i
//! ```
//!
//! `j_i` the whitened derivatives and `V` the covariance of the unknowns by the fit. A fit takes up the part `h_i` of an error, which the last
//! factor gives back: nearly what leaving one out after the other gives, and better than less of it where there are few (HC3 of MacKinnon
//! and White 1985, Some heteroskedasticity-consistent covariance matrix estimators with improved finite sample properties, eq. 12).

use nalgebra::Matrix2;

/// Least part of an error that a residual is taken to keep.
const LEAST_LEFT: f32 = 0.25;

/// The sum so far.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sandwich {
    across: f32,
    in_common: f32,
    down: f32,
}

impl Sandwich {
    /// A whitened residual with its leverage `h`, and what it would move the centre by if it were 1 [px].
    #[inline(always)]
    pub(crate) fn add(&mut self, residual: f32, leverage: f32, moves_px: [f32; 2]) {
        let error = residual / (1.0 - leverage).max(LEAST_LEFT);
        let [across, down] = moves_px.map(|moves_px| moves_px * error);
        self.across += across * across;
        self.in_common += across * down;
        self.down += down * down;
    }

    /// Covariance of the centre [px^2].
    pub(crate) fn covariance_px2(&self) -> Matrix2<f64> {
        Matrix2::new(self.across, self.in_common, self.in_common, self.down).map(f64::from)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, SMatrix, SVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const COUNT: usize = 40;

    #[test]
    fn the_unknowns_scatter_as_claimed_whatever_the_errors_sizes() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let derivatives = SMatrix::<f64, COUNT, 3>::from_fn(|_, _| random.random_range(-1.0..1.0));
        // Those that tell most of the first unknown err most: a fit that takes all as alike claims half of its variance.
        let size = SVector::<f64, COUNT>::from_fn(|i, _| 0.2 + 2.0 * derivatives[(i, 0)].powi(2));
        let by_fit: Matrix3<f64> = (derivatives.transpose() * derivatives).try_inverse().unwrap();
        let moves = by_fit * derivatives.transpose();
        let (mut scatter, mut claimed, draws) = (Matrix2::zeros(), Matrix2::zeros(), 4000);
        for _ in 0..draws {
            let errors = SVector::<f64, COUNT>::from_fn(|i, _| {
                let normal: f64 = StandardNormal.sample(&mut random);
                size[i] * normal
            });
            let off = moves * errors;
            let residuals = errors - derivatives * off;
            let mut sandwich = Sandwich::default();
            for i in 0..COUNT {
                let leverage = (derivatives.row(i) * moves.column(i)).x;
                sandwich.add(residuals[i] as f32, leverage as f32, [moves[(0, i)], moves[(1, i)]].map(|moves| moves as f32));
            }
            let off = off.fixed_rows::<2>(0);
            scatter += off * off.transpose() / f64::from(draws);
            claimed += sandwich.covariance_px2() / f64::from(draws);
        }
        for axis in 0..2 {
            let ratio = scatter[(axis, axis)] / claimed[(axis, axis)];
            // It errs to the safe side, by the leverages: 3 in 40 here.
            assert!((0.8..1.05).contains(&ratio), "axis {axis}: {ratio}, {scatter} {claimed}");
        }
    }
}
