//! A joint that moves another's cable more or less than believed.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::{Coupling, JointType};

/// cable-coupling.
pub const EFFECT: Effect = Effect {
    id: "cable-coupling",
    scope: Scope::Pair,
    stage: Stage::Transmission,
    summary: "C_ij + c",
    parameters: &[Parameter {
        name: "coefficient",
        unit: "joint/rad",
        scale: Scale::Offset(Size::per_kind(0.05, 0.01)),
        // Named without a unit, but it is one of the coefficient in rad/rad; in m/rad a third of it, as of hard stops.
        tolerance: Some(|robot, place| {
            robot.joints.get(place.second).map_or(0.0, |joint| match joint.kind {
                JointType::Revolute => robot.tolerances.cable_coupling,
                JointType::Prismatic => robot.tolerances.cable_coupling / 3.0,
            })
        }),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[Tie::near("camera-rotation")],
    separated_by: "one joint moved at a time",
    act: |model, place, values| {
        let name = |j: usize| model.robot.joints[j].name.clone();
        let (from, to) = (name(place.first), name(place.second));
        match model.robot.cable_coupling.iter_mut().find(|c| c.from == from && c.to == to) {
            Some(coupling) => coupling.coefficient += values[0],
            None => model.robot.cable_coupling.push(Coupling { from, to, coefficient: values[0] }),
        }
    },
};
