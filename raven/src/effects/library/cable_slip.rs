//! Micro-slip on the capstan above a force: ratchets with travel under load.

use super::super::tension::under_tension;
use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// cable-slip.
pub const EFFECT: Effect = Effect {
    id: "cable-slip",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "a fraction of the capstan's travel is lost towards the load while the cable's force exceeds a limit",
    parameters: &[
        Parameter { name: "force", unit: "cable load", scale: Scale::Shape { middle: 0.5, size: 0.7 }, tolerance: None },
        Parameter { name: "fraction", unit: "1", scale: Scale::Magnitude(Size::of(0.01)), tolerance: None },
    ],
    channels: &[Channel::Tip],
    ties: &[Tie { id: "creep", exact: false }, Tie { id: "missed-counts", exact: false }],
    separated_by: "many cycles under load, against the same time without motion",
    act: |model, place, values| {
        let (j, limit_n, fraction) = (place.first, values[0], values[1]);
        model.motors.push(Box::new(move |cables, track| {
            let mut slipped_rad = 0.0;
            under_tension(cables, track, j, |_, tension_n, travel_rad| {
                if tension_n.abs() > limit_n {
                    slipped_rad += fraction * travel_rad.abs() * tension_n.signum();
                }
                -slipped_rad
            });
        }));
    },
};
