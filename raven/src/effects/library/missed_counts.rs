//! An encoder that lost counts at one moment: a step that stays.

use super::super::{Channel, Effect, Parameter, Scale, Scope, Size, Stage, Tie};
use crate::robot::MotorTrack;

/// How far from where it is said to be a step of the encoder is looked for [s].
const REACH_S: f64 = 0.1;

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
    needs: &[],
    element: None,
    ties: &[Tie::near("creep"), Tie::near("joint-offset")],
    separated_by: "the hard stop approached again after the recording",
    act: |model, place, values| {
        let (j, at) = (place.first, values[1]);
        let counts_per_turn = model.robot.encoder.map_or(4000.0, |encoder| encoder.counts_per_revolution);
        let step_rad = values[0] * std::f64::consts::TAU / counts_per_turn;
        model.motors.push(Box::new(move |_, track| {
            let (Some(&first), Some(&last)) = (track.time_s.first(), track.time_s.last()) else { return };
            let from = where_it_steps(track, j, first + at * (last - first), step_rad);
            track.angle[from..].iter_mut().for_each(|angle| angle[j] -= step_rad);
        }));
    },
};

/// First sample after the encoder's step: of those near a time the one before which joint `j` moved most like it, as no motor jumps. A sample
/// off, and the links would be struck by all of the step.
fn where_it_steps(track: &MotorTrack, j: usize, time_s: f64, step_rad: f64) -> usize {
    let sample = |time_s: f64| track.time_s.partition_point(|&t| t < time_s);
    let unlike = |k: usize| (track.angle[k][j] - track.angle[k - 1][j] - step_rad).abs();
    let near = sample(time_s - REACH_S).max(1)..sample(time_s + REACH_S);
    near.min_by(|&a, &b| unlike(a).total_cmp(&unlike(b))).unwrap_or_else(|| sample(time_s))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_step_is_taken_out_where_it_is_in_the_recording() {
        let time_s: Vec<f64> = (0..2000).map(|k| 1e-3 * f64::from(k)).collect();
        let motion = |t: f64| 30.0 * (2.0 * t).sin();
        let read = |&t: &f64| Vector3::new(motion(t) + if t >= 0.7335 { 1.2 } else { 0.0 }, 0.0, 0.0);
        let track = MotorTrack { angle: time_s.iter().map(read).collect(), time_s };
        for (said_s, step_rad) in [(0.733, 1.2), (0.69, 1.1), (0.80, 1.3)] {
            assert_eq!(where_it_steps(&track, 0, said_s, step_rad), 734, "said to be at {said_s} s");
        }
        // Out of reach, at the ends, and of no recording.
        assert!((1450..1650).contains(&where_it_steps(&track, 0, 1.55, 1.2)));
        assert!(where_it_steps(&track, 0, 0.0, 1.2) <= 100);
        assert_eq!(where_it_steps(&track, 0, 9.0, 1.2), 2000);
        assert_eq!(where_it_steps(&MotorTrack::default(), 0, 0.0, 1.2), 0);
    }
}
