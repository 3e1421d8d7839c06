//! A hard stop that is not where it is believed: the encoders were set to a wrong angle.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// joint-offset.
pub const EFFECT: Effect = Effect {
    id: "joint-offset",
    scope: Scope::Joint,
    stage: Stage::Encoder,
    summary: "q + o",
    parameters: &[Parameter {
        name: "offset",
        unit: "joint",
        scale: Scale::Offset(Size::per_kind(0.02, 0.0025)),
        tolerance: Some(|robot, place| robot.joints.get(place.first).map_or(0.0, |joint| robot.tolerances.hard_stop_of(joint.kind))),
    }],
    channels: &[Channel::Tip],
    needs: &[],
    element: None,
    ties: &[
        Tie::near("camera-rotation"),
        Tie::near("tool-length"),
        // A slack joint that lies on one side of its dead zone.
        Tie::near("backlash").with(|_, _, values| vec![2.0 * values[0].abs()]),
    ],
    separated_by: "poses far apart in all joints; the hard stop approached anew several times",
    act: |model, place, values| {
        model.robot.joints[place.first].hard_stop += values[0];
    },
};
