//! Cable laws that depend on the load: what a cable carries while the motors move as recorded.

use crate::robot::{Cables, MotorTrack};

/// Time between evaluations of the load [s]: gravity changes little within it.
const STRIDE_S: f64 = 0.01;

/// Adds to the motor angles of joint `j` what `law` says [rad], sample by sample: it hears of the time since the last one [s], the
/// tension difference in the cable [N], and how far the motor has turned [rad].
pub fn under_tension(cables: &Cables, track: &mut MotorTrack, j: usize, mut law: impl FnMut(f64, f64, f64) -> f64) {
    let mut before: Option<(f64, f64, f64)> = None;
    let mut evaluated = f64::NEG_INFINITY;
    for (&time_s, angle) in track.time_s.iter().zip(&mut track.angle) {
        let recorded = angle[j];
        let (step_s, turned, mut tension) = before.map_or((0.0, 0.0, 0.0), |(t, a, n)| (time_s - t, recorded - a, n));
        if time_s - evaluated >= STRIDE_S {
            evaluated = time_s;
            tension = (cables.tension_n)(time_s)[j];
        }
        angle[j] += law(step_s, tension, turned);
        before = Some((time_s, recorded, tension));
    }
}
