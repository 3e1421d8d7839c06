//! Rate-independent play between capstan and cable: a loop after every reversal, whatever the load.

use super::super::lag;
use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// hysteresis.
pub const EFFECT: Effect = Effect {
    id: "hysteresis",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "the cable's end follows the capstan with h of play at the joint on either side",
    parameters: &[
        Parameter { name: "half_loop", unit: "joint", scale: Scale::Magnitude(Size::per_kind(0.008, 0.001)), tolerance: None },
        Parameter { name: "rounding", unit: "1", scale: Scale::Shape { middle: 1.5, size: 0.4 }, tolerance: None },
    ],
    channels: &[Channel::Tip],
    ties: &[Tie { id: "backlash", exact: false }, Tie { id: "link-coulomb-friction", exact: false }],
    separated_by: "reversals at many amplitudes, loaded and unloaded",
    act: |model, place, values| {
        let (j, half) = (place.first, values[0]);
        let length = values[1] * half;
        model.motors.push(Box::new(move |arm, track| {
            let ratio = arm.transmission.ratio[j];
            let lag = lag(track.angle.iter().map(|angle| angle[j] / ratio), half, length);
            track.angle.iter_mut().zip(lag).for_each(|(angle, lag)| angle[j] -= ratio * lag);
        }));
    },
};
