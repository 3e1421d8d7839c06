//! Cable laws that depend on the load: what a cable carries while the motors move as recorded.

use crate::robot::{Cables, MotorTrack};

/// Time between evaluations of the load [s]: gravity changes little within it.
const STRIDE_S: f64 = 0.01;

/// Adds to the motor angles of joint `j` what `law` says [rad], sample by sample: it hears of the time since the last one [s], the
/// tension difference in the cable [N], and how far the motor has turned [rad].
pub fn under_tension(cables: &Cables, track: &mut MotorTrack, j: usize, mut law: impl FnMut(f64, f64, f64) -> f64) {
    let mut before: Option<(f64, f64, f64)> = None;
    let mut evaluated = f64::NEG_INFINITY;
    let mut added = 0.0;
    for (&time_s, angle) in track.time_s.iter().zip(&mut track.angle) {
        let recorded = angle[j];
        let (step_s, turned, mut tension) = before.map_or((0.0, 0.0, 0.0), |(t, a, n)| (time_s - t, recorded - a, n));
        angle[j] += added;
        if time_s - evaluated >= STRIDE_S {
            evaluated = time_s;
            tension = (cables.tension_n)(time_s, angle)[j];
        }
        added = law(step_s, tension, turned);
        angle[j] = recorded + added;
        before = Some((time_s, recorded, tension));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::robot::nominal;

    #[test]
    fn the_load_is_that_of_where_the_cable_has_been_wound_to() {
        let arm = nominal::gold().arm().unwrap();
        let time_s: Vec<f64> = (0..5).map(|k| 1.5 * STRIDE_S * f64::from(k)).collect();
        let angle = time_s.iter().map(|t| Vector3::new(0.0, 100.0 * t, 0.0)).collect();
        let recorded = MotorTrack { time_s, angle };
        let tension_n = |_: f64, wound: &Vector3<f64>| *wound;
        let cables = Cables { transmission: &arm.transmission, stiffness_n: [1.0; 3], tension_n: &tension_n };
        let (mut track, mut heard) = (recorded.clone(), Vec::new());
        under_tension(&cables, &mut track, 1, |step_s, tension_n, turned| {
            heard.push((step_s, tension_n, turned));
            -0.25 * heard.len() as f64
        });
        for (k, (wound, recorded)) in track.angle.iter().zip(&recorded.angle).enumerate() {
            approx::assert_relative_eq!(wound[1], recorded[1] - 0.25 * (k + 1) as f64, epsilon = 1e-12);
            // What the law added to the sample before has moved this one; the way it turned is the recorded one.
            approx::assert_relative_eq!(heard[k].1, recorded[1] - 0.25 * k as f64, epsilon = 1e-12);
            approx::assert_relative_eq!(heard[k].2, if k == 0 { 0.0 } else { 150.0 * STRIDE_S }, epsilon = 1e-12);
        }
    }
}
