//! The Cauchy loss on whitened residuals: a false blob far away pulls no harder than one nearby.
//!
//! With `s = |r|^2 / scale^2` of a three-vector,
//!
//! ```text
//! rho = (kappa c^2 / 2) ln(1 + s / c^2),   weight = kappa / (1 + s / c^2) / scale^2
//! ```
//!
//! `c` keeps 95 % efficiency on normal noise; `kappa` makes the variance of the score equal to the information there, so that the loss
//! may be added to the logarithm of a prior. `scale` is the residuals' own, from their median (Holland and Welsch 1977 for the loss;
//! Huber, Robust Statistics, for both conditions), and never below one: the sightings' covariance is believed as far as it goes.

use nalgebra::Vector3;
use raven::stats::median;

/// `c^2`.
const C2: f64 = 7.105;
/// `kappa`.
const KAPPA: f64 = 1.526_3;
/// Median of a chi-square with three degrees of freedom.
const CHI_SQUARE_MEDIAN: f64 = 2.365_97;

/// A Cauchy loss of one scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cauchy {
    /// By how much the residuals exceed their covariance, at least 1.
    pub scale: f64,
}

impl Cauchy {
    /// With the scale of these residuals.
    #[must_use]
    pub fn of(residuals: &[Vector3<f64>]) -> Self {
        let squares: Vec<f64> = residuals.iter().map(Vector3::norm_squared).collect();
        Self { scale: (median(&squares).unwrap_or(0.0) / CHI_SQUARE_MEDIAN).sqrt().max(1.0) }
    }

    /// The loss of a residual.
    #[must_use]
    pub fn loss(self, residual: &Vector3<f64>) -> f64 {
        0.5 * KAPPA * C2 * (self.share(residual)).ln_1p()
    }

    /// Gradient of the loss divided by the residual.
    #[must_use]
    pub fn weight(self, residual: &Vector3<f64>) -> f64 {
        KAPPA / (1.0 + self.share(residual)) / self.scale.powi(2)
    }

    /// Second derivative of the loss is `weight + curvature r r'`.
    #[must_use]
    pub fn curvature(self, residual: &Vector3<f64>) -> f64 {
        -2.0 * KAPPA / (C2 * (1.0 + self.share(residual)).powi(2) * self.scale.powi(4))
    }

    /// `s / c^2`.
    fn share(self, residual: &Vector3<f64>) -> f64 {
        residual.norm_squared() / (self.scale.powi(2) * C2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Mean of a function of the residual's norm under standard normal noise in three dimensions.
    fn mean(f: impl Fn(&Vector3<f64>) -> f64) -> f64 {
        let step = 1e-3;
        (0..12_000)
            .map(|i| {
                let r = (f64::from(i) + 0.5) * step;
                let density = (2.0 / std::f64::consts::PI).sqrt() * r * r * (-0.5 * r * r).exp();
                density * f(&Vector3::new(r, 0.0, 0.0)) * step
            })
            .sum()
    }

    #[test]
    fn efficiency_and_information_on_normal_noise() {
        let loss = Cauchy { scale: 1.0 };
        let information = mean(|r| loss.weight(r) + loss.curvature(r) * r.norm_squared() / 3.0);
        let score = mean(|r| loss.weight(r).powi(2) * r.norm_squared() / 3.0);
        assert_relative_eq!(information.powi(2) / score, 0.95, epsilon = 2e-3);
        assert_relative_eq!(information / score, 1.0, epsilon = 2e-3);
    }

    #[test]
    fn weight_and_curvature_are_derivatives_of_the_loss() {
        let loss = Cauchy { scale: 1.7 };
        for size in [0.1, 1.0, 3.0, 30.0] {
            let at = |r: f64| loss.loss(&Vector3::new(0.0, r, 0.0));
            let r = Vector3::new(0.0, size, 0.0);
            let h = 1e-4;
            assert_relative_eq!((at(size + h) - at(size - h)) / (2.0 * h), loss.weight(&r) * size, max_relative = 1e-6);
            let second = (at(size + h) - 2.0 * at(size) + at(size - h)) / (h * h);
            assert_relative_eq!(second, loss.weight(&r) + loss.curvature(&r) * size * size, epsilon = 1e-5);
        }
    }

    #[test]
    fn the_scale_follows_the_median_and_not_the_outliers() {
        let mut residuals = vec![Vector3::new(3.0 * CHI_SQUARE_MEDIAN.sqrt(), 0.0, 0.0); 99];
        residuals.push(Vector3::new(1e6, 0.0, 0.0));
        assert_relative_eq!(Cauchy::of(&residuals).scale, 3.0, epsilon = 1e-9);
        assert_eq!(Cauchy::of(&[Vector3::zeros(); 9]).scale, 1.0);
        assert_eq!(Cauchy::of(&[]).scale, 1.0);
    }
}
