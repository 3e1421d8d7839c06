//! Micro-slip on the capstan above a force: ratchets with travel under load.

use super::super::listed::left;
use super::super::tension::under_tension;
use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// Deviation of the travel before a recording [m].
const LEFT: f64 = 0.1;

/// cable-slip.
pub const EFFECT: Effect = Effect {
    id: "cable-slip",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "a fraction of the capstan's travel is lost towards the load where the cable's force is beyond a limit",
    parameters: &[
        Parameter { name: "force", unit: "cable load", scale: Scale::Shape { middle: 0.5, size: 0.7 }, tolerance: None },
        Parameter { name: "fraction", unit: "1", scale: Scale::Magnitude(Size::of(0.01)), tolerance: None },
        // Of the transition, as a part of the limit. The arc of a capstan on which a cable slips grows with the force; and as the force is known
        // no better than the joint's friction, a sharp limit fits whatever instants of the recording suit it.
        Parameter { name: "width", unit: "1", scale: Scale::Shape { middle: 0.05, size: 1.0 }, tolerance: None },
        // Towards the load less against it: the way from the hard stop, say.
        Parameter {
            name: "travel_before",
            unit: "m",
            scale: Scale::State { size: LEFT, most: f64::INFINITY },
            tolerance: Some(|robot, place| left(robot, "cable-slip", place, LEFT)),
        },
    ],
    channels: &[Channel::Tip],
    needs: &[Need::Load],
    element: None,
    ties: &[
        Tie::near("creep"),
        Tie::near("missed-counts"),
        // What slipped before.
        Tie::near("joint-offset").with(|robot, place, values| {
            let radius = robot.joints.get(place.first).map_or(f64::INFINITY, |joint| joint.link_pulley_radius);
            vec![-values[1] * values[3] / radius]
        }),
    ],
    separated_by: "many cycles under load, against the same time without motion",
    act: |model, place, values| {
        let (j, limit_n, fraction, width, travel_before_m) = (place.first, values[0], values[1], values[2], values[3]);
        model.motors.push(Box::new(move |cables, track| {
            let mut slipped_rad = fraction * travel_before_m / cables.transmission.cable_per_motor_m[j];
            under_tension(cables, track, j, |_, tension_n, travel_rad| {
                slipped_rad += slipping(tension_n.abs(), limit_n, width) * fraction * travel_rad.abs() * tension_n.signum();
                -slipped_rad
            });
        }));
    },
};

/// Part of the travel during which a cable slips that carries a force [N]: a half at the limit [N], within so wide a part of it.
fn slipping(force_n: f64, limit_n: f64, width: f64) -> f64 {
    let beyond = (force_n - limit_n) / (width * limit_n).max(f64::MIN_POSITIVE);
    1.0 / (1.0 + (-beyond).exp())
}
