//! How large the gap is.

use raven::plot::svg::figure;
use raven::stats::rms;
use serde::Serialize;

use crate::residual::Residuals;
use crate::whereabouts::Channel;

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
    /// The same against the robot model, its cables and links rolled out over the recorded motor angles. It begins as the motion before left effects
    /// that the file has. Of a bench, whose cables stretch by its torque, transmission kinematics once more.
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

/// How far the motors come away from where they were recorded, driven by the recorded torque through the model for a horizon.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MotorMotion {
    /// Joint.
    pub joint: String,
    /// Unit of `rms`: that of the joint, which the motor's angle is taken to rigidly.
    pub unit: &'static str,
    /// The motors were where they were recorded to be so long before [s].
    pub horizon_s: f64,
    /// RMS of recorded less simulated.
    pub rms: f64,
    /// Horizons behind it.
    pub observations: usize,
}

/// Of the channels that have a horizon of their own.
#[must_use]
pub fn motor_motion(channels: &[Channel]) -> Vec<MotorMotion> {
    let of = |channel: &Channel| {
        let error: Vec<f64> = channel.tracks.iter().flat_map(|track| &track.error).copied().collect();
        Some(MotorMotion {
            joint: channel.joint.clone()?,
            unit: channel.unit,
            horizon_s: channel.horizon_s?,
            rms: rms(&error)? * channel.scale,
            observations: error.len(),
        })
    };
    channels.iter().filter_map(of).collect()
}

/// What a long horizon of [`MotorMotion`] is worth.
pub const LONG_HORIZONS: &str = "Over a long horizon that is the error of the torque integrated twice, open loop: it says how far a simulation \
                                 goes astray, and little of the cause.";

/// What drives the motors: where recordings are held against a simulation, the torque is put right by what that departs from the model.
#[must_use]
pub fn driven_by(is_against: bool) -> &'static str {
    if is_against { "the recorded torque, less what the simulation's departs from the model," } else { "the recorded torque" }
}

/// Motor motion as a terminal shows it: a line per joint, a column per horizon.
#[must_use]
pub fn motor_words(all: &[MotorMotion], is_against: bool) -> String {
    let mut text = String::new();
    for of_joint in all.chunk_by(|a, b| a.joint == b.joint) {
        if text.is_empty() {
            let torque = driven_by(is_against);
            text += &format!("\nMotors driven by {torque} through the model (rms from where they were recorded, at the joint)\n");
        }
        let [first, ..] = of_joint else { continue };
        let columns: Vec<String> = of_joint.iter().map(|m| format!("{} after {} s", figure(m.rms), m.horizon_s)).collect();
        text += &format!("{:<10} {:>4}  {}\n", first.joint, first.unit, columns.join(", "));
    }
    if !text.is_empty() {
        text += LONG_HORIZONS;
        text += "\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn motors_that_go_astray_over_a_long_horizon_say_little_of_the_cause() {
        let after = |horizon_s, rms| MotorMotion { joint: "elbow".to_owned(), unit: "deg", horizon_s, rms, observations: 9 };
        let text = motor_words(&[after(0.05, 0.001_234), after(5.0, 44.8561)], false);
        assert!(text.contains("elbow       deg  0.00123 after 0.05 s, 44.9 after 5 s\n") && text.contains("integrated twice"), "{text}");
        assert!(motor_words(&[], true).is_empty());
    }

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
