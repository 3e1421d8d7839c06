//! Damped Gauss-Newton for the most probable `z`: the minimum of
//!
//! ```text
//! F(z) = sum rho(r_i(z)) / tempering + |z|^2 / 2
//! ```
//!
//! with Levenberg's damping by what a step gains of what it promised (Marquardt 1963), iterative reweighting, and the loss's scale brought
//! down with the residuals, which lets far-off starts see all sightings before the false ones are told apart. `tempering` divides the
//! information of residuals that are not independent.
//!
//! Steps end at the unknowns' bounds; one that is at its bound and would go beyond stays there while the others move (Bertsekas 1982).

use nalgebra::{DMatrix, DVector, Vector3};

use super::Residuals;
use super::robust::Cauchy;
use raven::{Error, Result};

/// Step of the difference quotients where residuals are smooth, in prior deviations.
pub const DIFFERENCE: f64 = 1e-3;
/// Steps after which a solution that still moves is given up.
const STEPS_MAX: usize = 150;
/// Where the damping starts, and beyond which no step is found any more.
const DAMPING: f64 = 1e-3;
const DAMPING_MAX: f64 = 1e9;
/// Part of what a step promised that it must gain for the next to be damped less; where it gains less, slopes are no guide so far away.
const KEPT: f64 = 0.25;
/// Squared step, in posterior deviations, below which the solution has settled.
const SETTLED: f64 = 1e-4;
/// Relative change of the loss's scale below which it has settled.
const SCALE_SETTLED: f64 = 0.01;

/// A minimum and what surrounds it.
#[derive(Debug, Clone)]
pub struct Minimum {
    /// Most probable `z`; held unknowns are 0.
    pub z: DVector<f64>,
    /// Whitened residuals there.
    pub residuals: Vec<Vector3<f64>>,
    /// The loss, with its final scale.
    pub loss: Cauchy,
}

/// Derivatives of every residual, one list per unknown asked for.
pub type Jacobian = Vec<Vec<Vector3<f64>>>;

/// Derivatives by unknown `k` at `z` from residuals at two values of it.
///
/// # Errors
/// As the residuals.
pub fn central_difference(
    residuals: impl Fn(&DVector<f64>) -> Result<Vec<Vector3<f64>>>,
    z: &DVector<f64>,
    k: usize,
    [behind, ahead]: [f64; 2],
) -> Result<Vec<Vector3<f64>>> {
    let at = |z_k: f64| {
        let mut moved = z.clone();
        moved[k] = z_k;
        residuals(&moved)
    };
    Ok(at(ahead)?.iter().zip(&at(behind)?).map(|(a, b)| (a - b) / (ahead - behind)).collect())
}

/// Derivatives by unknown `k` from residuals ahead of `z` and those at it: half the work, where a residual is much work.
///
/// # Errors
/// As the residuals.
pub fn forward_difference(
    residuals: impl Fn(&DVector<f64>) -> Result<Vec<Vector3<f64>>>,
    here: &[Vector3<f64>],
    z: &DVector<f64>,
    k: usize,
) -> Result<Vec<Vector3<f64>>> {
    let mut moved = z.clone();
    moved[k] += DIFFERENCE;
    Ok(residuals(&moved)?.iter().zip(here).map(|(a, b)| (a - b) / DIFFERENCE).collect())
}

/// The most probable values of the unknowns in `free`, from `start`; the others stay at their prior.
///
/// # Errors
/// If the residuals cannot be computed, or the solution does not settle.
pub fn minimize(problem: &impl Residuals, free: &[usize], tempering: f64, start: &DVector<f64>) -> Result<Minimum> {
    let mut z = DVector::zeros(problem.unknowns());
    for &k in free {
        z[k] = start[k];
    }
    let mut residuals = problem.residuals(&z)?;
    let mut loss = Cauchy::of(&residuals);
    let mut damping = DAMPING;
    for _ in 0..STEPS_MAX {
        let jacobian = problem.jacobian(&z, free)?;
        let weights: Vec<f64> = residuals.iter().map(|r| loss.weight(r) / tempering).collect();
        let n = free.len();
        let mut hessian = DMatrix::identity(n, n);
        let mut gradient = DVector::from_iterator(n, free.iter().map(|&k| z[k]));
        for a in 0..n {
            gradient[a] += dot(&weights, &jacobian[a], &residuals);
            for b in 0..=a {
                hessian[(a, b)] += dot(&weights, &jacobian[a], &jacobian[b]);
                hessian[(b, a)] = hessian[(a, b)];
            }
        }
        for a in 0..n {
            let beyond = z[free[a]] - DIFFERENCE * gradient[a].signum();
            if problem.bounded(free[a], beyond) == z[free[a]] {
                hessian.row_mut(a).fill(0.0);
                hessian.column_mut(a).fill(0.0);
                (hessian[(a, a)], gradient[a]) = (1.0, 0.0);
            }
        }
        let before = cost(&residuals, loss, tempering, &z);
        let (step, ahead) = loop {
            let damped = &hessian + DMatrix::from_diagonal(&(hessian.diagonal() * damping));
            let mut step = damped.cholesky().map_or_else(|| DVector::zeros(n), |factor| -factor.solve(&gradient));
            let mut moved = z.clone();
            for (a, &k) in free.iter().enumerate() {
                moved[k] = problem.bounded(k, z[k] + step[a]);
                step[a] = moved[k] - z[k];
            }
            let ahead = problem.residuals(&moved)?;
            let gain = before - cost(&ahead, loss, tempering, &moved);
            if gain >= 0.0 {
                let promised = -step.dot(&(&gradient + 0.5 * &hessian * &step));
                damping = if gain > KEPT * promised { (damping / 10.0).max(1e-9) } else { damping * 10.0 };
                z = moved;
                break (step, ahead);
            }
            damping *= 10.0;
            if damping > DAMPING_MAX {
                break (DVector::zeros(n), residuals);
            }
        };
        residuals = ahead;
        let scale = Cauchy::of(&residuals).scale.min(loss.scale);
        let scale_settled = loss.scale - scale <= SCALE_SETTLED * scale;
        loss = Cauchy { scale };
        if scale_settled && step.dot(&(&hessian * &step)) <= SETTLED {
            return Ok(Minimum { z, residuals, loss });
        }
    }
    Err(Error::Unsettled { unknowns: free.len(), steps: STEPS_MAX })
}

