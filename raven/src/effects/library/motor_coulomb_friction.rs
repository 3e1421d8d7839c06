//! Dry friction of the motor.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};

/// motor-coulomb-friction.
pub const EFFECT: Effect = Effect {
    id: "motor-coulomb-friction",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "tau_c times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::Factor(0.8),
        tolerance: Some(|robot, _| robot.tolerances.motor_friction),
    }],
    channels: &[Channel::Torque],
    ties: &[Tie { id: "link-coulomb-friction", exact: false }, Tie { id: "torque-constant", exact: false }],
    separated_by: "constant speeds in both directions",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(motor) = &mut joint.motor {
            motor.coulomb_friction *= values[0];
        }
    },
};
