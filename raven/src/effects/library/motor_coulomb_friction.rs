//! Dry friction of the motor.

use super::super::{Amount, Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// motor-coulomb-friction.
pub const EFFECT: Effect = Effect {
    id: "motor-coulomb-friction",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "tau_c times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::factor(0.8),
        tolerance: Some(|robot, _| robot.tolerances.motor_friction),
    }],
    channels: &[Channel::Torque],
    needs: &[Need::Motor],
    element: None,
    ties: &[Tie::near("link-coulomb-friction"), Tie::near("torque-constant")],
    separated_by: "constant speeds in both directions; from the friction of the joint only a tip tells it",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(motor) = &mut joint.motor {
            motor.coulomb_friction *= values[0];
        }
    },
};

/// The same where the nominal model has none of it: an amount instead of a factor.
pub const AMOUNT: Amount = Amount {
    nominal: |robot, place| robot.joints.get(place.first).and_then(|joint| joint.motor).map_or(0.0, |motor| motor.coulomb_friction),
    effect: Effect {
        summary: "tau_c of a motor without any in the nominal model",
        parameters: &[Parameter { name: "amount", unit: "shaft torque", scale: Scale::Magnitude(Size::of(5e-3)), tolerance: None }],
        act: |model, place, values| model.motor_mut(place.first).coulomb_friction = values[0],
        ..EFFECT
    },
};
