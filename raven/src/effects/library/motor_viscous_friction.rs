//! Viscous friction of the motor.

use super::super::{Amount, Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// motor-viscous-friction.
pub const EFFECT: Effect = Effect {
    id: "motor-viscous-friction",
    scope: Scope::Joint,
    stage: Stage::Motor,
    summary: "tau_v times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::factor(1.4),
        tolerance: Some(|robot, _| robot.tolerances.motor_friction),
    }],
    channels: &[Channel::Torque],
    needs: &[Need::Motor],
    element: None,
    ties: &[Tie::near("link-viscous-friction")],
    separated_by: "several speeds in both directions",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(motor) = &mut joint.motor {
            motor.viscous_friction *= values[0];
        }
    },
};

/// The same where the nominal model has none of it: an amount instead of a factor.
pub const AMOUNT: Amount = Amount {
    nominal: |robot, place| robot.joints.get(place.first).and_then(|joint| joint.motor).map_or(0.0, |motor| motor.viscous_friction),
    effect: Effect {
        summary: "tau_v of a motor without any in the nominal model",
        parameters: &[Parameter { name: "amount", unit: "shaft viscosity", scale: Scale::Magnitude(Size::of(4e-4)), tolerance: None }],
        act: |model, place, values| model.motor_mut(place.first).viscous_friction = values[0],
        ..EFFECT
    },
};
