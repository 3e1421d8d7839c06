//! An angle between two joint axes.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::KinematicsKind;

/// link-angle.
pub const EFFECT: Effect = Effect {
    id: "link-angle",
    scope: Scope::LinkAngle,
    stage: Stage::Kinematics,
    summary: "the angle between two axes + e",
    parameters: &[Parameter {
        name: "error",
        unit: "rad",
        scale: Scale::Offset(Size::of(0.015)),
        tolerance: Some(|robot, _| robot.tolerances.link_angle_rad),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("camera-rotation"), Tie::near("joint-offset")],
    separated_by: "poses over the whole workspace",
    act: |model, place, values| {
        if let KinematicsKind::Raven(kinematics) = &mut model.robot.kinematics {
            match place.first {
                0 => kinematics.link_angle_12 += values[0],
                _ => kinematics.link_angle_23 += values[0],
            }
        }
    },
};
