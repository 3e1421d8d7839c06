//! Inertia of the motor.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};

/// motor-inertia.
pub const EFFECT: Effect = Effect {
    id: "motor-inertia",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "I_m times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::Factor(1.0),
        tolerance: Some(|robot, _| robot.tolerances.motor_inertia),
    }],
    channels: &[Channel::Torque],
    ties: &[Tie { id: "link-inertia", exact: false }],
    separated_by: "the same path at two speeds",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(motor) = &mut joint.motor {
            motor.inertia *= values[0];
        }
    },
};
