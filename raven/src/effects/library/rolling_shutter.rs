//! Rows that are exposed one after the other.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// rolling-shutter.
pub const EFFECT: Effect = Effect {
    id: "rolling-shutter",
    scope: Scope::Rig,
    stage: Stage::Timing,
    summary: "late by row, d from the first to the last",
    parameters: &[Parameter { name: "readout", unit: "s", scale: Scale::Magnitude(Size::of(0.03)), tolerance: None }],
    channels: &[Channel::Tip],
    needs: &[Need::Lenses],
    element: None,
    ties: &[Tie::near("time-offset")],
    separated_by: "the same motion at the top and at the bottom of the image",
    act: |model, _, values| {
        model.view.readout_s += values[0];
    },
};
