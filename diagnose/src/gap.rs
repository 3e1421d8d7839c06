//! How large the gap is.

use raven::stats::rms;
use serde::Serialize;

use crate::residual::Residuals;

/// The gap of one channel.
#[derive(Debug, Clone, Serialize)]
pub struct Gap {
    /// Joint name, or `tip`.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// RMS that the measurement's own noise would leave.
    pub noise_floor: f64,
    /// RMS of the measurement against transmission kinematics, noise included, before anything is fitted.
    pub transmission: f64,
    /// The same against the robot model, its cables and links rolled out over the recorded motor angles.
    pub model: f64,
    /// Observations behind it.
    pub observations: usize,
}

impl Gap {
    /// Of one channel; `None` where nothing was observed. `scale` takes SI to `unit`.
    #[must_use]
    pub fn new(channel: &str, unit: &'static str, scale: f64, residuals: &Residuals) -> Option<Self> {
        let scaled = |values: &[f64]| rms(values).map(|v| v * scale);
        Some(Self {
            channel: channel.to_owned(),
            unit,
            noise_floor: scaled(&residuals.noise)?,
            transmission: scaled(&residuals.rigid_error)?,
            model: scaled(&residuals.error)?,
            observations: residuals.error.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn a_gap_is_the_rms_in_the_unit_of_reports() {
        let error = vec![0.03, -0.04];
        let residuals =
            Residuals { noise: vec![0.01; 2], rigid_error: vec![0.06, 0.08], time_s: vec![0.0, 1.0], error, rate: vec![0.0; 2] };
        let gap = Gap::new("insertion", "mm", 1e3, &residuals).unwrap();
        assert_relative_eq!(gap.noise_floor, 10.0, epsilon = 1e-9);
        assert_relative_eq!(gap.model, 1250.0_f64.sqrt(), epsilon = 1e-9);
        assert_relative_eq!(gap.transmission, 5000.0_f64.sqrt(), epsilon = 1e-9);
        assert!(Gap::new("insertion", "mm", 1e3, &Residuals::default()).is_none());
    }
}
