//! A robot session in time: from the hard stop to the first set-point, then the motion, one sample per control cycle.

use nalgebra::Vector3;

use super::controller::{CYCLE_S, Controller, Cycle};
use super::machine::Machine;
use super::motion::Trajectory;
use super::plant::{Plant, STEP_S};
use crate::Result;
use crate::robot::Robot;

/// Time the robot takes from its hard stop to the first set-point, and rests there [s].
const APPROACH_S: f64 = 2.5;
const REST_S: f64 = 1.0;

/// Controller and machine at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// What the controller read and did.
    pub cycle: Cycle,
    /// Set-point of the joints [rad, rad, m].
    pub joint_wanted: Vector3<f64>,
    /// Where the joints really are [rad, rad, m].
    pub joint: Vector3<f64>,
    /// Their true velocities.
    pub joint_rate: Vector3<f64>,
    /// Force differences of the cables [N].
    pub tension: Vector3<f64>,
}

/// A session of the robot, sampled every control cycle from time zero.
#[derive(Debug, Clone)]
pub struct Trace {
    samples: Vec<Sample>,
}

/// A recording in the making.
#[derive(Debug)]
pub struct Recorder {
    plant: Plant,
    controller: Controller,
    step_s: f64,
}

impl Recorder {
    /// A robot that is at rest in its hard stop, with encoders set there.
    ///
    /// # Errors
    /// If the robot file lacks what the model needs.
    pub fn at_hard_stop(robot: &Robot, machine: Machine, zero_counts: [i32; 3]) -> Result<Self> {
        let mut controller = Controller::new(robot, zero_counts)?;
        controller.compensate_gravity(false);
        Ok(Self { plant: Plant::at_hard_stop(machine), controller, step_s: STEP_S })
    }

    /// Integrates in other steps than [`STEP_S`]: whether they are short enough.
    #[cfg(test)]
    pub fn with_step(mut self, step_s: f64) -> Self {
        self.step_s = step_s;
        self
    }

    /// Lets go of the stop and moves to `joint`, to rest there.
    pub fn approach(&mut self, joint: Vector3<f64>) {
        self.plant.hold_links(false);
        self.controller.compensate_gravity(true);
        let stop = self.controller.transmission().joint_from_motor(&self.plant.state().motor);
        let path = Trajectory::rest(stop).then(0.0, APPROACH_S, joint);
        let cycles = ((APPROACH_S + REST_S) / CYCLE_S).round() as u64;
        for k in 0..cycles {
            self.cycle(&path, k as f64 * CYCLE_S, &[0; 3]);
        }
    }

    /// Follows a trajectory for `duration_s`; `each` hears of every thousandth cycle.
    pub fn record(&mut self, path: &Trajectory, duration_s: f64, mut each: impl FnMut()) -> Trace {
        let cycles = (duration_s / CYCLE_S).round() as u64;
        let samples = (0..cycles).map(|k| {
            let time_s = k as f64 * CYCLE_S;
            let missed = std::array::from_fn(|j| {
                let drive = &self.plant.machine().drives[j];
                let step = drive.missed_counts.filter(|[_, part]| time_s >= part * duration_s).map_or(0, |[counts, _]| counts as i32);
                step + drive.wander.map_or(0, |wander| wander.counts(time_s))
            });
            if k % 1000 == 999 {
                each();
            }
            self.cycle(path, time_s, &missed)
        });
        Trace { samples: samples.collect() }
    }

    /// Controller.
    #[must_use]
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    fn cycle(&mut self, path: &Trajectory, time_s: f64, missed: &[i32; 3]) -> Sample {
        let wanted = path.at(time_s);
        let state = *self.plant.state();
        let cycle = self.controller.cycle(&state.motor, missed, &wanted);
        self.plant.advance(&cycle.torque_asked, CYCLE_S, self.step_s);
        Sample {
            cycle,
            joint_wanted: wanted.joint,
            joint: state.joint,
            joint_rate: state.joint_rate,
            tension: Vector3::from_fn(|j, _| state.cables[j].tension_n),
        }
    }
}

impl Trace {
    /// One sample per control cycle.
    #[must_use]
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// Where the joints really were at a time from the start [s], by cubic interpolation; at rest before and after.
    #[must_use]
    pub fn joint_at(&self, time_s: f64) -> Vector3<f64> {
        let last = self.samples.len().saturating_sub(1);
        let place = (time_s / CYCLE_S).clamp(0.0, last as f64);
        let index = (place as usize).min(last.saturating_sub(1));
        let (Some(a), Some(b)) = (self.samples.get(index), self.samples.get((index + 1).min(last))) else {
            return Vector3::zeros();
        };
        let t = place - index as f64;
        let (u, v) = (1.0 - t, t);
        a.joint * (u * u * (1.0 + 2.0 * v))
            + b.joint * (v * v * (1.0 + 2.0 * u))
            + (a.joint_rate * (u * u * v) - b.joint_rate * (v * v * u)) * CYCLE_S
    }
}
