//! What a motion tells about each unknown, before anybody makes it: the information of its rollouts.
//!
//! `F = sum J' R^-1 J` over the measurements of a sensor, with `J` from rollouts that differ by a thousandth of a prior deviation. The
//! expected posterior over prior deviation is `sqrt(((F + 1)^-1)_kk)`. Informations of motions and sensors add up.

use nalgebra::{DMatrix, DVector, Vector3};
use raven::Result;
use raven::robot::{MotorTrack, Observation, Robot};
use rayon::prelude::*;

use crate::batch::forward_difference;
use crate::identifiability::cramer_rao;
use crate::motion::Motion;
use crate::prediction::Predictor;
use crate::priors::Unknown;
use crate::problem::Problem;
use crate::tolerances::Tolerances;

/// Noise of the nominal pair of webcams in frame 0 [m], whose y axis is the depth: a tenth of a pixel at 0.4 m.
const CAMERA_M: Vector3<f64> = Vector3::new(1e-4, 1.5e-3, 1e-4);
/// Noise of joint encoders [rad, rad, m]: a step of 80 000 per turn, and 5 um (the paper's reference encoders).
const ENCODER: Vector3<f64> = Vector3::new(7.85e-5, 7.85e-5, 5e-6);
/// Time at the ends of a motion in which nothing counts [s]: a latency reaches beyond them.
const MARGIN_S: f64 = 0.1;

/// What measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sensor {
    /// Two cameras that see the tip at a rate [Hz].
    Camera(f64),
    /// Encoders at the joints, read at a rate [Hz].
    JointEncoders(f64),
}

/// Information per prior deviation of the unknowns and, after them, per tolerance of the numbers beside them, without the prior.
///
/// # Errors
/// If the robot is no arm, or a tolerance is one that no such hardware has.
pub fn information(robot: &Robot, unknowns: &[Unknown], beside: &Tolerances, track: &MotorTrack, sensor: Sensor) -> Result<DMatrix<f64>> {
    let n = unknowns.len() + beside.len();
    let Some(motion) = Motion::new(track.clone(), f64::INFINITY) else { return Ok(DMatrix::zeros(n, n)) };
    let problem = Problem::new(robot, unknowns, &[])?;
    let seen = |z: &DVector<f64>| measured(&problem.robot(z), &motion, sensor);
    let z = DVector::zeros(unknowns.len());
    let here = seen(&z)?;
    let column = |k: usize| forward_difference(seen, &here, &z, k);
    let mut jacobian: Vec<_> = (0..unknowns.len()).into_par_iter().map(column).collect::<Result<_>>()?;
    jacobian.extend(beside.slopes(robot, |robot, _| measured(robot, &motion, sensor))?);
    Ok(cramer_rao::information(&jacobian))
}

/// Measurements over their noise.
fn measured(robot: &Robot, motion: &Motion, sensor: Sensor) -> Result<Vec<Vector3<f64>>> {
    let [start, end] = motion.span_s();
    let times = |rate_hz: f64| -> Vec<f64> {
        let count = ((end - start - 2.0 * MARGIN_S) * rate_hz).max(0.0) as usize;
        (0..count).map(|i| start + MARGIN_S + i as f64 / rate_hz).collect()
    };
    Ok(match sensor {
        Sensor::Camera(rate_hz) => {
            let (predictor, times) = (Predictor::new(robot)?, times(rate_hz));
            let driving = predictor.driving(motion);
            let lag = predictor.lag(motion, &times);
            let seen = |(&t, lag): (&f64, &Vector3<f64>)| predictor.seen_lagging_m(&driving, t, lag).component_div(&CAMERA_M);
            times.iter().zip(&lag).map(seen).collect()
        }
        Sensor::JointEncoders(rate_hz) => {
            // They stand on the robot's own clock and see no camera.
            let mut blind = robot.clone();
            blind.observation = Observation::default();
            let predictor = Predictor::new(&blind)?;
            let (times, driving) = (times(rate_hz), predictor.driving(motion));
            let lag = predictor.lag(motion, &times);
            times.iter().zip(&lag).map(|(&t, lag)| (predictor.joints(&driving, t) + lag).component_div(&ENCODER)).collect()
        }
    })
}

/// Expected posterior over prior deviations.
#[must_use]
pub fn ratios(information: &DMatrix<f64>) -> Vec<f64> {
    let n = information.nrows();
    let inverse = (information + DMatrix::identity(n, n)).cholesky().map_or_else(|| DMatrix::identity(n, n), |c| c.inverse());
    inverse.diagonal().iter().map(|v| v.sqrt()).collect()
}
