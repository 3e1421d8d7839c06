//! A baseline, or as well a focal length, that is off.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// stereo-scale.
pub const EFFECT: Effect = Effect {
    id: "stereo-scale",
    scope: Scope::Rig,
    stage: Stage::Camera,
    summary: "the baseline times 1 + s",
    parameters: &[Parameter {
        name: "relative_error",
        unit: "1",
        scale: Scale::Offset(Size::of(0.015)),
        tolerance: Some(|robot, _| robot.tolerances.stereo_scale),
    }],
    channels: &[Channel::Tip],
    needs: &[Need::Lenses],
    element: None,
    ties: &[Tie::near("pulley-radius")],
    separated_by: "an object of known length at two depths",
    act: |model, _, values| {
        model.view.baseline += values[0];
    },
};
