//! A registration that is turned about the tip at the hard stop, where it was made.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use nalgebra::Vector3;

/// camera-rotation.
pub const EFFECT: Effect = Effect {
    id: "camera-rotation",
    scope: Scope::Rig,
    stage: Stage::Camera,
    summary: "the rig turned about the tip at the hard stop, rotation vector in the left camera's frame",
    parameters: &[
        Parameter {
            name: "x",
            unit: "rad",
            scale: Scale::Offset(Size::of(0.015)),
            tolerance: Some(|robot, _| robot.tolerances.camera_rotation_rad),
        },
        Parameter {
            name: "y",
            unit: "rad",
            scale: Scale::Offset(Size::of(0.015)),
            tolerance: Some(|robot, _| robot.tolerances.camera_rotation_rad),
        },
        Parameter {
            name: "z",
            unit: "rad",
            scale: Scale::Offset(Size::of(0.015)),
            tolerance: Some(|robot, _| robot.tolerances.camera_rotation_rad),
        },
    ],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("joint-offset"), Tie::near("cable-coupling")],
    separated_by: "poses spread in all three dimensions; one rigid motion fits all tips",
    act: |model, _, values| {
        model.view.rotation += Vector3::from_column_slice(values);
    },
};
