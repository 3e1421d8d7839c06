//! Inertia of a link.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Stage, Tie};
use crate::robot::KinematicsKind;

/// link-inertia.
pub const EFFECT: Effect = Effect {
    id: "link-inertia",
    scope: Scope::Joint,
    stage: Stage::Link,
    summary: "inertia of the link about its centre of mass times a factor; a prismatic joint's mass",
    parameters: &[Parameter {
        name: "factor",
        unit: "1",
        scale: Scale::factor(0.3),
        tolerance: Some(|robot, _| robot.tolerances.link_inertia),
    }],
    channels: &[Channel::Torque],
    needs: &[Need::Link],
    element: None,
    ties: &[Tie::near("motor-inertia")],
    separated_by: "the same path at two speeds",
    act: |model, place, values| {
        let bench = matches!(model.robot.kinematics, KinematicsKind::Bench);
        if let Some(link) = model.robot.links.get_mut(place.first) {
            // A slide on a bench carries its whole mass, a link its own links.
            if bench {
                link.mass *= values[0];
            }
            link.inertia = link.inertia.map(|moment| moment * values[0]);
        }
    },
};
