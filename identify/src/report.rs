//! The result as people read it and as scripts do.

use std::fmt::Write as _;

use nalgebra::Vector3;
use raven::robot::{JointType, Robot};
use raven::stats::chi_square_quantile;
use serde::Serialize;

use crate::batch::Estimate;
use crate::identifiability::Identifiability;
use crate::identified::Finding;
use crate::misfit::FALSE_CHANCE;
use crate::parameters::Quantity;
use crate::systematic::Found;
use crate::tolerances;

/// Mean normalised square above which the model lacks something: twice what noise alone gives.
const NIS_HIGH: f64 = 6.0;
/// Prior deviations beyond which an estimate contradicts what was known.
const CONTRADICTION: f64 = 3.0;

/// What `--json` writes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// One per estimated number.
    pub parameters: Vec<Line>,
    /// What the cameras have wrong in all images alike; null where the logs do not say which cameras placed their tips.
    pub cameras: Option<Found>,
    /// Whether the file's other numbers fit as they are.
    pub as_filed: bool,
    /// What the logs say of the file's numbers that nobody asked for.
    pub tolerances: Vec<tolerances::Found>,
    /// What the logs say of what the motion before each of them left of effects that remember.
    pub left: Vec<tolerances::Found>,
    /// What the logs can say, where it was asked.
    pub identifiability: Option<Identifiability>,
    /// Mean of the sightings' squared residuals, normalised by their covariance; 3 if the model explains all but the noise.
    pub nis_mean: f64,
    /// Sightings used.
    pub sightings: usize,
    /// Of these, the ones so far off that they count as false.
    pub outliers: usize,
    /// What the model leaves unexplained, one standard deviation per joint.
    pub unexplained: Vec<Unexplained>,
    /// By how much residuals within two seconds are alike: the information counts for so much less.
    pub overdispersion: f64,
    /// Length of the logs [s].
    pub log_seconds: f64,
    /// Time spent, reading included [s].
    pub seconds: f64,
    /// Log seconds per second spent.
    pub realtime_factor: f64,
}

/// What the model leaves unexplained at one joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unexplained {
    /// Joint.
    pub joint: String,
    /// Standard deviation.
    pub std: f64,
    /// Unit of it: rad or m.
    pub unit: &'static str,
    #[serde(skip)]
    shown: (&'static str, f64),
}

/// One parameter, in the SI units of the robot file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    /// Name.
    pub name: String,
    /// Joint, `shoulder->elbow` for a coupling, null for the cameras.
    pub joint: Option<String>,
    /// Unit of the four numbers.
    pub unit: &'static str,
    /// Value; the prior's, if a number of the robot was held there.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Value before.
    pub prior: f64,
    /// Standard deviation before.
    pub prior_std: f64,
    /// Whether the logs determined it.
    pub identified: bool,
    #[serde(skip)]
    shown: (&'static str, f64),
    #[serde(skip)]
    quantity: Quantity,
    #[serde(skip)]
    along: bool,
    #[serde(skip)]
    deviations: f64,
}

impl Report {
    /// Of findings about `robot` on `log_seconds` of logs after `seconds` of work. `squares` are the sightings' squared residuals,
    /// normalised by their covariance; `misfit` is what each joint does beside the model [rad, rad, m].
    #[must_use]
    pub fn new(
        robot: &Robot,
        findings: &[Finding],
        estimate: &Estimate,
        squares: &[f64],
        misfit: Vector3<f64>,
        [log_seconds, seconds]: [f64; 2],
    ) -> Self {
        let line = |finding: &Finding| Line {
            name: finding.unknown.quantity.name(),
            joint: finding.unknown.quantity.joint(robot),
            unit: finding.unknown.quantity.unit(robot),
            value: finding.value,
            std: finding.std,
            prior: finding.unknown.prior,
            prior_std: finding.unknown.prior_std(),
            identified: finding.identified,
            shown: finding.unknown.quantity.shown(robot),
            quantity: finding.unknown.quantity,
            along: !finding.unknown.named,
            deviations: finding.deviations(),
        };
        let limit = chi_square_quantile(3, 1.0 - FALSE_CHANCE).unwrap_or(f64::INFINITY) * estimate.scale.powi(2);
        let kept = |(square, residual): (&f64, &Vector3<f64>)| (residual.norm_squared() <= limit).then_some(*square);
        let good: Vec<f64> = squares.iter().zip(&estimate.residuals).filter_map(kept).collect();
        let unexplained = robot.joints.iter().zip(misfit.iter()).map(|(joint, &std)| {
            let unit = if joint.kind == JointType::Prismatic { "m" } else { "rad" };
            Unexplained { joint: joint.name.clone(), std, unit, shown: joint.display_unit() }
        });
        Self {
            parameters: findings.iter().map(line).collect(),
            cameras: None,
            as_filed: false,
            tolerances: Vec::new(),
            left: Vec::new(),
            identifiability: None,
            nis_mean: good.iter().sum::<f64>() / good.len().max(1) as f64,
            sightings: squares.len(),
            outliers: squares.len() - good.len(),
            unexplained: unexplained.collect(),
            overdispersion: estimate.tempering,
            log_seconds,
            seconds,
            realtime_factor: log_seconds / seconds,
        }
    }

