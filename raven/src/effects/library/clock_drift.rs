//! Clocks that run apart.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// clock-drift.
pub const EFFECT: Effect = Effect {
    id: "clock-drift",
    scope: Scope::Rig,
    stage: Stage::Timing,
    summary: "late by a delay that grows",
    parameters: &[Parameter {
        name: "rate",
        unit: "s/s",
        scale: Scale::Offset(Size::of(4e-4)),
        tolerance: Some(|robot, _| robot.tolerances.clock_drift),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("creep")],
    separated_by: "bursts of motion at the start and at the end",
    act: |model, _, values| {
        model.view.drift += values[0];
    },
};
