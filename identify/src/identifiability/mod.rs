//! What a recording can say, beside what it says: bounds, twins, and intervals where deviations mislead.
//!
//! A number that came out of an estimation may be the prior in other clothes. [`cramer_rao`] tells how well each unknown could be known,
//! [`weakest`] which of them stand in for each other, [`profile`] how far a badly known one may go.

pub mod cramer_rao;
pub mod profile;
pub mod weakest;

use std::fmt::Write as _;

use raven::Result;
use raven::robot::Robot;
use serde::Serialize;

use crate::batch::{Estimate, Residuals};
use crate::parameters::Quantity;
use crate::priors::Unknown;
use crate::problem::Problem;
use cramer_rao::{Scaled, beside_known, information};
use weakest::Weakest;

/// Ratio of posterior to prior deviation above which a standard deviation is not to be trusted and the profile is taken.
const PROFILED_ABOVE: f64 = 0.3;

/// What a recording can say about the unknowns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identifiability {
    /// One per unknown.
    pub parameters: Vec<Line>,
    /// Largest over least eigenvalue of the information with unit diagonal: 1 if no unknown resembles another.
    pub condition_number: Option<f64>,
    /// The unknowns that stand in for each other, in words.
    pub weakest_direction: Option<String>,
}

/// What a recording can say about one unknown, in SI units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Posterior over prior deviation: 1 if the recording said nothing.
    pub posterior_over_prior: f64,
    /// Cramer-Rao deviation with all other unknowns known; null if it does not show.
    pub cramer_rao_alone: Option<f64>,
    /// Cramer-Rao deviation with all other unknowns estimated; null if it does not show.
    pub cramer_rao_with_all: Option<f64>,
    /// 95 % interval of the profile likelihood, where it was taken; an end is null where it is open.
    pub profile_interval: Option<[Option<f64>; 2]>,
    #[serde(skip)]
    shown: (&'static str, f64),
}

impl Identifiability {
    /// Of a problem at its estimate.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn of(robot: &Robot, problem: &Problem<'_>, unknowns: &[Unknown], estimate: &Estimate) -> Result<Self> {
        // What the cameras may have wrong is not asked about, and known beforehand.
        let information = beside_known(&information(&problem.sighting_jacobian(&estimate.z)?), unknowns.len());
        let scaled = Scaled::new(&information);
        let with_all = scaled.with_all();
        let weakest = Weakest::new(&scaled);
        let all: Vec<usize> = (0..Residuals::unknowns(problem)).collect();
        // Registration and unnamed hard stops are estimated along; nobody asked for them.
        let asked = |u: &Unknown| !u.quantity.is_registration() && (u.named || !matches!(u.quantity, Quantity::HardStop(_)));
        let profiled = |k: &usize| unknowns.get(*k).is_some_and(asked) && estimate.std[*k] > PROFILED_ABOVE;
        let mut intervals = vec![None; unknowns.len()];
        if all.iter().any(profiled) {
            let jacobian = problem.jacobian(&estimate.z, &all)?;
            for k in all.iter().copied().filter(|k| profiled(k)) {
                intervals[k] = Some(profile::interval(problem, &jacobian, estimate, k)?);
            }
        }
        let finite = |v: f64| v.is_finite().then_some(v);
        let line = |(k, unknown): (usize, &Unknown)| {
            let value = unknown.value(estimate.z[k]);
            Line {
                name: unknown.quantity.name(),
                unit: unknown.quantity.unit(robot),
                posterior_over_prior: estimate.std[k],
                cramer_rao_alone: finite(unknown.std(value, scaled.alone[k])),
                cramer_rao_with_all: finite(unknown.std(value, with_all[k])),
                profile_interval: intervals[k].map(|ends| ends.map(|end| end.map(|z| unknown.value(z)))),
                shown: unknown.quantity.shown(robot),
            }
        };
        Ok(Self {
            parameters: unknowns.iter().enumerate().map(line).collect(),
            condition_number: weakest.as_ref().and_then(|w| finite(w.condition)),
            weakest_direction: weakest.map(|w| w.sentence(unknowns, &information)),
        })
    }

    /// The table.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!(
            "\n{:<15} {:>15} {:>12} {:>12} {:<7}  {}\n",
            "parameter", "posterior/prior", "CRLB alone", "with all", "unit", "95 % by profile likelihood"
        );
        for line in &self.parameters {
            let (unit, factor) = line.shown;
            let bound = |v: Option<f64>| v.map_or_else(|| "hidden".to_owned(), |v| digits(v * factor));
            let _ = writeln!(
                text,
                "{:<15} {:>15.3} {:>12} {:>12} {:<7}  {}",
                line.name,
                line.posterior_over_prior,
                bound(line.cramer_rao_alone),
                bound(line.cramer_rao_with_all),
                unit,
                line.interval(factor)
            );
        }
        let condition = self.condition_number.map_or_else(|| "infinite".to_owned(), |c| format!("{c:.1e}"));
        let _ =
            writeln!(text, "weakest direction (condition number {condition}): {}", self.weakest_direction.as_deref().unwrap_or("none."));
        text.push('\n');
        text
    }
}

impl Line {
    fn interval(&self, factor: f64) -> String {
        let number = |v: f64| digits(v * factor);
        match self.profile_interval {
            None => "-".to_owned(),
            Some([None, None]) => "open to both sides".to_owned(),
            Some([Some(low), None]) => format!("above {}, open to the right", number(low)),
            Some([None, Some(high)]) => format!("below {}, open to the left", number(high)),
            Some([Some(low), Some(high)]) => format!("{} to {}", number(low), number(high)),
        }
    }
}

/// Three digits, as people write them.
fn digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.0}");
    }
    let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits() {
        assert_eq!([0.0181, 1.813, 18_134.0, 0.0, -0.5].map(digits), ["0.0181", "1.81", "18134", "0", "-0.500"]);
    }
}
