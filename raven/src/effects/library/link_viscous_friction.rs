//! Viscous friction at the joint.

use super::super::{Amount, Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// link-viscous-friction. A Raven's nominal one is a hundredth of what a joint without any would be given ([`AMOUNT`]): the logarithm of that
/// amount over it has a root mean square of 4.1.
pub const EFFECT: Effect = Effect {
    id: "link-viscous-friction",
    scope: Scope::Joint,
    stage: Stage::Link,
    summary: "F_v times a factor",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::factor(4.1),
        tolerance: Some(|robot, _| robot.tolerances.link_friction),
    }],
    channels: &[Channel::Tip, Channel::Torque],
    needs: &[Need::JointSide],
    element: None,
    ties: &[Tie::near("motor-viscous-friction"), Tie::near("time-offset")],
    separated_by: "several speeds in both directions",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(friction) = &mut joint.link_friction {
            friction.viscous *= values[0];
        }
    },
};

/// The same where the nominal model has none of it: an amount instead of a factor.
pub const AMOUNT: Amount = Amount {
    nominal: |robot, place| robot.joints.get(place.first).and_then(|joint| joint.link_friction).map_or(0.0, |friction| friction.viscous),
    effect: Effect {
        summary: "F_v of a joint without any in the nominal model",
        parameters: &[Parameter { name: "amount", unit: "joint viscosity", scale: Scale::Magnitude(Size::of(0.5)), tolerance: None }],
        act: |model, place, values| model.link_friction_mut(place.first).viscous = values[0],
        ..EFFECT
    },
};
