//! Viscous friction at the joint.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};

/// link-viscous-friction.
pub const EFFECT: Effect = Effect {
    id: "link-viscous-friction",
    scope: Scope::Joint,
    stage: Stage::Link,
    summary: "F_v times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::Factor(2.5),
        tolerance: Some(|robot, _| robot.tolerances.link_friction),
    }],
    channels: &[Channel::Tip, Channel::Torque],
    ties: &[Tie { id: "motor-viscous-friction", exact: false }, Tie { id: "time-offset", exact: false }],
    separated_by: "several speeds in both directions",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(friction) = &mut joint.link_friction {
            friction.viscous *= values[0];
        }
    },
};
