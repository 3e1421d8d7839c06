//! Damping of the cable.

use super::super::{Channel, Effect, Element, Need, Parameter, Scale, Scope, Stage, Tie};

/// cable-damping.
pub const EFFECT: Effect = Effect {
    id: "cable-damping",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "b_e times a factor",
    parameters: &[Parameter { name: "factor", unit: "1", scale: Scale::factor(1.1), tolerance: Some(|robot, _| robot.tolerances.damping) }],
    channels: &[Channel::Tip],
    needs: &[Need::Cable],
    element: Some(Element::Dashpot),
    ties: &[Tie::near("time-offset"), Tie::near("link-viscous-friction")],
    separated_by: "motion above three hertz, seen by a fast camera or joint encoders",
    act: |model, place, values| {
        let joint = &mut model.robot.joints[place.first];
        if let Some(cable) = &mut joint.cable {
            cable.damping *= values[0];
        }
    },
};
