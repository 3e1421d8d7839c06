//! A cable softer or stiffer than its data sheet.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};

/// cable-stretch.
pub const EFFECT: Effect = Effect {
    id: "cable-stretch",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "k_e times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::Factor(1.4),
        tolerance: Some(|robot, _| robot.tolerances.stiffness),
    }],
    channels: &[Channel::Tip],
    ties: &[Tie { id: "payload", exact: false }, Tie { id: "link-coulomb-friction", exact: false }],
    separated_by: "the same pose with and without a load; gravity that changes sides",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(cable) = &mut joint.cable {
            cable.stiffness *= values[0];
        }
    },
};