/// `sum w_i a_i . b_i`.
fn dot(weights: &[f64], a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    weights.iter().zip(a).zip(b).map(|((w, a), b)| w * a.dot(b)).sum()
}

fn cost(residuals: &[Vector3<f64>], loss: Cauchy, tempering: f64, z: &DVector<f64>) -> f64 {
    let data: f64 = residuals.iter().map(|r| loss.loss(r)).sum();
    let total = data / tempering + 0.5 * z.norm_squared();
    if total.is_finite() { total } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::tests::Line;
    use approx::assert_relative_eq;

    #[test]
    fn a_linear_problem_is_solved_as_in_the_textbook() {
        let line = Line::exact(&[0.5, -0.8, 0.3], 60);
        let minimum = minimize(&line, &[0, 1, 2], 1.0, &DVector::zeros(3)).unwrap();
        // Prior N(0, 1) against much information: shrunk by less than 1e-2.
        assert_relative_eq!(minimum.z, DVector::from_vec(vec![0.5, -0.8, 0.3]), epsilon = 1e-2);
        let held = minimize(&line, &[0, 1], 1.0, &minimum.z).unwrap();
        assert_eq!(held.z[2], 0.0);
    }

    /// A line whose first unknown cannot be above some value.
    struct UpTo(f64, Line);

    impl Residuals for UpTo {
        fn unknowns(&self) -> usize {
            self.1.unknowns()
        }

        fn bounded(&self, k: usize, z: f64) -> f64 {
            if k == 0 { z.min(self.0) } else { z }
        }

        fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>> {
            assert!(z[0] <= self.0, "{z}");
            self.1.residuals(z)
        }

        fn jacobian(&self, z: &DVector<f64>, columns: &[usize]) -> Result<Jacobian> {
            self.1.jacobian(z, columns)
        }

        fn blocks(&self) -> Vec<usize> {
            self.1.blocks()
        }
    }

    #[test]
    fn at_a_bound_the_others_are_what_they_are_with_that_value() {
        let line = || Line::exact(&[0.5, -0.8, 0.3], 60);
        let bound = 0.2;
        let mut given = line();
        for (slope, observed) in given.slopes.iter().zip(&mut given.observed) {
            *observed -= slope.column(0) * bound;
        }
        let expected = minimize(&given, &[1, 2], 1.0, &DVector::zeros(3)).unwrap().z;
        let minimum = minimize(&UpTo(bound, line()), &[0, 1, 2], 1.0, &DVector::zeros(3)).unwrap();
        assert_eq!(minimum.z[0], bound);
        assert_relative_eq!(minimum.z.rows(1, 2), expected.rows(1, 2), epsilon = 1e-4);
        // A bound that is not reached does nothing, and one that was started from is left.
        let free = minimize(&line(), &[0, 1, 2], 1.0, &DVector::zeros(3)).unwrap().z;
        for start in [0.0, 0.7] {
            let inside = minimize(&UpTo(0.7, line()), &[0, 1, 2], 1.0, &DVector::from_vec(vec![start, 0.0, 0.0])).unwrap();
            assert_relative_eq!(inside.z, free, epsilon = 1e-4);
        }
    }

    #[test]
    fn false_blobs_do_not_pull() {
        let mut line = Line::exact(&[0.5, -0.8, 0.3], 300);
        let clean = minimize(&line, &[0, 1, 2], 1.0, &DVector::zeros(3)).unwrap().z;
        for i in (0..300).step_by(10) {
            line.observed[i] += Vector3::new(400.0, -200.0, 100.0);
        }
        let spoilt = minimize(&line, &[0, 1, 2], 1.0, &DVector::zeros(3)).unwrap().z;
        assert!((spoilt - clean).amax() < 5e-3);
    }

    #[test]
    fn without_information_the_prior_stays() {
        let mut line = Line::exact(&[0.5, 0.5, 0.5], 60);
        line.slopes.iter_mut().for_each(|m| m.fill(0.0));
        let minimum = minimize(&line, &[0, 1, 2], 1.0, &DVector::zeros(3)).unwrap();
        assert_eq!(minimum.z, DVector::zeros(3));
    }
}
