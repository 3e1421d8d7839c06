//! Whitened residuals of recordings against a model: three per tip, one per joint and torque sample.

use nalgebra::Vector3;
use raven::Result;
use raven::camera::Cameras;
use raven::effects::{Model, Shaft, Sited, TipModel, TorqueModel};
use raven::robot::Robot;
use rayon::prelude::*;

use super::data::{Data, WINDOW_S};

/// What a model of rigid links and dry friction is good for, as part of the torque commanded [1].
const TORQUE_MODEL: f64 = 0.02;
/// Time over which its errors are alike [s].
const TORQUE_ALIKE_S: f64 = 0.2;
/// Slowest motor at which the direction of its friction is beyond doubt [rad/s].
const CREEP_RAD_S: f64 = 1.0;

/// Recordings of one robot, and how much each residual weighs.
pub struct Rows<'a> {
    robot: &'a Robot,
    cameras: Option<&'a Cameras>,
    data: &'a [Data],
    /// Per recording, what whitens each sight.
    whiten: Vec<Vec<nalgebra::Matrix3<f64>>>,
    /// Inverse deviations of each torque sample; 0 where it says nothing.
    torque_weight: Vec<Vec<Vector3<f64>>>,
}

/// An effect in the model, at `u` of its parameters.
pub type Setting = (Sited, Vec<f64>);

impl<'a> Rows<'a> {
    /// Of recordings.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(robot: &'a Robot, cameras: Option<&'a Cameras>, data: &'a [Data]) -> Result<Self> {
        let whiten = |data: &Data| {
            let factor = |s: &raven::effects::Sight| {
                s.covariance_m2.cholesky().and_then(|c| c.l().try_inverse()).unwrap_or_else(nalgebra::Matrix3::zeros)
            };
            data.sights.iter().map(factor).collect()
        };
        let torque_weight = data.iter().map(|data| torque_weights(&data.shafts)).collect();
        Ok(Self { robot, cameras, data, whiten: data.iter().map(whiten).collect(), torque_weight })
    }

    /// Whether any recording has tips.
    #[must_use]
    pub fn has_tip(&self) -> bool {
        self.data.iter().any(|data| !data.sights.is_empty())
    }

    /// Whether any recording has torque.
    #[must_use]
    pub fn has_torque(&self) -> bool {
        self.data.iter().any(|data| !data.shafts.is_empty())
    }

    /// Whether the rig's lenses are known.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        self.cameras.is_some_and(|c| c.base_from_left.is_some())
    }

    /// Rows of tips, before those of torques.
    #[must_use]
    pub fn tip_rows(&self) -> usize {
        3 * self.data.iter().map(|data| data.sights.len()).sum::<usize>()
    }

    /// Time of each row [s], recordings one after the other.
    #[must_use]
    pub fn times_s(&self) -> Vec<f64> {
        let mut before = 0.0;
        let mut starts = Vec::new();
        for data in self.data {
            starts.push(before);
            before += data.motors.time_s.last().copied().unwrap_or(0.0) + 1.0;
        }
        let tips = self.data.iter().zip(&starts).flat_map(|(d, s)| d.sights.iter().flat_map(move |sight| [s + sight.stamp_s; 3]));
        let torques = self.data.iter().zip(&starts).flat_map(|(d, s)| d.shafts.iter().flat_map(move |shaft| [s + shaft.time_s; 3]));
        tips.chain(torques).collect()
    }

    /// Whitened measured less predicted with effects built in; rolled out or, a hundred times as fast, settled.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn residuals(&self, settings: &[Setting], rolled_out: bool) -> Result<Vec<f64>> {
        let model = settings.iter().fold(Model::new(self.robot, self.cameras)?, |model, (sited, u)| {
            if u.iter().all(|&u| u == 0.0) { model } else { model.with(sited, u) }
        });
        let mut rows = Vec::new();
        for (data, whiten) in self.data.iter().zip(&self.whiten) {
            if data.sights.is_empty() {
                continue;
            }
            let tip = TipModel::new(&model, &data.motors)?;
            let seen = if rolled_out { tip.rolled_out(&data.sights) } else { tip.settled(&data.sights) };
            for ((sight, whiten), seen) in data.sights.iter().zip(whiten).zip(seen) {
                let row = seen.map_or_else(Vector3::zeros, |seen| whiten * (sight.position_m - seen));
                rows.extend(row.iter().map(|v| if v.is_finite() { *v } else { 0.0 }));
            }
        }
        let torque = TorqueModel::new(&model)?;
        for (data, weights) in self.data.iter().zip(&self.torque_weight) {
            for (shaft, weight) in data.shafts.iter().zip(weights) {
                rows.extend((torque.delivered(&shaft.commanded) - torque.needed(shaft)).component_mul(weight).iter());
            }
        }
        Ok(rows)
    }

    /// Many settings at once.
    ///
    /// # Errors
    /// As [`Self::residuals`].
    pub fn all(&self, settings: &[Vec<Setting>], rolled_out: bool) -> Result<Vec<Vec<f64>>> {
        settings.par_iter().map(|settings| self.residuals(settings, rolled_out)).collect()
    }
}

/// Inverse deviations with which torque samples count: white noise from the samples' own differences, the model's error beside it, and the
/// latter's likeness over time as fewer samples.
fn torque_weights(shafts: &[Shaft]) -> Vec<Vector3<f64>> {
    let mean_square = |j: usize| shafts.iter().map(|s| s.commanded[j].powi(2)).sum::<f64>() / shafts.len().max(1) as f64;
    let model = Vector3::from_fn(|j, _| TORQUE_MODEL * mean_square(j).sqrt());
    let stride_s = shafts.windows(2).map(|w| w[1].time_s - w[0].time_s).fold(f64::INFINITY, f64::min);
    let alike = (TORQUE_ALIKE_S / stride_s).max(1.0);
    let weight = |shaft: &Shaft| {
        Vector3::from_fn(|j, _| {
            let surely_moving = shaft.rate[j].abs() > CREEP_RAD_S + 0.5 * WINDOW_S * shaft.acceleration[j].abs();
            if surely_moving && model[j] > 0.0 { 1.0 / (model[j] * alike.sqrt()) } else { 0.0 }
        })
    };
    shafts.iter().map(weight).collect()
}
