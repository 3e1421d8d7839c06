//! Experiment C: joints over six trials, as the paper's Tables I and II.

use std::path::Path;

use raven::Result;
use raven::filter::consistency::{self, NormalisedSquares};
use raven::robot::Robot;
use raven::stats::TTest;
use serde::Serialize;

use super::{figures, read};
use crate::FilterKind;
use crate::errors::{ErrorSeries, JointErrors};
use crate::estimate::{Settings, estimate, track};

/// The estimates that are compared, in the order of the tables.
pub const ESTIMATES: [&str; 5] = ["as recorded", "kinematics", "six states", "twelve states", "smoother"];
/// Among [`ESTIMATES`]: what the controller believed, and the filter that is tested against it.
const BELIEVED: usize = 0;
const FILTER: usize = 3;

/// Errors of one trial, per joint and estimate [rad, rad, m].
pub type TrialErrors = [[ErrorSeries; 5]; 3];

/// RMS of one trial and joint, in the joint's display unit.
#[derive(Debug, Serialize)]
struct Row {
    trial: usize,
    seconds: f64,
    joint: String,
    unit: &'static str,
    rms: [f64; 5],
    improvement_percent: f64,
}

/// One joint over all trials.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Joint.
    pub joint: String,
    /// Of the means.
    pub unit: &'static str,
    /// RMS of each of [`ESTIMATES`], weighted by the trials' durations.
    pub weighted: [f64; 5],
    /// RMS over all samples: of the squares, not of the roots.
    pub pooled: [f64; 5],
    /// What the filter gains over what the controller believed, by the weighted means.
    pub improvement_percent: f64,
    /// The paper's test, which takes the trials of both for independent.
    pub unpaired: Option<TTest>,
    /// The test of this design: each trial before and after.
    pub paired: Option<TTest>,
}

impl Summary {
    /// From durations [s] and the RMS of every trial.
    #[must_use]
    pub fn new(joint: String, unit: &'static str, seconds: &[f64], rms: &[[f64; 5]]) -> Self {
        let total: f64 = seconds.iter().sum();
        let weighted_by = |value: &dyn Fn(f64) -> f64| -> [f64; 5] {
            std::array::from_fn(|e| seconds.iter().zip(rms).map(|(s, rms)| s * value(rms[e])).sum::<f64>() / total)
        };
        let weighted = weighted_by(&|rms| rms);
        let column = |e: usize| rms.iter().map(|rms| rms[e]).collect::<Vec<_>>();
        Self {
            joint,
            unit,
            weighted,
            pooled: weighted_by(&|rms| rms * rms).map(f64::sqrt),
            improvement_percent: 100.0 * (1.0 - weighted[FILTER] / weighted[BELIEVED]),
            unpaired: TTest::unpaired(&column(BELIEVED), &column(FILTER)),
            paired: TTest::paired(&column(BELIEVED), &column(FILTER)),
        }
    }
}

/// Consistency of the twelve-state filter on one trial.
#[derive(Debug, Serialize)]
struct Account {
    trial: usize,
    nis: Option<NormalisedSquares>,
    nees_filter: Option<NormalisedSquares>,
    nees_smoother: Option<NormalisedSquares>,
}

/// What experiment C found.
#[derive(Debug, Serialize)]
pub struct Trials {
    estimates: [&'static str; 5],
    rows: Vec<Row>,
    summary: Vec<Summary>,
    consistency: Vec<Account>,
}

impl Trials {
    /// Replays `fls1.mcap` to `fls6.mcap` of the folder and leaves figures there.
    ///
    /// # Errors
    /// If a log cannot be read or lacks reference encoders.
    pub fn run(robot: &Robot, folder: &Path, settings: &Settings) -> Result<Self> {
        let (mut rows, mut accounts, mut all) = (Vec::new(), Vec::new(), Vec::new());
        let (mut seconds, mut rms): (Vec<f64>, [Vec<[f64; 5]>; 3]) = Default::default();
        for trial in 1..=6 {
            let recording = read(&folder.join(format!("fls{trial}.mcap")), robot)?;
            let reference = recording.require_joint_encoders()?;
            let (_, six_run) = estimate(&recording, robot, &Settings { filter: FilterKind::Paper, ..*settings })?;
            let (estimates, twelve_run) = estimate(&recording, robot, settings)?;
            if trial == 1 {
                figures::over_time(folder, robot, &recording, &estimates, &twelve_run)?;
            }
            let six = track(&six_run.filtered);
            let errors: TrialErrors = [0, 1, 2].map(|j| {
                let joint = JointErrors::new(&estimates, reference, j);
                let six = JointErrors::against(&six, reference, j);
                [joint.believed, joint.kinematic, six, joint.filter, joint.smoother]
            });
            let length = recording.motor_track()?.time_s.last().copied().unwrap_or_default();
            seconds.push(length);
            for (j, joint) in robot.joints.iter().enumerate().take(3) {
                let (unit, scale) = joint.display_unit();
                let of = errors[j].each_ref().map(|series| crate::errors::rms_of(series).map_or(f64::NAN, |rms| rms * scale));
                let improvement_percent = 100.0 * (1.0 - of[FILTER] / of[BELIEVED]);
                rows.push(Row { trial, seconds: length, joint: joint.name.clone(), unit, rms: of, improvement_percent });
                rms[j].push(of);
            }
            accounts.push(Account {
                trial,
                nis: consistency::nis(&twelve_run),
                nees_filter: consistency::nees(&twelve_run.filtered, reference),
                nees_smoother: consistency::nees(&twelve_run.smoothed, reference),
            });
            all.push(errors);
        }
        figures::trials(folder, robot, &all)?;
        let joints = robot.joints.iter().zip(&rms);
        let summary = joints.map(|(joint, rms)| Summary::new(joint.name.clone(), joint.display_unit().0, &seconds, rms)).collect();
        Ok(Self { estimates: ESTIMATES, rows, summary, consistency: accounts })
    }

