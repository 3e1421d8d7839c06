//! Errors of joint estimates against reference encoders, as in the paper's Table I.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use raven::filter::Tuning;
use raven::log::JointSeries;
use raven::robot::Joint;
use raven::stats::{TTest, rms};
use serde::Serialize;

/// Length of the blocks over which errors are paired [s]: long against the correlation of the errors, short enough for several.
pub const BLOCK_S: f64 = 5.0;
/// What is left of a camera's noise in the average over a hundred sightings: a filter's estimate is no better.
const AVERAGED: f64 = 0.1;

/// One kind of estimate over time.
#[derive(Debug, Clone, Default)]
pub struct Estimate {
    /// [s].
    pub time_s: Vec<f64>,
    /// Joint positions [rad, rad, m].
    pub joints: Vec<Vector3<f64>>,
}

/// Estimates of one log, all on the robot's clock.
#[derive(Debug, Clone, Default)]
pub struct Estimates {
    /// Transmission kinematics as the controller believed them when it recorded.
    pub believed: Estimate,
    /// Transmission kinematics with the parameters in hand, and what the listed effects make of the motors.
    pub kinematic: Estimate,
    /// Inverse kinematics of the observed tip.
    pub camera: Estimate,
    /// Filter, with the observations up to each time.
    pub filter: Estimate,
    /// Smoother, with all observations.
    pub smoother: Estimate,
    /// How filter and smoother were tuned; nothing to tune with the paper's six states.
    pub tuning: Option<Tuning>,
}

/// Errors with their times [s, rad or m].
pub type ErrorSeries = Vec<(f64, f64)>;

/// Errors of all estimates of one joint.
#[derive(Debug, Clone, Default)]
pub struct JointErrors {
    /// Of [`Estimates::believed`].
    pub believed: ErrorSeries,
    /// Of [`Estimates::kinematic`].
    pub kinematic: ErrorSeries,
    /// Of [`Estimates::camera`].
    pub camera: ErrorSeries,
    /// Of [`Estimates::filter`].
    pub filter: ErrorSeries,
    /// Of [`Estimates::smoother`].
    pub smoother: ErrorSeries,
}

/// One row of the result, in the joint's display unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointRow {
    /// Joint name.
    pub joint: String,
    /// `deg` or `mm`.
    pub unit: &'static str,
    /// Transmission kinematics as the controller believed them when it recorded.
    pub rms_kinematic: Option<f64>,
    /// Transmission kinematics with the parameters in hand.
    pub rms_kinematic_identified: Option<f64>,
    /// Camera alone.
    pub rms_camera: Option<f64>,
    /// Filter.
    pub rms_filter: Option<f64>,
    /// Smoother.
    pub rms_smoother: Option<f64>,
    /// By how much the filter is better than what the controller believed; `None` where that is off by less than the noise.
    pub improvement_percent: Option<f64>,
}

/// RMS of errors [rad or m]; `None` of nothing.
#[must_use]
pub fn rms_of(series: &[(f64, f64)]) -> Option<f64> {
    rms(&series.iter().map(|(_, error)| *error).collect::<Vec<_>>())
}

impl JointErrors {
    /// Errors of joint `j` wherever the reference is known.
    #[must_use]
    pub fn new(estimates: &Estimates, reference: &JointSeries, j: usize) -> Self {
        let against = |estimate: &Estimate| Self::against(estimate, reference, j);
        Self {
            believed: against(&estimates.believed),
            kinematic: against(&estimates.kinematic),
            camera: against(&estimates.camera),
            filter: against(&estimates.filter),
            smoother: against(&estimates.smoother),
        }
    }

    /// Errors of one estimate of joint `j` wherever the reference is known.
    #[must_use]
    pub fn against(estimate: &Estimate, reference: &JointSeries, j: usize) -> ErrorSeries {
        let samples = estimate.time_s.iter().zip(&estimate.joints);
        samples.filter_map(|(&t, q)| reference.interpolate(j, t).map(|truth| (t, q[j] - truth))).collect()
    }

