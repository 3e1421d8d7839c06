//! How much each joint does that the model does not say: variance components of residuals.
//!
//! Residuals `e` of covariance `S = C + sum_j u_j^2 J_j J_j'` are most probable where
//!
//! ```text
//! u_j^2 <- u_j^2 sqrt( sum (J_j' S^-1 e)^2 / sum J_j' S^-1 J_j )
//! ```
//!
//! stands still. The iteration never leaves the positive numbers and raises the likelihood in every step (Zhou, Hu, Zhou, Lange 2019, MM
//! algorithms for variance components models).

use nalgebra::{Matrix3, Vector3};
use raven::stats::{chi_square_quantile, median};

/// Steps of the iteration, of which a misfit of none takes many, and the relative change of a variance at which it ends.
const STEPS_MAX: usize = 200;
const SETTLED: f64 = 1e-3;
/// Chance that a good residual is taken for a false one.
pub const FALSE_CHANCE: f64 = 1e-6;

/// An error of the seen tip and what it may come from.
#[derive(Debug, Clone, Copy)]
pub struct Residual {
    /// Prediction less sighting [m].
    pub error: Vector3<f64>,
    /// Covariance of the sighting [m^2].
    pub covariance: Matrix3<f64>,
    /// How the seen tip moves with the joints [m/rad, m/rad, 1].
    pub from_joints: Matrix3<f64>,
}

impl Residual {
    /// Inverse of the covariance with a misfit of these variances.
    fn information(&self, variance: &Vector3<f64>) -> Option<Matrix3<f64>> {
        let own = self.from_joints * Matrix3::from_diagonal(variance) * self.from_joints.transpose();
        Some((self.covariance + own).cholesky()?.inverse())
    }
}

/// Standard deviations of the joints [rad, rad, m] about the model, from `start`, which must be positive.
#[must_use]
pub fn misfit(residuals: &[Residual], start: &Vector3<f64>) -> Vector3<f64> {
    let mut variance = start.component_mul(start);
    let quantile = |p: f64| chi_square_quantile(3, p).unwrap_or(f64::INFINITY);
    let (gate, middle) = (quantile(1.0 - FALSE_CHANCE), quantile(0.5));
    for _ in 0..STEPS_MAX {
        let informed: Vec<(&Residual, Matrix3<f64>)> = residuals.iter().filter_map(|r| Some((r, r.information(&variance)?))).collect();
        let squares: Vec<f64> = informed.iter().map(|(r, information)| r.error.dot(&(information * r.error))).collect();
        let limit = gate * (median(&squares).unwrap_or(0.0) / middle).max(1.0);
        let (mut seen, mut expected) = (Vector3::zeros(), Vector3::zeros());
        for ((residual, information), _) in informed.iter().zip(&squares).filter(|(_, square)| **square <= limit) {
            let weighed = information * residual.from_joints;
            let pull = weighed.tr_mul(&residual.error);
            seen += pull.component_mul(&pull);
            expected += Vector3::from_fn(|j, _| weighed.column(j).dot(&residual.from_joints.column(j)));
        }
        let factor = Vector3::from_fn(|j, _| if expected[j] > 0.0 { (seen[j] / expected[j]).sqrt() } else { 1.0 });
        variance.component_mul_assign(&factor);
        if factor.add_scalar(-1.0).amax() <= SETTLED {
            break;
        }
    }
    variance.map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn sample(misfit: Vector3<f64>, false_every: usize) -> Vec<Residual> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || Vector3::from_fn(|_, _| Distribution::<f64>::sample(&StandardNormal, &mut random));
        let noise = Vector3::new(1e-4, 1.5e-3, 1e-4);
        (0..1500)
            .map(|i| {
                let turn = nalgebra::Rotation3::from_euler_angles(0.3 * f64::from(i % 7), 0.2 * f64::from(i % 5), 0.0);
                let from_joints = turn * Matrix3::from_diagonal(&Vector3::new(0.1, 0.12, 1.0));
                let blob = if i % false_every as i32 == 1 { Vector3::repeat(0.3) } else { Vector3::zeros() };
                let error = from_joints * misfit.component_mul(&normal()) + noise.component_mul(&normal()) + blob;
                Residual { error, covariance: Matrix3::from_diagonal(&noise.component_mul(&noise)), from_joints }
            })
            .collect()
    }

    const START: Vector3<f64> = Vector3::new(0.02, 0.04, 0.003);

    #[test]
    fn each_joints_misfit_is_found_despite_false_blobs() {
        for (truth, every) in [(Vector3::new(0.002, 0.01, 0.001), 5000), (Vector3::new(0.01, 0.004, 0.002), 40)] {
            let found = misfit(&sample(truth, every), &START);
            assert!((found.component_div(&truth) - Vector3::repeat(1.0)).amax() < 0.1, "{found} of {truth}");
        }
    }

    #[test]
    fn a_model_that_explains_all_has_next_to_none() {
        let found = misfit(&sample(Vector3::zeros(), 5000), &START);
        assert!(found.x < 3e-4 && found.y < 3e-4 && found.z < 3e-5, "{found}");
    }
}
