//! The gap turned about: what a simulation has and the robot lacks.
//!
//! ```text
//! y'' = y_sim - (y_real - m(motors_real)),      y'' - m(motors_sim) = (y_sim - y_real) - (m(motors_sim) - m(motors_real))
//! ```
//!
//! An effect that is added to the model can make up for one that the simulation has too much of only as far as it may have the other sign. A cable
//! that is three times too soft there, friction or play that the robot does not have, have none: the recording would want stretch below zero. Of the
//! simulation, put right by what the recording departs from the model, they are effects as any.

use raven::Result;
use raven::camera::Cameras;
use raven::log::{Recording, TipObservation};
use raven::robot::Robot;

use super::{corrected, deviation};
use crate::attribution::{Attribution, Side};

/// Evidence that what the simulation has too much of has to have beyond what it lacks, in order to be named in its place [nat]: small effects are
/// the one with one sign and the other with the other.
const CLEAR_NATS: f64 = 3.0;

/// Simulations of an arm, put right by what the recordings of the same motion depart from the model, with as many tips as those.
///
/// # Errors
/// If a simulation cannot be held against its recording.
pub fn turned_about(robot: &Robot, cameras: Option<&Cameras>, recordings: &[Recording], simulated: &[Recording]) -> Result<Vec<Recording>> {
    let of = |(real, simulated): (&Recording, &Recording)| {
        let mut simulated = deviation::with_tips(robot, simulated)?;
        let shift_s = corrected(robot, cameras, &simulated, real)?.1.shift_s;
        simulated.tip = as_often(&simulated.tip, &real.tip, shift_s);
        Ok(corrected(robot, cameras, &simulated, real)?.0)
    };
    recordings.iter().zip(simulated).map(of).collect()
}

/// Of tips whose stamps lack `shift_s` to those of others [s] the next to each of these.
fn as_often(tips: &[TipObservation], others: &[TipObservation], shift_s: f64) -> Vec<TipObservation> {
    let apart_s = |tip: &TipObservation, other: &TipObservation| tip.stamp.seconds_since(other.stamp) - shift_s;
    let next = |other: &TipObservation| {
        let after = tips.partition_point(|tip| apart_s(tip, other) < 0.0);
        let beside = after.saturating_sub(1)..(after + 1).min(tips.len());
        beside.min_by(|&a, &b| apart_s(&tips[a], other).abs().total_cmp(&apart_s(&tips[b], other).abs()))
    };
    let mut kept: Vec<usize> = others.iter().filter_map(next).collect();
    kept.sort_unstable();
    kept.dedup();
    kept.into_iter().map(|k| tips[k].clone()).collect()
}

/// What the robot has and the simulation lacks, or, where that has clearly more evidence [nat], what the simulation has and the robot lacks.
#[must_use]
pub fn stronger([robot, simulation]: [Attribution; 2], [of_robot, of_simulation]: [f64; 2]) -> Attribution {
    let clearly = !simulation.effects.is_empty() && of_simulation > of_robot + CLEAR_NATS;
    let (chosen, side) = if clearly { (simulation, Side::Simulation) } else { (robot, Side::Robot) };
    Attribution { side: Some(side), ..chosen }
}
