//! Friction that grows with the cable's force (Miyasaka et al. 2015).

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// load-dependent-friction.
pub const EFFECT: Effect = Effect {
    id: "load-dependent-friction",
    scope: Scope::Joint,
    stage: Stage::Link,
    summary: "mu times the force of the cable at the joint, against the motion",
    parameters: &[Parameter { name: "coefficient", unit: "1", scale: Scale::Magnitude(Size::of(0.2)), tolerance: None }],
    channels: &[Channel::Tip, Channel::Torque],
    needs: &[Need::JointSide],
    element: None,
    ties: &[Tie::near("link-coulomb-friction")],
    separated_by: "the same motion under two payloads",
    act: |model, place, values| {
        model.link_friction_mut(place.first).per_load += values[0];
    },
};
