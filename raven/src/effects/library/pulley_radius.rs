//! A pulley at the link whose radius is not the drawing's, or as well a capstan's: only their ratio shows.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// pulley-radius.
pub const EFFECT: Effect = Effect {
    id: "pulley-radius",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "r_l (1 + s); the capstan's radius the other way round is the same",
    parameters: &[Parameter {
        name: "relative_error",
        unit: "1",
        scale: Scale::Offset(Size::of(0.04)),
        tolerance: Some(|robot, _| robot.tolerances.radius),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::exact("capstan-radius", "measure the pulley and the capstan"), Tie::near("stereo-scale")],
    separated_by: "a slow sweep over the joint's whole range; other joints fix the camera's scale",
    act: |model, place, values| {
        model.robot.joints[place.first].link_pulley_radius *= 1.0 + values[0];
    },
};
