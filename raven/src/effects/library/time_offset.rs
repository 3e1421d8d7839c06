//! Images that show the past of their stamps.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// time-offset.
pub const EFFECT: Effect = Effect {
    id: "time-offset",
    scope: Scope::Rig,
    stage: Stage::Timing,
    summary: "late by d",
    parameters: &[Parameter {
        name: "delay",
        unit: "s",
        scale: Scale::Offset(Size::of(0.05)),
        tolerance: Some(|robot, _| robot.tolerances.latency_s),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("link-viscous-friction"), Tie::near("cable-damping")],
    separated_by: "reversals at speed",
    act: |model, _, values| {
        model.view.latency_s += values[0];
    },
};
