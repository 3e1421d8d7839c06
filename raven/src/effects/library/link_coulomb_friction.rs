//! Dry friction at the joint.

use super::super::{Above, Amount, Channel, Effect, Element, Need, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::ViscousCoulomb;

/// Slope of friction at rest, over the model's own. One much steeper looks the same, and takes ever smaller steps.
const SLOPE: Scale = Scale::Factor { size: 0.7, above: Above::UpTo(2.0) };

/// link-coulomb-friction.
pub const EFFECT: Effect = Effect {
    id: "link-coulomb-friction",
    scope: Scope::Joint,
    stage: Stage::Link,
    summary: "F_c times a factor",
    parameters: &[
        Parameter { name: "factor", unit: "1", scale: Scale::factor(1.3), tolerance: Some(|robot, _| robot.tolerances.link_friction) },
        // How friction fades towards rest is a law of its own, of which nobody knows the numbers.
        Parameter { name: "slope_factor", unit: "1", scale: SLOPE, tolerance: Some(|_, _| 0.7) },
        // Nor whether it holds a joint that rests: a dry bearing does, a wet one gives way.
        Parameter { name: "held_part", unit: "1", scale: Scale::Part, tolerance: Some(|_, _| 1.0) },
        // Where it held the joint when the recording began.
        Parameter { name: "lag_at_start", unit: "1", scale: Scale::State { size: 0.6, most: 1.0 }, tolerance: Some(|_, _| 0.6) },
    ],
    channels: &[Channel::Tip, Channel::Torque],
    needs: &[Need::JointSide],
    element: Some(Element::Slider),
    ties: &[Tie::near("motor-coulomb-friction"), Tie::near("hysteresis")],
    separated_by: "the same reversals at two cable tensions; without a tip it cannot be told from the motor's friction",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        let own = joint.stiction_speed();
        if let Some(friction) = &mut joint.link_friction {
            friction.coulomb *= values[0];
            hold(friction, values);
            // More friction takes more speed to build up: its slope at rest is the bearing's. A file that leaves the speed to the model goes
            // on doing so.
            if values[0] != values[1] {
                friction.stiction_speed = Some(own * values[0] / values[1]);
            }
        }
    },
};

/// Of what gave way, a part holds, and it did so when the recording began: beside what the file says of both.
fn hold(friction: &mut ViscousCoulomb, values: &[f64]) {
    friction.held_part += (1.0 - friction.held_part) * values[2];
    friction.lag_at_start += (1.0 - friction.lag_at_start.abs()) * values[3];
}

/// The same where the nominal model has none of it: an amount instead of a factor.
pub const AMOUNT: Amount = Amount {
    nominal: |robot, place| robot.joints.get(place.first).and_then(|joint| joint.link_friction).map_or(0.0, |friction| friction.coulomb),
    effect: Effect {
        summary: "F_c of a joint without any in the nominal model",
        parameters: &[
            Parameter { name: "amount", unit: "joint force", scale: Scale::Magnitude(Size::of(0.5)), tolerance: None },
            EFFECT.parameters[1],
            EFFECT.parameters[2],
            EFFECT.parameters[3],
        ],
        act: |model, place, values| {
            let own = model.robot.joints[place.first].stiction_speed();
            let friction = model.link_friction_mut(place.first);
            friction.coulomb = values[0];
            hold(friction, values);
            friction.stiction_speed = Some(own / values[1]);
        },
        ..EFFECT
    },
};
