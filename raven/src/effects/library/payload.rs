//! A mass at the tracked point.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// payload.
pub const EFFECT: Effect = Effect {
    id: "payload",
    scope: Scope::Robot,
    stage: Stage::Link,
    summary: "m at the tracked point",
    parameters: &[Parameter { name: "mass", unit: "kg", scale: Scale::Magnitude(Size::of(0.2)), tolerance: None }],
    channels: &[Channel::Tip, Channel::Torque],
    needs: &[],
    element: None,
    ties: &[Tie::near("cable-stretch")],
    separated_by: "poses with the load on either side, and with a known mass",
    act: |model, _, values| {
        model.robot.payload += values[0];
    },
};
