//! Torque per command.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};

/// torque-constant.
pub const EFFECT: Effect = Effect {
    id: "torque-constant",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "the delivered torque times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::factor(0.15),
        tolerance: Some(|robot, _| robot.tolerances.torque_gain),
    }],
    channels: &[Channel::Torque],
    needs: &[],
    element: None,
    ties: &[Tie::near("motor-coulomb-friction"), Tie::near("payload")],
    separated_by: "a known payload",
    act: |model, place, values| {
        model.drives[place.first].torque_gain *= values[0];
    },
};
