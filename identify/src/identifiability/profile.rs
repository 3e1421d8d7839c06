//! Profile likelihood: how far an unknown may go while the others make up for it as well as they can.
//!
//! ```text
//! PL(z_k) = 2 min over the others of ( sum rho(r) / tempering + |others|^2 / 2 )
//! ```
//!
//! The interval of 95 % is where `PL` exceeds its least value by less than the chi-square's 3.84. It needs no straight lines, which is
//! where the information matrix misleads: an unknown that is open to one side has no standard deviation (Wieland et al. 2021). The
//! prior of the unknown itself is left out, so an interval says what the recording says.

use nalgebra::{DMatrix, DVector, Vector3};
use raven::Result;
use raven::stats::chi_square_quantile;
use rayon::prelude::*;

use crate::batch::{Cauchy, Estimate, Jacobian, Residuals};

/// Distances from the estimate [prior deviations] at which the profile is taken; beyond the last one it counts as open.
const DISTANCES: [f64; 5] = [0.25, 0.5, 1.0, 1.5, 2.0];
/// Steps of the others at each, with the Jacobian of the estimate, and the gain that is not worth another.
const STEPS: usize = 4;
const GAIN: f64 = 0.02;

/// An interval in prior deviations; an end is `None` where it is open.
pub type Interval = [Option<f64>; 2];

/// The interval of 95 % of unknown `k`. `jacobian` holds the columns of all unknowns at the estimate.
///
/// # Errors
/// If the model cannot be evaluated.
pub fn interval(problem: &impl Residuals, jacobian: &Jacobian, estimate: &Estimate, k: usize) -> Result<Interval> {
    let drop_at_95 = chi_square_quantile(1, 0.95).unwrap_or(f64::INFINITY);
    let profile = Profile { problem, jacobian, loss: Cauchy { scale: estimate.scale }, tempering: estimate.tempering, k };
    let (here, start) = profile.least(&estimate.z)?;
    let side = |sign: f64| -> Result<Vec<(f64, f64)>> {
        let mut points = vec![(estimate.z[k], here)];
        let mut z = start.clone();
        for distance in DISTANCES {
            z[k] = estimate.z[k] + sign * distance;
            let (value, others) = profile.least(&z)?;
            points.push((z[k], value));
            z = others;
            // Twice the drop leaves room for a least value that is still to be found on the other side.
            if value - here > 2.0 * drop_at_95 {
                break;
            }
        }
        Ok(points)
    };
    let sides: Vec<Vec<(f64, f64)>> = [-1.0, 1.0].into_par_iter().map(side).collect::<Result<_>>()?;
    let least = sides.iter().flatten().map(|(_, value)| *value).fold(f64::INFINITY, f64::min);
    Ok([crossing(&sides[0], least, drop_at_95), crossing(&sides[1], least, drop_at_95)])
}

/// Where a profile last leaves the band above `least`; between points its root is taken as straight, which it is of a parabola.
fn crossing(points: &[(f64, f64)], least: f64, drop: f64) -> Option<f64> {
    let root = |value: f64| (value - least).max(0.0).sqrt();
    let outside = |value: f64| root(value) > drop.sqrt();
    let last = points.windows(2).rev().find(|pair| !outside(pair[0].1) && outside(pair[1].1));
    if points.last().is_some_and(|(_, value)| !outside(*value)) {
        return None;
    }
    // The estimate itself, pulled by its prior, may already lie outside: then the interval ends there.
    let Some([(inner, low), (outer, high)]) = last else { return points.first().map(|(z, _)| *z) };
    let part = (drop.sqrt() - root(*low)) / (root(*high) - root(*low));
    Some(inner + part * (outer - inner))
}

struct Profile<'a, P> {
    problem: &'a P,
    jacobian: &'a Jacobian,
    loss: Cauchy,
    tempering: f64,
    k: usize,
}

