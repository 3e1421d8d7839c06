//! A tool longer or shorter than believed: the same as an offset of the insertion.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::KinematicsKind;

/// tool-length.
pub const EFFECT: Effect = Effect {
    id: "tool-length",
    scope: Scope::Robot,
    stage: Stage::Kinematics,
    summary: "d4 + l",
    parameters: &[Parameter {
        name: "length",
        unit: "m",
        scale: Scale::Offset(Size::of(0.003)),
        tolerance: Some(|robot, _| robot.tolerances.tool_length_m),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::exact("joint-offset", "measure the tool")],
    separated_by: "nothing that motors and cameras record: measure the tool",
    act: |model, _, values| {
        if let KinematicsKind::Raven(kinematics) = &mut model.robot.kinematics {
            kinematics.wrist_offset += values[0];
        }
    },
};
