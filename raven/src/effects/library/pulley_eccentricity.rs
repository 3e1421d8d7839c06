//! A capstan that runs out of true: an error periodic in the capstan's angle.

use super::super::{Channel, Effect, Need, Parameter, Scale, Scope, Size, Stage, Tie};

/// pulley-eccentricity.
pub const EFFECT: Effect = Effect {
    id: "pulley-eccentricity",
    scope: Scope::Joint,
    stage: Stage::Transmission,
    summary: "r_mc + a sin(q_mc) + b cos(q_mc)",
    parameters: &[
        Parameter { name: "sine", unit: "capstan length", scale: Scale::Offset(Size::of(3e-4)), tolerance: None },
        Parameter { name: "cosine", unit: "capstan length", scale: Scale::Offset(Size::of(3e-4)), tolerance: None },
    ],
    channels: &[Channel::Tip],
    needs: &[Need::Turns],
    element: None,
    ties: &[Tie::near("lens-distortion")],
    separated_by: "a slow sweep over at least three turns of the capstan",
    act: |model, place, values| {
        let (j, sine_m, cosine_m) = (place.first, values[0], values[1]);
        let gear_ratio = model.robot.joints[j].gear_ratio;
        model.motors.push(Box::new(move |cables, track| {
            let per_length = 1.0 / cables.transmission.cable_per_motor_m[j];
            let wound_m = |motor: f64| {
                let (sin, cos) = (motor / gear_ratio).sin_cos();
                cosine_m * sin - sine_m * cos
            };
            let at_hard_stop_m = wound_m(cables.transmission.motor_at_hard_stop[j]);
            track.angle.iter_mut().for_each(|angle| angle[j] += per_length * (wound_m(angle[j]) - at_hard_stop_m));
        }));
    },
};