impl<P: Residuals> Profile<'_, P> {
    /// `PL` at `z[k]`, and the others there; from `z` on.
    fn least(&self, z: &DVector<f64>) -> Result<(f64, DVector<f64>)> {
        let mut z = z.clone();
        let mut residuals = self.problem.residuals(&z)?;
        let mut value = self.value(&residuals, &z);
        for _ in 0..STEPS {
            let Some(step) = self.step(&residuals, &z) else { break };
            let ahead = &z + step;
            let there = self.problem.residuals(&ahead)?;
            let next = self.value(&there, &ahead);
            let gain = value - next;
            if gain.is_nan() || gain <= 0.0 {
                break;
            }
            (z, residuals, value) = (ahead, there, next);
            if gain < GAIN {
                break;
            }
        }
        Ok((value, z))
    }

    fn value(&self, residuals: &[Vector3<f64>], z: &DVector<f64>) -> f64 {
        let data: f64 = residuals.iter().map(|r| self.loss.loss(r)).sum();
        2.0 * data / self.tempering + z.norm_squared() - z[self.k].powi(2)
    }

    /// Gauss-Newton step of the others.
    fn step(&self, residuals: &[Vector3<f64>], z: &DVector<f64>) -> Option<DVector<f64>> {
        let others: Vec<usize> = (0..z.len()).filter(|&l| l != self.k).collect();
        let weights: Vec<f64> = residuals.iter().map(|r| self.loss.weight(r) / self.tempering).collect();
        let n = others.len();
        let mut hessian = DMatrix::identity(n, n);
        let mut gradient = DVector::from_iterator(n, others.iter().map(|&l| z[l]));
        for (a, &k) in others.iter().enumerate() {
            let weighed = || weights.iter().zip(&self.jacobian[k]);
            gradient[a] += weighed().zip(residuals).map(|((w, j), r)| w * j.dot(r)).sum::<f64>();
            for (b, &l) in others.iter().enumerate().take(a + 1) {
                hessian[(a, b)] += weighed().zip(&self.jacobian[l]).map(|((w, j), i)| w * j.dot(i)).sum::<f64>();
                hessian[(b, a)] = hessian[(a, b)];
            }
        }
        let solved = hessian.cholesky()?.solve(&gradient);
        let mut step = DVector::zeros(z.len());
        for (a, &k) in others.iter().enumerate() {
            step[k] = -solved[a];
        }
        Some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::estimate;

    /// Sixty residuals `0.4 (f(z_0) + z_1), 0.4 z_1`, with `f` straight or saturating.
    struct Curve {
        saturating: bool,
    }

    impl Residuals for Curve {
        fn unknowns(&self) -> usize {
            2
        }

        fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>> {
            // Of what saturates at 1, 0.9 was seen.
            let shown = if self.saturating { 0.1 - (-z[0]).exp() } else { z[0] };
            Ok((0..60).map(|i| Vector3::new(0.4 * (shown + z[1]), 0.4 * z[1], 0.01 * f64::from(i % 7))).collect())
        }

        fn blocks(&self) -> Vec<usize> {
            (0..60).map(|i| i / 6).collect()
        }
    }

    fn profile(saturating: bool) -> Interval {
        let curve = Curve { saturating };
        let estimate = estimate(&curve, &[false; 2], &[], &DVector::zeros(2)).unwrap();
        let jacobian = curve.jacobian(&estimate.z, &[0, 1]).unwrap();
        interval(&curve, &jacobian, &estimate, 0).unwrap()
    }

    #[test]
    fn a_straight_problem_has_the_interval_of_its_deviation() {
        // Information 60 * 0.16 * kappa on each row; z_1 has a prior besides.
        let information = 60.0 * 0.16 * Cauchy { scale: 1.0 }.weight(&Vector3::zeros());
        let std = (1.0 / information + 1.0 / (information + 1.0)).sqrt();
        let [low, high] = profile(false).map(Option::unwrap);
        assert!((high / (1.96 * std) - 1.0).abs() < 0.05 && (low / high + 1.0).abs() < 1e-3, "{low} to {high} for {std}");
    }

    #[test]
    fn what_saturates_is_open_to_that_side() {
        let [low, high] = profile(true);
        assert!(low.is_some_and(|low| low > -1.5) && high.is_none(), "{low:?} to {high:?}");
    }
}
