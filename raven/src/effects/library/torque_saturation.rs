//! A drive that clips below its command.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage};

/// torque-saturation.
pub const EFFECT: Effect = Effect {
    id: "torque-saturation",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "the delivered torque is clipped at a limit",
    parameters: &[Parameter { name: "limit", unit: "drive torque", scale: Scale::Shape { middle: 0.15, size: 1.0 }, tolerance: None }],
    channels: &[Channel::Torque],
    needs: &[],
    element: None,
    ties: &[],
    separated_by: "fast motion",
    act: |model, place, values| {
        let limit = &mut model.drives[place.first].torque_limit;
        *limit = limit.min(values[0]);
    },
};
