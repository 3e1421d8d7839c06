//! The robot file with what was found out, and where each number came from.

use raven::Result;
use raven::robot::{Provenance, Robot};

use crate::batch::Estimate;
use crate::priors::Unknown;
use crate::session::Session;

/// What was found out about one unknown, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What was asked.
    pub unknown: Unknown,
    /// Value: the prior's, if a number of the robot was not identified.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Whether the logs determined it.
    pub identified: bool,
}

impl Finding {
    /// One finding per unknown.
    #[must_use]
    pub fn all(unknowns: &[Unknown], estimate: &Estimate) -> Vec<Self> {
        let find = |(k, unknown): (usize, &Unknown)| {
            let value = unknown.value(estimate.z[k]);
            Self { value, std: unknown.std(value, estimate.std[k]), identified: estimate.identified[k], unknown: unknown.clone() }
        };
        unknowns.iter().enumerate().map(find).collect()
    }

    /// How many prior deviations the value is from the prior.
    #[must_use]
    pub fn deviations(&self) -> f64 {
        let Unknown { quantity, prior, spread, .. } = &self.unknown;
        let moved = if quantity.is_positive() { (self.value / prior).ln() } else { self.value - prior };
        (moved / spread).abs()
    }
}

/// The robot file with the findings in it.
///
/// The logs were recorded while the controller set the encoders by the numbers of the file before. Where new numbers would make another
/// motor angle of the hard stop, the old one is written down, so that the same logs read the same.
///
/// # Errors
/// If the robot is no arm.
pub fn identified(robot: &Robot, findings: &[Finding], friction_holds: bool, method: &str, sessions: &[Session]) -> Result<Robot> {
    let mut new = robot.clone();
    new.joints
        .iter_mut()
        .filter_map(|joint| joint.link_friction.as_mut())
        .for_each(|friction| friction.held_part = f64::from(u8::from(friction_holds)));
    for finding in findings {
        if let Some(value) = new.value_mut(&finding.unknown.key) {
            *value = finding.value;
        }
    }
    new.keep_encoders_of(robot)?;
    let provenance = |finding: &Finding| Provenance {
        parameter: finding.unknown.quantity.name(),
        key: finding.unknown.key.clone(),
        unit: finding.unknown.quantity.unit(robot).to_owned(),
        value: finding.value,
        std: finding.std,
        prior: finding.unknown.prior,
        prior_std: finding.unknown.prior_std(),
        identified: finding.identified,
        method: method.to_owned(),
        logs: sessions.iter().map(|s| s.name.clone()).collect(),
        sha256: sessions.iter().map(|s| s.sha256.clone()).collect(),
    };
    // Newest first: undoing them in order ends at the oldest prior.
    new.calibration.splice(0..0, findings.iter().map(provenance));
    Ok(new)
}
