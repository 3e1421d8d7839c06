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

/// `J'J` of columns.
#[must_use]
pub fn gram(columns: &[&[f64]]) -> DMatrix<f64> {
    let n = columns.len();
    let mut information = DMatrix::zeros(n, n);
    for a in 0..n {
        for b in 0..=a {
            let product = dot(columns[a], columns[b]);
            information[(a, b)] = product;
            information[(b, a)] = product;
        }
    }
    information
}

/// What a step `d` makes of squared residuals where slopes hold: `|r - J d|^2 = r'r - 2 d' J'r + d' A d`.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// `A = J'J`.
    pub information: DMatrix<f64>,
    /// `J'r`.
    pub score: DVector<f64>,
    /// `r'r`.
    pub square: f64,
}

impl Quadratic {
    /// Of slopes `J`, a column per number, and residuals `r`.
    #[must_use]
    pub fn new(columns: &[&[f64]], residuals: &[f64]) -> Self {
        let score = DVector::from_iterator(columns.len(), columns.iter().map(|column| dot(column, residuals)));
        Self { information: gram(columns), score, square: dot(residuals, residuals) }
    }

    /// The step to the minimum from `u`, and the cost there.
    #[must_use]
    pub fn minimum(&self, u: &DVector<f64>, precision: &DVector<f64>) -> Option<(DVector<f64>, f64)> {
        let Self { information, score, square } = self;
        let factor = (information + DMatrix::from_diagonal(precision)).cholesky()?;
        let step = factor.solve(&(score - precision.component_mul(u)));
        let left = square - 2.0 * step.dot(score) + step.dot(&(information * &step));
        let moved = u + &step;
        let prior = moved.component_mul(&moved).dot(precision);
        Some((step, 0.5 * (left + prior)))
    }

    /// The same where the first numbers make a given step and the others the best of it.
    #[must_use]
    pub fn minimum_beside(&self, first: &DVector<f64>, u: &DVector<f64>, precision: &DVector<f64>) -> Option<(DVector<f64>, f64)> {
        let (m, n) = (first.len(), u.len());
        let block = |row: usize, column: usize| {
            let length = |at: usize| if at == 0 { m } else { n - m };
            self.information.view((row, column), (length(row), length(column))).into_owned()
        };
        let first_score = self.score.rows(0, m);
        let others = Self {
            information: block(m, m),
            score: self.score.rows(m, n - m) - block(m, 0) * first,
            square: self.square - 2.0 * first_score.dot(first) + first.dot(&(block(0, 0) * first)),
        };
        let moved = u.rows(0, m) + first;
        let prior = 0.5 * moved.component_mul(&moved).dot(&precision.rows(0, m));
        let (rest, cost) = others.minimum(&u.rows(m, n - m).into_owned(), &precision.rows(m, n - m).into_owned())?;
        Some((DVector::from_iterator(n, first.iter().chain(rest.iter()).copied()), cost + prior))
    }
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
        let precision = DVector::from_iterator(2, t.iter().map(|t: &f64| t.powi(-2)));
        let model = Quadratic::new(&borrowed, &residuals);
        let (_, cost) = model.minimum(&DVector::zeros(2), &precision).unwrap();
        let (found, _) = evidence(&model.information, &precision, cost).unwrap();
        let mut covariance = DMatrix::<f64>::identity(4, 4);
        for (column, t) in columns.iter().zip(t) {
            let column = DVector::from_column_slice(column);
            covariance += &column * column.transpose() * t * t;
        }
        let r = DVector::from_column_slice(&residuals);
        let density = -0.5 * (r.dot(&(covariance.clone().try_inverse().unwrap() * &r)) + covariance.determinant().ln());
        assert_relative_eq!(found, density, epsilon = 1e-10);
    }

    #[test]
    fn numbers_beside_a_given_step_make_the_best_of_it() {
        let columns = [[1.0, 0.5, -0.3, 0.2], [0.1, -1.0, 0.7, 2.0], [0.4, 0.4, 1.0, -0.6]];
        let residuals = [0.7, -1.2, 0.4, 2.5];
        let borrowed: Vec<&[f64]> = columns.iter().map(|c| c.as_slice()).collect();
        let (u, precision) = (DVector::from_vec(vec![0.3, -0.2, 0.5]), DVector::from_vec(vec![2.0, 0.5, 1.0]));
        let model = Quadratic::new(&borrowed, &residuals);
        let (free, least) = model.minimum(&u, &precision).unwrap();
        // The step that would have been made in any case.
        let (same, cost) = model.minimum_beside(&DVector::from_element(1, free[0]), &u, &precision).unwrap();
        assert_relative_eq!(same, free, epsilon = 1e-12);
        assert_relative_eq!(cost, least, epsilon = 1e-12);
        // Another: what is left of residuals and priors, by hand.
        let (step, cost) = model.minimum_beside(&DVector::from_element(1, 0.8), &u, &precision).unwrap();
        let cost_of = |step: &DVector<f64>| {
            let left = (0..4).map(|k| (residuals[k] - (0..3).map(|c| columns[c][k] * step[c]).sum::<f64>()).powi(2)).sum::<f64>();
            0.5 * (left + (0..3).map(|c| precision[c] * (u[c] + step[c]).powi(2)).sum::<f64>())
        };
        assert_eq!(step[0], 0.8);
        assert_relative_eq!(cost, cost_of(&step), epsilon = 1e-12);
        for (c, by) in [(1, 1e-3), (1, -1e-3), (2, 1e-3), (2, -1e-3)] {
            let mut other = step.clone();
            other[c] += by;
            assert!(cost_of(&other) > cost);
        }
    }
}