    /// The table.
    #[must_use]
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:<15} {:<17} {:>12} {:>9} {:<7} {:>12} {:>9} {:>9}  {}\n",
            "parameter", "joint", "value", "std", "unit", "before", "std", "change", "identified"
        );
        for line in &self.parameters {
            let (unit, factor) = line.shown;
            let decimals = decimals(line.std * factor);
            let number = |v: f64| format!("{:.decimals$}", v * factor);
            let _ = writeln!(
                text,
                "{:<15} {:<17} {:>12} {:>9} {:<7} {:>12} {:>9} {:>9}  {}",
                line.name,
                line.joint.as_deref().unwrap_or("-"),
                number(line.value),
                number(line.std),
                unit,
                number(line.prior),
                number(line.prior_std),
                line.change(),
                if line.identified { "yes" } else { "no" },
            );
        }
        if let Some(Found { disparity_px: [px, px_std, px_before], scale }) = self.cameras {
            let [part, part_std, part_before] = scale.map(|part| 100.0 * part);
            let _ = writeln!(
                text,
                "cameras, in all images alike: disparity {px:+.3} +- {px_std:.3} px (by calibration +- {px_before:.3}), scale {part:+.3} +- {part_std:.3} % (+- {part_before:.3})"
            );
        }
        if !self.tolerances.is_empty() {
            let fit = if self.as_filed { "fit as they are" } else { "do not fit as they are: each may be off by its tolerance" };
            let _ = writeln!(text, "the file's other numbers that move the tip, {}, {fit}", self.tolerances.len());
        }
        let part = |u: &Unexplained| format!("{} {:.2} {}", u.joint, u.std * u.shown.1, u.shown.0);
        let _ = writeln!(text, "left unexplained: {}", self.unexplained.iter().map(part).collect::<Vec<_>>().join(", "));
        if let Some(identifiability) = &self.identifiability {
            text.push_str(&identifiability.table());
        }
        let _ = writeln!(
            text,
            "{} sightings in {:.1} s, {} of them false; mean NIS {:.2} (3 is noise alone); {:.2} s, {:.0} times real time",
            self.sightings, self.log_seconds, self.outliers, self.nis_mean, self.seconds, self.realtime_factor
        );
        text
    }

    /// What a reader should be told beside the table.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for line in self.parameters.iter().filter(|line| line.deviations > CONTRADICTION) {
            let (name, off) = (&line.name, line.deviations);
            let along = line.along && matches!(line.quantity, Quantity::HardStop(_) | Quantity::Rotation(_) | Quantity::Translation(_));
            let advice = if along {
                "name it in --parameters, or look at the registration and the hard stop"
            } else {
                "either the file is wrong there, or it stands in for something that the model lacks"
            };
            warnings.push(format!("{name} is {off:.1} prior deviations from what the files say of it; {advice}."));
        }
        for (what, [value, _, std]) in self.cameras.iter().flat_map(|found| [("disparity", found.disparity_px), ("scale", found.scale)]) {
            let off = (value / std).abs();
            if off > CONTRADICTION {
                warnings
                    .push(format!("the cameras' {what} is {off:.1} deviations from what their calibration says; calibrate them again."));
            }
        }
        for found in self.tolerances.iter().filter(|found| found.tolerances_off.abs() > CONTRADICTION) {
            let (effect, number, off) = (&found.effect, found.parameter, found.tolerances_off.abs());
            warnings.push(format!(
                "{effect} ({number}), which nobody asked for, is {off:.1} of the file's tolerances off; estimate it too, or write down how well it is known."
            ));
        }
        for found in self.left.iter().filter(|found| found.tolerances_off.abs() > CONTRADICTION) {
            let (effect, number, off) = (&found.effect, found.parameter, found.tolerances_off.abs());
            let log = found.recording.map_or_else(String::new, |recording| format!(" log {}", recording + 1));
            warnings.push(format!(
                "{effect} ({number}) begins{log} with {off:.1} times what motion leaves as a rule; either its values in the file are wrong, or it stands in for something that the model lacks."
            ));
        }
        warnings.extend(self.misfit());
        warnings
    }

    /// That the residuals are more than noise, if they are.
    #[must_use]
    pub fn misfit(&self) -> Option<String> {
        (self.nis_mean > NIS_HIGH).then(|| {
            format!(
                "the residuals are {:.1} times what the tip's covariance says: the model lacks something that `raven-diagnose` may name.",
                (self.nis_mean / 3.0).sqrt()
            )
        })
    }
}

impl Line {
    /// Relative change, where there was something to be relative to.
    fn change(&self) -> String {
        match self.quantity {
            Quantity::Latency | Quantity::Rotation(_) | Quantity::Translation(_) | Quantity::HardStop(_) => "-".to_owned(),
            _ if self.prior == 0.0 => "-".to_owned(),
            _ => format!("{:+.2} %", (self.value / self.prior - 1.0) * 100.0),
        }
    }
}

/// Decimals that show two digits of a deviation.
fn decimals(deviation: f64) -> usize {
    if deviation.is_normal() { (1.0 - deviation.abs().log10().floor()).clamp(0.0, 6.0) as usize } else { 3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_digits_of_the_deviation() {
        assert_eq!([0.0181, 1.81, 181.0, 0.0, 1e-12].map(decimals), [3, 1, 0, 3, 6]);
    }
}
