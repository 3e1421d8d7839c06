//! The robot file with what was found out, and where each number came from.

use raven::Result;
use raven::robot::{Provenance, Robot};

use crate::batch::{Estimate, IDENTIFIED_BELOW};
use crate::parameters;
use crate::priors::Unknown;
use crate::problem::HeldPart;
use crate::session::Session;

/// What was found out about one unknown, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What was asked.
    pub unknown: Unknown,
    /// Value: the prior's, if a number of the robot was held there.
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
        self.unknown.z(self.value).abs()
    }
}

/// How the method of a number begins that `--add-effect` made.
pub const BY_EFFECT: &str = "effect ";

/// What the data left of a number's deviation, as a part of the one before; `None` if there was none before.
///
/// Both are of the place where the number was looked for: a factor that [`identified`] writes is known to a part of itself, and its two
/// deviations are stated at the value and at the value before. Those of an effect are both stated at the value.
#[must_use]
pub fn left(entry: &Provenance, robot: &Robot) -> Option<f64> {
    let is_factor = !entry.method.starts_with(BY_EFFECT)
        && parameters::ALL.iter().any(|quantity| quantity.is_positive() && quantity.key(robot) == entry.key);
    let [at_value, at_prior] = if is_factor { [entry.value, entry.prior] } else { [1.0; 2] };
    let is_one = [entry.prior_std, at_value, at_prior].iter().all(|&number| number > 0.0);
    is_one.then(|| (entry.std / at_value) / (entry.prior_std / at_prior))
}

/// Whether the data determined a number by what its deviations say.
#[must_use]
pub fn is_determined(entry: &Provenance, robot: &Robot) -> bool {
    left(entry, robot).is_some_and(|left| left <= IDENTIFIED_BELOW)
}

/// What stands between a method and what is to be said of its result.
const REMARK: &str = "; ";

/// How numbers were found, as the robot file says it: the method, and what is to be said of its result.
#[must_use]
pub fn remarked(method: &str, remark: Option<String>) -> String {
    remark.map_or_else(|| method.to_owned(), |remark| format!("{method}{REMARK}{remark}"))
}

/// A `method` of the robot file without what it says of the result.
#[must_use]
pub fn unremarked(method: &str) -> &str {
    method.split_once(REMARK).map_or(method, |(method, _)| method)
}

/// What a `method` of the robot file says of the result.
#[must_use]
pub fn remark(method: &str) -> Option<&str> {
    method.split_once(REMARK).map(|(_, remark)| remark)
}

/// The robot file with the findings in it, and friction that holds the other way round where that was found.
///
/// The logs were recorded while the controller set the encoders by the numbers of the file before. Where new numbers would make another
/// motor angle of the hard stop, the old one is written down, so that the same logs read the same.
///
/// # Errors
/// If the robot is no arm.
pub fn identified(robot: &Robot, findings: &[Finding], held: &[HeldPart], method: &str, sessions: &[Session]) -> Result<Robot> {
    let mut new = robot.clone();
    let changes = findings.iter().map(|finding| (finding.unknown.key.clone(), finding.value));
    for (key, value) in changes.chain(held.iter().map(|held| (held.key(robot), held.after))) {
        if let Some(place) = new.value_mut(&key) {
            *place = value;
        }
    }
    new.keep_encoders_of(robot)?;
    let provenance = |parameter: String, key: String, unit: &str, [value, std, prior, prior_std]: [f64; 4], identified: bool| Provenance {
        parameter,
        key,
        unit: unit.to_owned(),
        value,
        std,
        prior,
        prior_std,
        identified,
        method: method.to_owned(),
        logs: sessions.iter().map(|s| s.name.clone()).collect(),
        sha256: sessions.iter().map(|s| s.sha256.clone()).collect(),
    };
    let of_finding = |Finding { unknown, value, std, identified }: &Finding| {
        let numbers = [*value, *std, unknown.prior, unknown.prior_std()];
        provenance(unknown.quantity.name(), unknown.key.clone(), unknown.quantity.unit(robot), numbers, *identified)
    };
    let of_held = |held: &HeldPart| {
        let numbers = [held.after, held.std(), held.before, held.prior_std()];
        provenance(held.name(), held.key(robot), "1", numbers, true)
    };
    // Newest first: undoing them in order ends at the oldest prior.
    new.calibration.splice(0..0, findings.iter().map(of_finding).chain(held.iter().map(of_held)));
    Ok(new)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use raven::camera::Quality;
    use raven::robot::nominal;

    use super::*;
    use crate::parameters::Selection;
    use crate::priors;

    #[test]
    fn a_remark_on_a_method_is_read_back() {
        assert_eq!(remark(&remarked("batch", Some("it fits; badly.".to_owned()))), Some("it fits; badly."));
        assert_eq!(remark(&remarked("batch", None)), None);
    }

    #[test]
    fn what_was_held_is_as_it_was_to_the_digit() {
        let robot = nominal::gold();
        let unknowns = priors::unknowns(&robot, &Selection::default(), &Quality::default()).unwrap();
        let n = unknowns.len();
        let estimate = |z: f64| Estimate {
            z: DVector::from_element(n, z),
            std: vec![0.9; n],
            covariance: DMatrix::identity(n, n),
            identified: vec![false; n],
            residuals: Vec::new(),
            scale: 1.0,
            tempering: 1.0,
        };
        assert!(Finding::all(&unknowns, &estimate(0.0)).iter().all(|finding| finding.value == finding.unknown.prior));
        assert!(Finding::all(&unknowns, &estimate(0.5)).iter().all(|finding| finding.value != finding.unknown.prior));
    }
}
