//! A cable that is not as stiff as its data sheet has it: softer as a rule, as whatever it runs over gives way as well.

use super::super::{Above, Amount, Channel, Effect, Element, Need, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::Cable;

/// cable-stretch.
pub const EFFECT: Effect = Effect {
    id: "cable-stretch",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "k_e times a factor",
    parameters: &[
        Parameter {
            name: "factor",
            unit: "1",
            scale: Scale::Factor { size: 1.4, above: Above::Seldom },
            tolerance: Some(|robot, _| robot.tolerances.stiffness),
        },
        // A soft cable takes seconds to settle: 1 where it was without load until the recording began.
        Parameter { name: "fresh_part", unit: "1", scale: Scale::State { size: 0.7, most: f64::INFINITY }, tolerance: None },
    ],
    channels: &[Channel::Tip],
    needs: &[Need::Load],
    element: Some(Element::Spring),
    ties: &[Tie::near("payload"), Tie::near("link-coulomb-friction")],
    separated_by: "the same pose with and without a load; gravity that changes sides",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(cable) = &mut joint.cable {
            cable.stiffness *= values[0];
            cable.fresh_part += values[1];
        }
    },
};

/// The same where the nominal model has none of it: an amount instead of a factor.
pub const AMOUNT: Amount = Amount {
    nominal: |robot, place| robot.joints.get(place.first).and_then(|joint| joint.cable).map_or(0.0, |cable| cable.stiffness),
    effect: Effect {
        summary: "1 / (2 k_e r_l^2) at a joint whose nominal model is rigid",
        parameters: &[Parameter {
            name: "compliance",
            unit: "joint compliance",
            scale: Scale::Magnitude(Size::per_kind(0.02, 0.002)),
            tolerance: None,
        }],
        act: |model, place, values| {
            let joint = &mut model.robot.joints[place.first];
            let radius_m = joint.link_pulley_radius;
            let damping = joint.cable.map_or(0.0, |cable| cable.damping);
            joint.cable = Some(Cable::new(1.0 / (2.0 * values[0] * radius_m * radius_m), damping));
        },
        ..EFFECT
    },
};
