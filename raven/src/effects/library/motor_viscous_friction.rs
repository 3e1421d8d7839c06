//! Viscous friction of the motor.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};

/// motor-viscous-friction.
pub const EFFECT: Effect = Effect {
    id: "motor-viscous-friction",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "tau_v times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::Factor(1.4),
        tolerance: Some(|robot, _| robot.tolerances.motor_friction),
    }],
    channels: &[Channel::Torque],
    ties: &[Tie { id: "link-viscous-friction", exact: false }],
    separated_by: "several speeds in both directions",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(motor) = &mut joint.motor {
            motor.viscous_friction *= values[0];
        }
    },
};
