//! Two cameras that look at different times.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// stereo-desync.
pub const EFFECT: Effect = Effect {
    id: "stereo-desync",
    scope: Scope::Rig,
    stage: Stage::Timing,
    summary: "the right image shows the past by d more",
    parameters: &[Parameter { name: "delay", unit: "s", scale: Scale::Offset(Size::of(0.01)), tolerance: None }],
    channels: &[Channel::Tip],
    needs: &[Need::Lenses],
    element: None,
    ties: &[Tie::near("time-offset")],
    separated_by: "motion along the rows of the image, at which depth must not move",
    act: |model, _, values| {
        model.view.right_minus_left_s += values[0];
    },
};
