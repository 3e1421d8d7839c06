//! A registration that is shifted.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use nalgebra::Vector3;

/// camera-translation.
pub const EFFECT: Effect = Effect {
    id: "camera-translation",
    scope: Scope::Rig,
    stage: Stage::Camera,
    summary: "the rig shifted, in the left camera's frame",
    parameters: &[
        Parameter {
            name: "x",
            unit: "m",
            scale: Scale::Offset(Size::of(0.003)),
            tolerance: Some(|robot, _| robot.tolerances.camera_translation_m),
        },
        Parameter {
            name: "y",
            unit: "m",
            scale: Scale::Offset(Size::of(0.003)),
            tolerance: Some(|robot, _| robot.tolerances.camera_translation_m),
        },
        Parameter {
            name: "z",
            unit: "m",
            scale: Scale::Offset(Size::of(0.003)),
            tolerance: Some(|robot, _| robot.tolerances.camera_translation_m),
        },
    ],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("joint-offset"), Tie::near("cable-coupling")],
    separated_by: "poses spread in all three dimensions; one rigid motion fits all tips",
    act: |model, _, values| {
        model.view.translation_m += Vector3::from_column_slice(values);
    },
};
