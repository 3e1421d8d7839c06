//! A joint that moves another's cable more or less than believed.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::Coupling;

/// cable-coupling.
pub const EFFECT: Effect = Effect {
    id: "cable-coupling",
    scope: Scope::Pair,
    stage: Stage::Transmission,
    summary: "C_ij + c",
    parameters: &[Parameter {
        name: "coefficient",
        unit: "joint/rad",
        scale: Scale::Offset(Size::per_kind(0.03, 0.006)),
        tolerance: Some(|robot, place| {
            let named = |j: usize| robot.joints.get(j).map(|joint| joint.name.as_str());
            let of_pair = |c: &&Coupling| Some(c.from.as_str()) == named(place.first) && Some(c.to.as_str()) == named(place.second);
            robot.cable_coupling.iter().find(of_pair).map_or(0.0, |c| c.coefficient.abs() * robot.tolerances.cable_coupling)
        }),
    }],
    channels: &[Channel::Tip],
    ties: &[Tie { id: "camera-rotation", exact: false }],
    separated_by: "one joint moved at a time",
    act: |model, place, values| {
        let name = |j: usize| model.robot.joints[j].name.clone();
        let (from, to) = (name(place.first), name(place.second));
        if let Some(coupling) = model.robot.cable_coupling.iter_mut().find(|c| c.from == from && c.to == to) {
            coupling.coefficient += values[0];
        }
    },
};
