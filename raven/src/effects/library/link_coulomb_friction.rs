//! Dry friction at the joint.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Stage, Tie};
use crate::robot::STICTION_SPEED;

/// link-coulomb-friction.
pub const EFFECT: Effect = Effect {
    id: "link-coulomb-friction",
    scope: Scope::Joint,
    stage: Stage::Link,
    summary: "F_c times a factor",
    parameters: &[
        Parameter { name: "factor", unit: "1", scale: Scale::Factor(1.3), tolerance: Some(|robot, _| robot.tolerances.link_friction) },
        // How friction fades towards rest is a law of its own, of which nobody knows the numbers.
        Parameter { name: "stiction_speed_factor", unit: "1", scale: Scale::Factor(1.0), tolerance: Some(|_, _| 1.0) },
    ],
    channels: &[Channel::Tip, Channel::Torque],
    ties: &[Tie { id: "motor-coulomb-friction", exact: false }, Tie { id: "hysteresis", exact: false }],
    separated_by: "the same reversals at two cable tensions; without a tip it cannot be told from the motor's friction",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(friction) = &mut joint.link_friction {
            friction.coulomb *= values[0];
            // A file that leaves the speed to the model goes on doing so.
            if values[1] != 1.0 {
                friction.stiction_speed = Some(friction.stiction_speed.unwrap_or(STICTION_SPEED[place.first.min(2)]) * values[1]);
            }
        }
    },
};