    /// The row of the table. Errors below one count of the encoder [rad or m], or far below what the camera sees, are none that anything could be
    /// better than.
    #[must_use]
    pub fn row(&self, joint: &Joint, count: f64) -> JointRow {
        let (unit, scale) = joint.display_unit();
        let rms_of = |series: &ErrorSeries| rms_of(series).map(|rms| rms * scale);
        let (rms_kinematic, rms_filter) = (rms_of(&self.believed), rms_of(&self.filter));
        let noise = (count * scale).max(rms_of(&self.camera).map_or(0.0, |camera| AVERAGED * camera));
        let improvement = rms_kinematic.zip(rms_filter).filter(|(before, _)| *before > noise);
        JointRow {
            joint: joint.name.clone(),
            unit,
            rms_kinematic,
            rms_kinematic_identified: rms_of(&self.kinematic),
            rms_camera: rms_of(&self.camera),
            rms_filter,
            rms_smoother: rms_of(&self.smoother),
            improvement_percent: improvement.map(|(before, after)| 100.0 * (1.0 - after / before)),
        }
    }

    /// RMS in each block of [`BLOCK_S`] that has any, by its number; what the controller believed and filter, for the paired test.
    #[must_use]
    pub fn blocks(&self) -> [BTreeMap<i64, f64>; 2] {
        let start = self.believed.first().map_or(0.0, |(t, _)| *t);
        let number = |(t, _): &(f64, f64)| ((t - start) / BLOCK_S).floor() as i64;
        let rms_blocks = |series: &ErrorSeries| {
            let blocks = series.chunk_by(|a, b| number(a) == number(b));
            blocks.filter_map(|block| Some((number(block.first()?), rms_of(block)?))).collect()
        };
        [rms_blocks(&self.believed), rms_blocks(&self.filter)]
    }
}

/// Paired t test of filter against belief over the blocks of all logs that both have, for one joint.
#[must_use]
pub fn paired(errors: &[JointErrors]) -> Option<TTest> {
    let pairs = errors.iter().map(JointErrors::blocks).flat_map(|[believed, filter]| {
        let pair = move |(number, before)| Some((before, *filter.get(&number)?));
        believed.into_iter().filter_map(pair)
    });
    let (before, after): (Vec<f64>, Vec<f64>) = pairs.unzip();
    TTest::paired(&before, &after)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute of errors of 1 and 3 in turns, block by block, and a filter that halves them where it has estimates.
    fn errors(filter: impl Fn(f64) -> bool) -> JointErrors {
        let times = || (0..600).map(|k| f64::from(k) * 0.1);
        let before = |t: f64| if ((t / BLOCK_S) as u64).is_multiple_of(2) { 1.0 } else { 3.0 };
        JointErrors {
            believed: times().map(|t| (t, before(t))).collect(),
            filter: times().filter(|t| filter(*t)).map(|t| (t, 0.5 * before(t))).collect(),
            ..JointErrors::default()
        }
    }

    #[test]
    fn a_block_is_paired_with_itself() {
        let whole = paired(&[errors(|_| true)]).unwrap();
        assert_eq!(whole.degrees_of_freedom, 11.0);
        // One has no first block, the other no last one: as many as there are, and none beside its own.
        let mut late = errors(|t| t >= BLOCK_S);
        late.believed.retain(|(t, _)| *t < 55.0);
        let paired_late = paired(std::slice::from_ref(&late)).unwrap();
        assert_eq!(paired_late.degrees_of_freedom, 9.0);
        // Every block's error is halved, which pairs of neighbours do not show.
        let mean = |test: TTest| test.t.abs() / (test.degrees_of_freedom + 1.0).sqrt();
        assert!((mean(paired_late) / mean(whole) - 1.0).abs() < 0.1, "{paired_late:?} {whole:?}");
        // A log in which the filter has less than was recorded counts with what there is.
        assert_eq!(paired(&[errors(|_| true), errors(|t| t < 30.0)]).unwrap().degrees_of_freedom, 17.0);
    }
}
