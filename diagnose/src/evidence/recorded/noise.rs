//! How noisy a recorded torque is: no message says so, but its samples do.

use raven::stats::robust_std;

use super::data::WINDOW_S;

/// Root mean square of the third difference of white noise with unit deviation, squared: 1 + 9 + 9 + 1.
const THIRD_DIFFERENCE: f64 = 20.0;

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
    let third: Vec<f64> = values.windows(4).map(|w| w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).collect();
    robust_std(&third).map_or(0.0, |deviation| deviation / THIRD_DIFFERENCE.sqrt())
}

/// The same of errors that count, `None` of others, among samples that are [`far_apart`].
pub(crate) fn white_noise_of(apart: &[usize], counted: impl Fn(usize) -> Option<f64>) -> f64 {
    white_noise(&apart.iter().filter_map(|&k| counted(k)).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn white_noise_is_told_from_motion_and_steps() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut deviate = || -> f64 { StandardNormal.sample(&mut rng) };
        let value = |k: i32| (f64::from(k) * 0.02).sin() + if k % 100 < 50 { 0.5 } else { 0.0 };
        let values: Vec<f64> = (0..3000).map(|k| value(k) + 0.01 * deviate()).collect();
        assert!((white_noise(&values) - 0.01).abs() < 0.001, "{}", white_noise(&values));
        assert_eq!(white_noise(&[1.0, 2.0]), 0.0);
    }
}
