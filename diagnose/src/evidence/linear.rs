//! Evidence of a model that is linear about a point, with normal priors.
//!
//! With residuals `r` and slopes `J` at `u`, priors `N(0, t^2)` on `u + d`, `A = J'J`, `L = diag(t^-2)`:
//!
//! ```text
//! d = (A + L)^-1 (J' r - L u)
//! ln Z = -|r - J d|^2 / 2 - |(u + d) / t|^2 / 2 - ln det(A + L) / 2 + ln det L / 2
//! ```
//!
//! (Laplace's approximation, exact here; MacKay 2003, chapter 27.)

use nalgebra::{DMatrix, DVector, DVectorView};

/// Scalar product of as many numbers as both have.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // nalgebra's has several sums, which do not wait for each other.
    let n = a.len().min(b.len());
    DVectorView::from_slice(a, n).dot(&DVectorView::from_slice(b, n))
}

/// Evidence [nat], up to a constant of the data, and covariance, where the cost `(|r|^2 + |u / t|^2) / 2` has its minimum and slopes with
/// the information `A`.
#[must_use]
pub fn evidence(information: &DMatrix<f64>, precision: &DVector<f64>, cost: f64) -> Option<(f64, DMatrix<f64>)> {
    let factor = (information + DMatrix::from_diagonal(precision)).cholesky()?;
    let volume = 2.0 * factor.l().diagonal().map(f64::ln).sum() - precision.map(f64::ln).sum();
    let evidence = -cost - 0.5 * volume;
    evidence.is_finite().then(|| (evidence, factor.inverse()))
}

/// The step to the minimum of a linear model from `u`, and the cost there. `score` is `J' r`, `square` is `r' r`.
#[must_use]
pub fn minimum(
    information: &DMatrix<f64>,
    score: &DVector<f64>,
    square: f64,
    u: &DVector<f64>,
    precision: &DVector<f64>,
) -> Option<(DVector<f64>, f64)> {
    let factor = (information + DMatrix::from_diagonal(precision)).cholesky()?;
    let step = factor.solve(&(score - precision.component_mul(u)));
    let left = square - 2.0 * step.dot(score) + step.dot(&(information * &step));
    let moved = u + &step;
    let prior = moved.component_mul(&moved).dot(precision);
    Some((step, 0.5 * (left + prior)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::fit::gram;
    use approx::assert_relative_eq;

    #[test]
    fn evidence_is_the_density_of_the_data() {
        // r = J d + noise is normal with covariance 1 + J T J'.
        let columns = [[1.0, 0.5, -0.3, 0.2], [0.1, -1.0, 0.7, 2.0]];
        let residuals = [0.7, -1.2, 0.4, 2.5];
        let t = [0.5, 2.0];
        let borrowed: Vec<&[f64]> = columns.iter().map(|c| c.as_slice()).collect();
        let information = gram(&borrowed);
        let score = DVector::from_iterator(2, borrowed.iter().map(|c| dot(c, &residuals)));
        let precision = DVector::from_iterator(2, t.iter().map(|t: &f64| t.powi(-2)));
        let (_, cost) = minimum(&information, &score, dot(&residuals, &residuals), &DVector::zeros(2), &precision).unwrap();
        let (found, _) = evidence(&information, &precision, cost).unwrap();
        let mut covariance = DMatrix::<f64>::identity(4, 4);
        for (column, t) in columns.iter().zip(t) {
            let column = DVector::from_column_slice(column);
            covariance += &column * column.transpose() * t * t;
        }
        let r = DVector::from_column_slice(&residuals);
        let density = -0.5 * (r.dot(&(covariance.clone().try_inverse().unwrap() * &r)) + covariance.determinant().ln());
        assert_relative_eq!(found, density, epsilon = 1e-10);
    }
}