    /// The tables.
    #[must_use]
    pub fn text(&self) -> String {
        let head = |first: &str| {
            let names = ESTIMATES.map(|name| format!("{name:>14}")).concat();
            format!("{first:<22} {:>4}{names} {:>12}", "unit", "improvement")
        };
        let numbers = |values: &[f64; 5]| values.map(|v| format!("{v:>14.4}")).concat();
        let mut lines = vec!["Experiment C, Table I: RMS error against the joint encoders, per trial".to_owned(), head("trial")];
        for row in &self.rows {
            let name = format!("{} ({:.0} s) {}", row.trial, row.seconds, row.joint);
            lines.push(format!("{name:<22} {:>4}{} {:>10.1} %", row.unit, numbers(&row.rms), row.improvement_percent));
        }
        lines.extend([String::new(), "Table II: means weighted by duration, and pooled over all samples".to_owned(), head("joint")]);
        for s in &self.summary {
            let pooled = 100.0 * (1.0 - s.pooled[FILTER] / s.pooled[BELIEVED]);
            lines.push(format!("{:<22} {:>4}{} {:>10.1} %", s.joint, s.unit, numbers(&s.weighted), s.improvement_percent));
            lines.push(format!("{:<22} {:>4}{} {:>10.1} %", "  pooled", s.unit, numbers(&s.pooled), pooled));
            let p = |test: Option<TTest>| test.map_or_else(|| "-".to_owned(), |t| format!("{:.1e}", t.p));
            lines.push(format!("  P of twelve states against as recorded: unpaired {}, paired {}", p(s.unpaired), p(s.paired)));
        }
        let mean = |of: &dyn Fn(&Account) -> Option<NormalisedSquares>| {
            let found: Vec<f64> = self.consistency.iter().filter_map(of).map(|n| n.times_claimed.powi(2)).collect();
            (found.iter().sum::<f64>() / found.len().max(1) as f64).sqrt()
        };
        lines.push(format!(
            "Errors over what the twelve states claim: innovations {:.2}, joints of the filter {:.2}, of the smoother {:.2}.\n",
            mean(&|a| a.nis),
            mean(&|a| a.nees_filter),
            mean(&|a| a.nees_smoother)
        ));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Haghighipanah et al. 2017, Table II, transmission kinematics and filter [deg, deg, mm]: means and the improvements printed.
    ///
    /// The first two follow from their means. The third does not: weighted by duration, Table I's own column gives 0.0798 and 71.78 %.
    #[test]
    fn improvements_of_the_papers_table_follow_from_its_means() {
        let improvement = |before: f64, after: f64| {
            let mut rms = [0.0; 5];
            (rms[BELIEVED], rms[FILTER]) = (before, after);
            Summary::new("joint".to_owned(), "deg", &[1.0], &[rms]).improvement_percent
        };
        assert!((improvement(1.3051, 0.7419) - 43.15).abs() < 0.01);
        assert!((improvement(2.4649, 1.6410) - 33.42).abs() < 0.01);
        assert!((improvement(0.2828, 0.0798) - 71.78).abs() < 0.01);
        assert!((improvement(0.2828, 0.0798) - 72.05).abs() > 0.2);
    }

    #[test]
    fn weights_and_pooling_tell_long_trials_from_short_ones() {
        let rms = [[4.0, 0.0, 0.0, 2.0, 0.0], [1.0, 0.0, 0.0, 1.0, 0.0]];
        let summary = Summary::new("elbow".to_owned(), "deg", &[100.0, 300.0], &rms);
        assert!((summary.weighted[BELIEVED] - 1.75).abs() < 1e-12 && (summary.weighted[FILTER] - 1.25).abs() < 1e-12);
        assert!((summary.pooled[BELIEVED] - 4.75_f64.sqrt()).abs() < 1e-12);
        assert!((summary.improvement_percent - 100.0 * (1.0 - 1.25 / 1.75)).abs() < 1e-9);
        assert!(summary.paired.is_some() && summary.unpaired.is_some());
    }
}
