//! Slow stretch that follows the load: a Kelvin-Voigt element in series with the cable.

use super::super::listed::left;
use super::super::tension::under_tension;
use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// Deviation of the part that had not settled as a recording began.
const LEFT: f64 = 0.7;

/// creep.
pub const EFFECT: Effect = Effect {
    id: "creep",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "z' = (ratio gamma / 2 k_e - z) / T in series with the cable, at first as it settles but for a part",
    parameters: &[
        // Cables creep by a millimetre or so under their load, however stiff they are.
        Parameter { name: "ratio", unit: "1/cable stretch", scale: Scale::Magnitude(Size::of(1.5e-3)), tolerance: None },
        Parameter { name: "time", unit: "s", scale: Scale::Shape { middle: 30.0, size: 0.7 }, tolerance: None },
        // 0 for a robot that has stood there, 1 for one that was without load until then.
        Parameter {
            name: "fresh_part",
            unit: "1",
            scale: Scale::State { size: LEFT, most: f64::INFINITY },
            tolerance: Some(|robot, place| left(robot, "creep", place, LEFT)),
        },
    ],
    channels: &[Channel::Tip],
    needs: &[Need::Cable],
    element: None,
    ties: &[
        Tie::near("cable-slip"),
        Tie::near("missed-counts"),
        Tie::near("joint-offset"),
        // What creeps within seconds is a soft spring beside the cable's damper.
        Tie::near("cable-stretch").with(|_, _, values| vec![1.0 / (1.0 + values[0]), values[2]]),
    ],
    separated_by: "a pose held for a minute after a change of load, and again",
    act: |model, place, values| {
        let (j, ratio, time_s, fresh) = (place.first, values[0], values[1], values[2]);
        model.motors.push(Box::new(move |cables, track| {
            let stiffness = cables.stiffness_n[j];
            let per_stretch = 1.0 / cables.transmission.cable_per_motor_m[j];
            let mut crept_m = None;
            under_tension(cables, track, j, |step_s, tension_n, _| {
                let settled_m = ratio * tension_n / (2.0 * stiffness);
                let before = crept_m.unwrap_or(settled_m * (1.0 - fresh));
                let now = settled_m + (before - settled_m) * (-step_s / time_s).exp();
                crept_m = Some(now);
                -now * per_stretch
            });
        }));
    },
};
