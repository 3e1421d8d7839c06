//! How large the gap is, and in which phase of the motion its excess over the noise sits.

use raven::stats::rms;
use serde::Serialize;

use crate::phase::{Phase, phases};
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
    pub before: f64,
    /// The same against the robot model, its cables and links rolled out over the recorded motor angles.
    pub model: f64,
    /// Observations behind it.
    pub observations: usize,
}

/// Where the excess sits: one joint in one phase.
#[derive(Debug, Clone, Serialize)]
pub struct Place {
    /// Part of the robot that is to blame, where that is known.
    pub stage: Option<String>,
    /// Joint.
    pub joint: String,
    /// Phase of the motion.
    pub phase: Phase,
    /// RMS of the residual against the model there.
    pub rms: f64,
    /// Unit of `rms`.
    pub unit: &'static str,
    /// Share of the joint's squared error above the noise floor.
    pub share_of_excess: f64,
    /// Share of the observations.
    pub share_of_time: f64,
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
            before: scaled(&residuals.rigid_error)?,
            model: scaled(&residuals.error)?,
            observations: residuals.error.len(),
        })
    }
}

/// Where a joint's excess sits, phase by phase. Each recording's residuals are phased on their own.
#[must_use]
pub fn places(joint: &str, unit: &'static str, scale: f64, recordings: &[&Residuals]) -> Vec<Place> {
    let phased: Vec<(Phase, f64, f64)> = recordings
        .iter()
        .flat_map(|r| phases(&r.time_s, &r.rate).into_iter().zip(r.error.iter().zip(&r.noise)).map(|(phase, (e, n))| (phase, *e, *n)))
        .collect();
    let excess = |chosen: &dyn Fn(Phase) -> bool| -> f64 {
        phased.iter().filter(|(phase, _, _)| chosen(*phase)).map(|(_, error, noise)| error * error - noise * noise).sum()
    };
    let total = excess(&|_| true);
    let mut places = Vec::new();
    for phase in Phase::ALL {
        let errors: Vec<f64> = phased.iter().filter(|(p, _, _)| *p == phase).map(|(_, error, _)| *error).collect();
        let Some(rms) = rms(&errors) else { continue };
        places.push(Place {
            stage: None,
            joint: joint.to_owned(),
            phase,
            rms: rms * scale,
            unit,
            // Where noise alone explains the error there is no excess to share out.
            share_of_excess: if total > 0.0 { excess(&|p| p == phase) / total } else { 0.0 },
            share_of_time: errors.len() as f64 / phased.len() as f64,
        });
    }
    places
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn excess_that_sits_at_reversals_is_found_there() {
        let time_s: Vec<f64> = (0..20_000).map(|k| f64::from(k) * 1e-3).collect();
        let rate: Vec<f64> = time_s.iter().map(|t| if (t * 0.5).fract() < 0.5 { 1.0 } else { -1.0 }).collect();
        let at_reversal: Vec<bool> = phases(&time_s, &rate).iter().map(|&p| p == Phase::Reversal).collect();
        // The noise of the claimed size is in the error everywhere; its sign does not matter for squares.
        let error: Vec<f64> = at_reversal.iter().map(|&r| if r { 0.05_f64.hypot(0.01) } else { 0.01 }).collect();
        let residuals = Residuals { noise: vec![0.01; time_s.len()], rigid_error: error.clone(), time_s, error, rate };
        let places = places("elbow", "deg", 1.0, &[&residuals]);
        let reversal = places.iter().find(|p| p.phase == Phase::Reversal).unwrap();
        assert_relative_eq!(reversal.share_of_excess, 1.0, epsilon = 1e-9);
        assert_relative_eq!(reversal.share_of_time, 0.285, epsilon = 0.01);
        let gap = Gap::new("elbow", "deg", 1.0, &residuals).unwrap();
        assert_relative_eq!(gap.noise_floor, 0.01, epsilon = 1e-12);
        assert_relative_eq!(gap.before, (0.01_f64.powi(2) + 0.05_f64.powi(2) * reversal.share_of_time).sqrt(), epsilon = 1e-9);
    }
}
