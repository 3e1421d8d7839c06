//! Radial distortion that the calibration missed.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// lens-distortion.
pub const EFFECT: Effect = Effect {
    id: "lens-distortion",
    scope: Scope::Rig,
    stage: Stage::Camera,
    summary: "k1 + d in both lenses",
    parameters: &[Parameter { name: "k1", unit: "1", scale: Scale::Offset(Size::of(0.05)), tolerance: None }],
    channels: &[Channel::Tip],
    needs: &[Need::Lenses],
    element: None,
    ties: &[Tie::near("pulley-eccentricity")],
    separated_by: "the same joint motion at the middle and at the edge of the image",
    act: |model, _, values| {
        model.view.k1 += values[0];
    },
};
