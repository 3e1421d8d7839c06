//! What the model leaves unexplained at each joint: hysteresis, play, stretch of a softer cable, all as one random error per joint.
//!
//! A camera sees along the image to hundredths of a millimetre and along the view to half of one. Weighed by that alone, a millimetre of
//! hysteresis on the insertion would drown what the same images say of the shoulder. So a sighting's residual is taken as
//! `r = J b + e` with `e` the sighting's noise and `b ~ N(0, diag(s^2))` at the joints, and the three `s` come from the residuals by
//! maximum likelihood, with expectation-maximisation (Dempster, Laird, Rubin 1977):
//!
//! ```text
//! V = J S J' + E,   m = S J' V^-1 r,   s_j^2 <- mean( m_j^2 + [S - S J' V^-1 J S]_jj )
//! ```

use nalgebra::{Matrix3, Vector3};
use raven::stats::{chi_square_quantile, median};

/// Residual of one sighting.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Seen less predicted [m].
    pub residual_m: Vector3<f64>,
    /// Change of the tip with the joints [m/rad, m/rad, 1].
    pub slope: Matrix3<f64>,
    /// Noise of the sighting [m^2].
    pub covariance_m2: Matrix3<f64>,
}

impl Sample {
    /// Covariance of the residual with this scatter of the joints.
    #[must_use]
    pub fn spread_m2(&self, scatter: &Vector3<f64>) -> Matrix3<f64> {
        let joints = Matrix3::from_diagonal(&scatter.component_mul(scatter));
        self.slope * joints * self.slope.transpose() + self.covariance_m2
    }
}

/// Chance that a good residual is taken for a false blob's.
const FALSE_CHANCE: f64 = 1e-6;
const ROUNDS: usize = 200;
const SETTLED: f64 = 1e-3;

/// Standard deviations of the unexplained joint errors [rad, rad, m]; zero of no samples.
#[must_use]
pub fn joint_scatter(samples: &[Sample]) -> Vector3<f64> {
    let limit = chi_square_quantile(3, 1.0 - FALSE_CHANCE).unwrap_or(f64::INFINITY);
    let at_joints: Vec<Vector3<f64>> = samples.iter().filter_map(|s| Some(s.slope.try_inverse()? * s.residual_m)).collect();
    let mut scatter = Vector3::from_fn(|j, _| {
        let sizes: Vec<f64> = at_joints.iter().map(|b| b[j].abs()).collect();
        median(&sizes).unwrap_or(0.0) * 1.4826
    });
    for _ in 0..ROUNDS {
        let joints = Matrix3::from_diagonal(&scatter.component_mul(&scatter));
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for sample in samples {
            let Some(spread) = sample.spread_m2(&scatter).cholesky() else { continue };
            let solved = spread.solve(&sample.residual_m);
            if sample.residual_m.dot(&solved) > limit {
                continue;
            }
            let gain = joints * sample.slope.transpose();
            let mean = gain * solved;
            let left = joints - gain * spread.solve(&(sample.slope * joints));
            sum += mean.component_mul(&mean) + left.diagonal();
            count += 1.0;
        }
        if count == 0.0 {
            return Vector3::zeros();
        }
        let next = (sum / count).map(|variance: f64| variance.max(0.0).sqrt());
        let settled = (next - scatter).component_div(&scatter.map(|s| s.max(1e-9))).amax() < SETTLED;
        scatter = next;
        if settled {
            break;
        }
    }
    scatter
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn the_scatter_of_each_joint_is_found_under_unequal_noise_and_false_blobs() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let truth = Vector3::new(3e-3, 8e-3, 1e-3);
        let noise = Vector3::new(5e-5, 5e-5, 8e-4);
        let samples: Vec<Sample> = (0..3000)
            .map(|k| {
                let turn = nalgebra::Rotation3::new(Vector3::new(0.3, 0.2, f64::from(k) * 0.01));
                let slope = Matrix3::new(0.12, 0.0, 0.1, 0.01, 0.1, 0.2, 0.0, 0.02, 0.97);
                let error = Vector3::from_fn(|j, _| truth[j] * normal());
                let seen = turn * Vector3::from_fn(|i, _| noise[i] * normal());
                let covariance_m2 = turn * Matrix3::from_diagonal(&noise.component_mul(&noise)) * turn.inverse();
                let blob = if k % 50 == 0 { Vector3::repeat(0.05) } else { Vector3::zeros() };
                Sample { residual_m: slope * error + seen + blob, slope, covariance_m2 }
            })
            .collect();
        let found = joint_scatter(&samples);
        for j in 0..3 {
            assert!((found[j] / truth[j] - 1.0).abs() < 0.06, "joint {j}: {} instead of {}", found[j], truth[j]);
        }
    }

    #[test]
    fn nothing_unexplained_is_nothing() {
        let slope = Matrix3::from_diagonal(&Vector3::new(0.1, 0.1, 1.0));
        let sample = Sample { residual_m: Vector3::zeros(), slope, covariance_m2: Matrix3::identity() * 1e-8 };
        assert!(joint_scatter(&[sample; 20]).amax() < 1e-6);
        assert_eq!(joint_scatter(&[]), Vector3::zeros());
    }
}
