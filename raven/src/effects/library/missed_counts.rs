//! An encoder that lost counts at one moment: a step that stays.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};

/// missed-counts.
pub const EFFECT: Effect = Effect {
    id: "missed-counts",
    scope: Scope::Joint,
    stage: Stage::Encoder,
    summary: "the encoder reads c counts more from one moment on",
    parameters: &[
        Parameter { name: "counts", unit: "counts", scale: Scale::Offset(Size::of(1500.0)), tolerance: None },
        Parameter { name: "at", unit: "1", scale: Scale::Moment, tolerance: None },
    ],
    channels: &[Channel::Tip],
    ties: &[Tie::near("creep"), Tie::near("joint-offset")],
    separated_by: "the hard stop approached again after the recording",
    act: |model, place, values| {
        let (j, at) = (place.first, values[1]);
        let counts_per_turn = model.robot.encoder.map_or(4000.0, |encoder| encoder.counts_per_revolution);
        let step_rad = values[0] * std::f64::consts::TAU / counts_per_turn;
        model.motors.push(Box::new(move |_, track| {
            let (Some(&first), Some(&last)) = (track.time_s.first(), track.time_s.last()) else { return };
            let from = track.time_s.partition_point(|&t| t < first + at * (last - first));
            track.angle[from..].iter_mut().for_each(|angle| angle[j] -= step_rad);
        }));
    },
};
