//! Errors of joint estimates against reference encoders, as in the paper's Table I.

use nalgebra::Vector3;
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
pub fn rms_of(series: &ErrorSeries) -> Option<f64> {
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

    /// RMS per block of [`BLOCK_S`], what the controller believed and filter, for the paired test.
    #[must_use]
    pub fn blocks(&self) -> [Vec<f64>; 2] {
        let start = self.believed.first().map_or(0.0, |(t, _)| *t);
        let rms_blocks = |series: &ErrorSeries| {
            series
                .chunk_by(|(a, _), (b, _)| ((a - start) / BLOCK_S).floor() == ((b - start) / BLOCK_S).floor())
                .filter_map(|block| rms(&block.iter().map(|(_, e)| *e).collect::<Vec<_>>()))
                .collect()
        };
        [rms_blocks(&self.believed), rms_blocks(&self.filter)]
    }
}

/// Paired t test of filter against belief over the blocks of all logs, for one joint.
#[must_use]
pub fn paired(errors: &[JointErrors]) -> Option<TTest> {
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for [b, a] in errors.iter().map(JointErrors::blocks) {
        if b.len() == a.len() {
            before.extend(b);
            after.extend(a);
        }
    }
    TTest::paired(&before, &after)
}
