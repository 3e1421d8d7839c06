//! The Cramer-Rao bound: how well any unbiased estimator could know each unknown, if nothing but the cameras' noise were in the way.
//!
//! With the Jacobian `J` of residuals of unit covariance the information is `F = J' J`, without any prior. An unknown alone is known to
//! `1 / sqrt(F_kk)`, together with all others to `sqrt((F^-1)_kk)` (Rao 1945).

use nalgebra::{DMatrix, SymmetricEigen};

use crate::batch::Jacobian;

/// Eigenvalue of the information with unit diagonal below which a direction does not show: what rounding leaves of difference quotients.
pub(super) const NOTHING: f64 = 1e-11;
/// Part of a hidden direction above which an unknown is lost with it.
const LOST: f64 = 1e-6;

/// `F` of all residuals.
#[must_use]
pub fn information(jacobian: &Jacobian) -> DMatrix<f64> {
    let n = jacobian.len();
    let entry = |a: usize, b: usize| jacobian[a].iter().zip(&jacobian[b]).map(|(x, y)| x.dot(y)).sum::<f64>();
    let mut information = DMatrix::zeros(n, n);
    for a in 0..n {
        for b in 0..=a {
            information[(a, b)] = entry(a, b);
            information[(b, a)] = information[(a, b)];
        }
    }
    information
}

/// The information on the first `n` unknowns, where the others have the prior `N(0, 1)`: `F_aa - F_ab (F_bb + 1)^-1 F_ba`.
#[must_use]
pub fn beside_known(information: &DMatrix<f64>, n: usize) -> DMatrix<f64> {
    let others = information.nrows() - n;
    let [asked, across, known] = [(0, n, 0, n), (0, n, n, others), (n, others, n, others)]
        .map(|(row, rows, column, columns)| information.view((row, column), (rows, columns)).into_owned());
    match (known + DMatrix::identity(others, others)).cholesky() {
        Some(factor) => asked - &across * factor.solve(&across.transpose()),
        None => asked,
    }
}

/// An information matrix with unit diagonal: what is left is how the unknowns resemble each other.
#[derive(Debug, Clone)]
pub struct Scaled {
    /// Standard deviation of each unknown alone; infinite if it does not show.
    pub alone: Vec<f64>,
    /// Eigenvalues and -vectors of the scaled matrix.
    pub eigen: SymmetricEigen<f64, nalgebra::Dyn>,
}

impl Scaled {
    /// Of an information matrix.
    #[must_use]
    pub fn new(information: &DMatrix<f64>) -> Self {
        let alone: Vec<f64> = information.diagonal().iter().map(|f| if *f > 0.0 { 1.0 / f.sqrt() } else { f64::INFINITY }).collect();
        let n = alone.len();
        let scaled = DMatrix::from_fn(n, n, |a, b| {
            let both = alone[a].is_finite() && alone[b].is_finite();
            if both { information[(a, b)] * alone[a] * alone[b] } else { f64::from(u8::from(a == b)) }
        });
        Self { alone, eigen: scaled.symmetric_eigen() }
    }

    /// Standard deviations of the unknowns when all are estimated; infinite where a direction does not show.
    #[must_use]
    pub fn with_all(&self) -> Vec<f64> {
        let share = |k: usize| -> f64 {
            let part = |(j, &value): (usize, &f64)| {
                let part = self.eigen.eigenvectors[(k, j)].powi(2);
                match value > NOTHING {
                    true => part / value,
                    false if part > LOST => f64::INFINITY,
                    false => 0.0,
                }
            };
            self.eigen.eigenvalues.iter().enumerate().map(part).sum()
        };
        self.alone.iter().enumerate().map(|(k, alone)| alone * share(k).sqrt()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::Vector3;

    #[test]
    fn a_line_through_points_has_the_textbooks_deviations() {
        // y = a + b x at x = 0, 1, 2 with unit noise: var a = 5/6, var b = 1/2; alone 1/3 and 1/5.
        let jacobian = vec![vec![Vector3::repeat(1.0)], vec![Vector3::new(0.0, 1.0, 2.0)]];
        let scaled = Scaled::new(&information(&jacobian));
        assert_relative_eq!(scaled.alone[0].powi(2), 1.0 / 3.0, epsilon = 1e-12);
        assert_relative_eq!(scaled.alone[1].powi(2), 1.0 / 5.0, epsilon = 1e-12);
        let with_all = scaled.with_all();
        assert_relative_eq!(with_all[0].powi(2), 5.0 / 6.0, epsilon = 1e-12);
        assert_relative_eq!(with_all[1].powi(2), 0.5, epsilon = 1e-12);
    }

    #[test]
    fn what_is_known_beside_counts_with_its_prior() {
        // y = a + b x at x = 0, 1, 2, and b = 0 +- 1 known: F_bb = 5 + 1, so that var a = 1 / (3 - 9/6).
        let jacobian = vec![vec![Vector3::repeat(1.0)], vec![Vector3::new(0.0, 1.0, 2.0)]];
        let information = information(&jacobian);
        assert_relative_eq!(beside_known(&information, 1)[(0, 0)], 1.5, epsilon = 1e-12);
        assert_eq!(beside_known(&information, 2), information);
    }

    #[test]
    fn what_does_not_show_has_no_finite_deviation() {
        let x = vec![Vector3::new(1.0, 2.0, 3.0)];
        let twins = Scaled::new(&information(&vec![x.clone(), x.clone(), vec![Vector3::new(1.0, -1.0, 0.0)]])).with_all();
        assert!(twins[0].is_infinite() && twins[1].is_infinite() && twins[2].is_finite());
        let hidden = Scaled::new(&information(&vec![x, vec![Vector3::zeros()]]));
        assert!(hidden.alone[1].is_infinite() && hidden.with_all()[1].is_infinite() && hidden.with_all()[0].is_finite());
    }
}
