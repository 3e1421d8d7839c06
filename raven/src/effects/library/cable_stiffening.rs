//! A cable that is soft near zero load and stiffens with stretch.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Stage, Tie};

/// cable-stiffening.
pub const EFFECT: Effect = Effect {
    id: "cable-stiffening",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "gamma = 2 k_e x0 sinh(x / x0)",
    parameters: &[Parameter { name: "length", unit: "cable stretch", scale: Scale::Shape { middle: 0.5, size: 1.0 }, tolerance: None }],
    channels: &[Channel::Tip],
    needs: &[Need::Cable],
    element: None,
    ties: &[Tie::near("backlash"), Tie::near("cable-stretch")],
    separated_by: "loads from none to full in one pose",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(cable) = &mut joint.cable {
            cable.exponent_length = values[0];
        }
    },
};
