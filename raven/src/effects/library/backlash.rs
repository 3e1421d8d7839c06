//! A dead zone in the transmission: lost motion where the load changes sides, none while gravity preloads it.

use super::super::{Channel, Effect, Element, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// backlash.
pub const EFFECT: Effect = Effect {
    id: "backlash",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "no force over a width w of stretch",
    parameters: &[Parameter { name: "width", unit: "joint", scale: Scale::Magnitude(Size::per_kind(0.015, 0.0015)), tolerance: None }],
    channels: &[Channel::Tip],
    needs: &[Need::Load],
    element: Some(Element::Gap),
    ties: &[Tie::near("hysteresis"), Tie::near("cable-stiffening")],
    separated_by: "slow motion through poses in which the load changes sides",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        let radius = joint.link_pulley_radius;
        if let Some(cable) = &mut joint.cable {
            cable.slack += values[0] * radius;
        }
    },
};
