//! Torque ripple of the motor.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// torque-ripple.
pub const EFFECT: Effect = Effect {
    id: "torque-ripple",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "a sin(n q_m) on the shaft",
    parameters: &[
        Parameter { name: "amplitude", unit: "shaft torque", scale: Scale::Offset(Size::of(2e-3)), tolerance: None },
        Parameter { name: "per_turn", unit: "1", scale: Scale::Whole { most: 24 }, tolerance: None },
    ],
    channels: &[Channel::Torque],
    needs: &[Need::Motor, Need::Turns],
    element: None,
    ties: &[Tie::near("pulley-eccentricity")],
    separated_by: "a slow turn of the motor",
    act: |model, place, values| {
        model.drives[place.first].ripples.push([values[0], values[1]]);
    },
};
