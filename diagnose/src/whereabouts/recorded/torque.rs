//! Torque that the drives delivered less what their motion needed.

use nalgebra::Vector3;
use raven::effects::{Shaft, TorqueModel};
use raven::robot::{Arm, Joint};
use raven::stats::{median, rms};

use super::{Track, joint_factors};
use crate::evidence::recorded::torques::{TORQUE_MODEL, surely_moving};

/// Torque samples this far apart share no motor sample [s].
const TORQUE_STRIDE_S: f64 = crate::evidence::recorded::data::WINDOW_S;
/// Root mean square of the third difference of white noise with unit deviation, squared: 1 + 9 + 9 + 1.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Median of the magnitude of a normal deviate.
const MEDIAN_MAGNITUDE: f64 = 0.674_49;

/// Torque delivered less torque needed where the direction of friction is beyond doubt; with each sample the cables' tension differences [N].
pub(super) fn torque_track(arm: &Arm, joint: &Joint, j: usize, model: &TorqueModel, shafts: &[(Shaft, Vector3<f64>)]) -> Track {
    let apart: Vec<&(Shaft, Vector3<f64>)> =
        far_apart(shafts.iter().map(|(shaft, _)| shaft.time_s)).into_iter().map(|k| &shafts[k]).collect();
    let all_time_s: Vec<f64> = apart.iter().map(|(s, _)| s.time_s).collect();
    let rates: Vec<f64> = apart.iter().map(|(s, _)| arm.transmission.joint_rate_from_motor(&s.rate)[j]).collect();
    let residual: Vec<f64> = apart.iter().map(|(s, tension)| (model.delivered(&s.commanded) - model.needed(s, tension))[j]).collect();
    let commanded: Vec<f64> = apart.iter().map(|(s, _)| s.commanded.mean()[j]).collect();
    let noise = noise_of_torque(&residual, &commanded);
    let motors: Vec<Option<Vector3<f64>>> = apart.iter().map(|(s, _)| Some(s.angle)).collect();
    let factors = joint_factors(arm, joint, j, &motors, &all_time_s, &rates);
    let kept: Vec<usize> = (0..apart.len()).filter(|&k| surely_moving(&apart[k].0, j)).collect();
    let pick = |column: &[f64]| kept.iter().map(|&k| column[k]).collect::<Vec<f64>>();
    Track {
        time_s: pick(&all_time_s),
        error: pick(&residual),
        noise: vec![noise; kept.len()],
        factors: factors.iter().map(|(kind, values)| (*kind, pick(values))).collect(),
    }
}

/// Which of samples at these times share no motor sample.
pub(super) fn far_apart(times_s: impl Iterator<Item = f64>) -> Vec<usize> {
    let mut last_s = f64::NEG_INFINITY;
    let mut is_apart = |time_s: f64| {
        let apart = time_s - last_s >= 0.999 * TORQUE_STRIDE_S;
        if apart {
            last_s = time_s;
        }
        apart
    };
    times_s.enumerate().filter(|(_, time_s)| is_apart(*time_s)).map(|(k, _)| k).collect()
}

/// What noise and the model's own errors leave of a torque whose samples are far apart.
pub(super) fn noise_of_torque(residual: &[f64], commanded: &[f64]) -> f64 {
    white_noise(residual).hypot(TORQUE_MODEL * rms(commanded).unwrap_or(0.0))
}

/// Deviation of the white part of a series, from the median of its third differences: what is smooth, and rare steps, leave it alone.
fn white_noise(values: &[f64]) -> f64 {
    let third: Vec<f64> = values.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    median(&third).map_or(0.0, |m| m / MEDIAN_MAGNITUDE / THIRD_DIFFERENCE.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_noise_is_told_from_motion_and_steps() {
        let mut state = 7_u64;
        let mut deviate = || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as f64 / f64::from(1_u32 << 31)
            };
            // The sum of twelve uniform deviates has unit variance.
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        let value = |k: i32| (f64::from(k) * 0.02).sin() + if k % 100 < 50 { 0.5 } else { 0.0 };
        let values: Vec<f64> = (0..3000).map(|k| value(k) + 0.01 * deviate()).collect();
        assert!((white_noise(&values) - 0.01).abs() < 0.001, "{}", white_noise(&values));
        assert_eq!(white_noise(&[1.0, 2.0]), 0.0);
    }
}
