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

use nalgebra::{DMatrix, DVector};

/// Most probable step, its covariance, and the evidence.
#[derive(Debug, Clone)]
pub struct Fit {
    /// `d`.
    pub step: DVector<f64>,
    /// `(A + L)^-1`.
    pub covariance: DMatrix<f64>,
    /// `ln Z` [nat], up to a constant of the data.
    pub evidence: f64,
    /// `|r - J d|^2`.
    pub left: f64,
}

/// Normal equations of slopes and residuals.
#[derive(Debug, Clone)]
pub struct Normal {
    /// `J'J`.
    pub information: DMatrix<f64>,
    /// `J'r`.
    pub score: DVector<f64>,
    /// `r'r`.
    pub square: f64,
}

impl Normal {
    /// Of columns and residuals, of which `rows` count.
    #[must_use]
    pub fn new(columns: &[&[f64]], residuals: &[f64]) -> Self {
        let n = columns.len();
        let mut information = DMatrix::zeros(n, n);
        for a in 0..n {
            for b in 0..=a {
                let product = dot(columns[a], columns[b]);
                information[(a, b)] = product;
                information[(b, a)] = product;
            }
        }
        let score = DVector::from_iterator(n, columns.iter().map(|column| dot(column, residuals)));
        Self { information, score, square: dot(residuals, residuals) }
    }

    /// The fit at `u` with prior deviations `t`.
    #[must_use]
    pub fn fit(&self, u: &[f64], t: &[f64]) -> Option<Fit> {
        let n = u.len();
        let precision = DVector::from_iterator(n, t.iter().map(|t| t.powi(-2)));
        let u = DVector::from_column_slice(u);
        let factor = (&self.information + DMatrix::from_diagonal(&precision)).cholesky()?;
        let step = factor.solve(&(&self.score - precision.component_mul(&u)));
        let left = self.square - 2.0 * step.dot(&self.score) + step.dot(&(&self.information * &step));
        let moved = &u + &step;
        let prior = moved.component_mul(&moved).dot(&precision);
        let volume = 2.0 * factor.l().diagonal().map(f64::ln).sum() - precision.map(f64::ln).sum();
        let evidence = -0.5 * (left + prior + volume);
        evidence.is_finite().then(|| Fit { step, covariance: factor.inverse(), evidence, left })
    }
}

/// Scalar product.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn evidence_is_the_density_of_the_data() {
        // r = J d + noise is normal with covariance 1 + J T J'.
        let columns = [[1.0, 0.5, -0.3, 0.2], [0.1, -1.0, 0.7, 2.0]];
        let residuals = [0.7, -1.2, 0.4, 2.5];
        let t = [0.5, 2.0];
        let borrowed: Vec<&[f64]> = columns.iter().map(|c| c.as_slice()).collect();
        let fit = Normal::new(&borrowed, &residuals).fit(&[0.0, 0.0], &t).unwrap();
        let mut covariance = DMatrix::<f64>::identity(4, 4);
        for (column, t) in columns.iter().zip(t) {
            let column = DVector::from_column_slice(column);
            covariance += &column * column.transpose() * t * t;
        }
        let r = DVector::from_column_slice(&residuals);
        let density = -0.5 * (r.dot(&(covariance.clone().try_inverse().unwrap() * &r)) + covariance.determinant().ln());
        assert_relative_eq!(fit.evidence, density, epsilon = 1e-10);
    }
}
