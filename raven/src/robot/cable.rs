//! Exponential cable (the paper's eq. 5): tension difference `gamma = k_e (e^x - e^-x) + 2 b_e xdot` for a stretch `x` in metres.
//!
//! At millimetres of stretch the law is linear to 1e-6, with slope `2 k_e`.

use serde::Deserialize;

/// Stiffness and damping of the cable pair that drives one joint.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cable {
    /// `k_e` [N]; the exponent is in metres.
    pub stiffness: f64,
    /// `b_e` [N s/m].
    pub damping: f64,
}

impl Cable {
    /// Tension difference [N] at a stretch [m] and its rate [m/s].
    #[must_use]
    pub fn force(&self, stretch_m: f64, stretch_rate_m_s: f64) -> f64 {
        2.0 * (self.stiffness * stretch_m.sinh() + self.damping * stretch_rate_m_s)
    }

    /// Stretch [m] under a static tension difference [N].
    #[must_use]
    pub fn static_stretch_m(&self, force_n: f64) -> f64 {
        (force_n / (2.0 * self.stiffness)).asinh()
    }
}
