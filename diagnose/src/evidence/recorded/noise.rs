//! How noisy a recorded torque is: no message says so, but its samples do.

use raven::stats::median;

use super::data::WINDOW_S;

/// Root mean square of the third difference of white noise with unit deviation, squared: 1 + 9 + 9 + 1.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Median of the magnitude of a normal deviate.
const MEDIAN_MAGNITUDE: f64 = 0.674_49;

/// Which of samples at these times share no motor sample.
pub(crate) fn far_apart(times_s: impl Iterator<Item = f64>) -> Vec<usize> {
    let mut last_s = f64::NEG_INFINITY;
    let mut is_apart = |time_s: f64| {
        let apart = time_s - last_s >= 0.999 * WINDOW_S;
        if apart {
            last_s = time_s;
        }
        apart
    };
    times_s.enumerate().filter(|(_, time_s)| is_apart(*time_s)).map(|(k, _)| k).collect()
}

/// Deviation of the white part of a series, from the median of its third differences: what is smooth, and rare steps, leave it alone.
pub(crate) fn white_noise(values: &[f64]) -> f64 {
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
