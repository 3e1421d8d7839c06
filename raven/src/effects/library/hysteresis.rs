//! Rate-independent play between capstan and cable: a loop after every reversal, whatever the load.

use super::super::{Channel, Effect, Parameter, Place, Scale, Scope, Size, Stage, Tie};
use crate::robot::{Hysteresis, KinematicsKind, Robot};

/// Deviation of the lag that the motion before a recording left, of half the loop.
const LEFT: f64 = 0.7;

/// hysteresis.
pub const EFFECT: Effect = Effect {
    id: "hysteresis",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "the cable's end follows the capstan with h of play at the joint on either side",
    parameters: &[
        Parameter { name: "half_loop", unit: "joint", scale: Scale::Magnitude(Size::per_kind(0.008, 0.001)), tolerance: None },
        Parameter { name: "rounding", unit: "1", scale: Scale::Shape { middle: 1.5, size: 0.4 }, tolerance: None },
        // Of the way back on an arm: straight, as all of a sharp play's, per rounded, as all of Dahl's.
        Parameter { name: "straightness", unit: "1", scale: Scale::Shape { middle: 1.6, size: 1.5 }, tolerance: None },
        // What the motion before the recording left.
        Parameter { name: "lag_at_start", unit: "1", scale: Scale::State { size: LEFT, most: 1.0 }, tolerance: Some(lag_left) },
    ],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("backlash"), Tie::near("link-coulomb-friction")],
    separated_by: "reversals at many amplitudes, loaded and unloaded",
    act: |model, place, values| {
        // On a bench, whose joints are not rolled out, a sharp play is what friction makes of a cable's stretch.
        let straight_part =
            if matches!(model.robot.kinematics, KinematicsKind::Bench) { 0.0 } else { (values[2] - 1.0) / (values[2] + 1.0) };
        let hysteresis = &mut model.robot.joints[place.first].hysteresis;
        let (own, half_loop) = (*hysteresis, hysteresis.half_loop + values[0]);
        // Beside a loop that the file has, each shapes their sum by its part of it.
        let part = if half_loop > 0.0 { values[0] / half_loop } else { 0.0 };
        let shaped = |of_file: f64, added: f64| of_file + part * (added - of_file);
        *hysteresis = Hysteresis {
            half_loop,
            length: shaped(own.length, values[1] * values[0]),
            straight_part: shaped(own.straight_part, straight_part),
            lag_at_start: (own.lag_at_start + values[3]).clamp(-1.0, 1.0),
        };
    },
};

/// Where in its loop the motion before a recording left a cable, nobody knows.
fn lag_left(robot: &Robot, place: Place) -> f64 {
    let has_loop = robot.joints.get(place.first).is_some_and(|joint| joint.hysteresis.half_loop > 0.0);
    if has_loop { LEFT } else { 0.0 }
}
