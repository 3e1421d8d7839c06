//! More dry friction of the motor at creep speed.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// stribeck-friction.
pub const EFFECT: Effect = Effect {
    id: "stribeck-friction",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "tau_c (1 + d exp(-(v / v_s)^2)), speed at the motor",
    parameters: &[
        Parameter { name: "depth", unit: "1", scale: Scale::Magnitude(Size::of(0.5)), tolerance: None },
        Parameter { name: "speed", unit: "motor speed", scale: Scale::Shape { middle: 5.0, size: 0.5 }, tolerance: None },
    ],
    channels: &[Channel::Torque],
    needs: &[Need::Motor],
    element: None,
    ties: &[Tie::near("motor-coulomb-friction")],
    separated_by: "ramps at a tenth of a degree per second",
    act: |model, place, values| {
        model.drives[place.first].stribeck.push([values[0], values[1]]);
    },
};
