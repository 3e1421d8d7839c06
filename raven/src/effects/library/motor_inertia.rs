//! Inertia of the motor.

use super::super::{Amount, Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// motor-inertia.
pub const EFFECT: Effect = Effect {
    id: "motor-inertia",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "I_m times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::factor(1.0),
        tolerance: Some(|robot, _| robot.tolerances.motor_inertia),
    }],
    channels: &[Channel::Torque],
    needs: &[Need::Motor],
    element: None,
    ties: &[Tie::near("link-inertia")],
    separated_by: "the same path at two speeds",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(motor) = &mut joint.motor {
            motor.inertia *= values[0];
        }
    },
};

/// The same where the nominal model has none of it: an amount instead of a factor.
pub const AMOUNT: Amount = Amount {
    nominal: |robot, place| robot.joints.get(place.first).and_then(|joint| joint.motor).map_or(0.0, |motor| motor.inertia),
    effect: Effect {
        summary: "I_m of a motor without any in the nominal model",
        parameters: &[Parameter { name: "amount", unit: "shaft inertia", scale: Scale::Magnitude(Size::of(3e-5)), tolerance: None }],
        act: |model, place, values| model.motor_mut(place.first).inertia = values[0],
        ..EFFECT
    },
};
