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

/// Simulations of an arm, put right by what the recordings of the same motion depart from the model, with as many tips as those; stamps of each lack
/// `shifts_s` to its recording's [s].
///
/// # Errors
/// If a simulation cannot be held against its recording.
pub fn turned_about(
    robot: &Robot,
    cameras: Option<&Cameras>,
    recordings: &[Recording],
    simulated: &[Recording],
    shifts_s: impl Iterator<Item = f64>,
) -> Result<Vec<Recording>> {
    let of = |((real, simulated), shift_s): ((&Recording, &Recording), f64)| {
        let mut simulated = deviation::with_tips(robot, simulated)?;
        simulated.tip = as_often(&simulated.seen_tips().collect::<Vec<_>>(), &real.seen_tips().collect::<Vec<_>>(), shift_s);
        Ok(corrected(robot, cameras, &simulated, real)?.0)
    };
    recordings.iter().zip(simulated).zip(shifts_s).map(of).collect()
}

/// Of tips whose stamps lack `shift_s` to those of others [s] the next to each of these.
fn as_often(tips: &[&TipObservation], others: &[&TipObservation], shift_s: f64) -> Vec<TipObservation> {
    let apart_s = |tip: &TipObservation, other: &TipObservation| tip.stamp.seconds_since(other.stamp) + shift_s;
    let next = |other: &&TipObservation| {
        let after = tips.partition_point(|tip| apart_s(tip, other) < 0.0);
        let beside = after.saturating_sub(1)..(after + 1).min(tips.len());
        beside.min_by(|&a, &b| apart_s(tips[a], other).abs().total_cmp(&apart_s(tips[b], other).abs()))
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

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};
    use raven::log::{Stamp, TipStatus};

    use super::*;

    #[test]
    fn a_simulation_that_logs_more_often_has_as_many_tips_as_its_recording() {
        let tip = |time_s: f64| TipObservation {
            stamp: Stamp(0).plus_seconds(time_s),
            frame_id: String::new(),
            status: TipStatus::Seen,
            left_px: [f64::NAN; 2],
            right_px: [f64::NAN; 2],
            position_m: Vector3::zeros(),
            covariance_m2: Matrix3::zeros(),
        };
        // At 100 Hz and an epoch that is 7 s later; the recording begins before and ends after.
        let simulated: Vec<TipObservation> = (0..100).map(|k| tip(7.0 + 0.01 * f64::from(k))).collect();
        let real: Vec<TipObservation> = (-1..16).map(|k| tip(1.002 + 0.066 * f64::from(k))).collect();
        let [simulated, real]: [Vec<&TipObservation>; 2] = [&simulated, &real].map(|tips| tips.iter().collect());
        let kept = as_often(&simulated, &real, -6.0);
        // The first and the last stand for what lies beyond them once.
        assert_eq!(kept.len(), 16);
        for (kept, real) in kept.iter().zip(&real[1..]) {
            assert!((kept.stamp.seconds_since(real.stamp) - 6.0).abs() < 0.0051);
        }
        assert!(as_often(&[], &real, -6.0).is_empty());
    }
}
