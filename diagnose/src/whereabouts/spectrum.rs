//! Lines in frequency bands: periodogram of a series taken as evenly sampled, over its own continuum.

/// Upper edges of the bands [Hz]; the last band ends at half the sampling rate.
pub const EDGES_HZ: [f64; 9] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// The band that a frequency is in.
#[must_use]
pub fn band(frequency_hz: f64) -> usize {
    EDGES_HZ.partition_point(|&edge| edge < frequency_hz)
}

/// Ordinates at the Fourier frequencies above zero and below half the sampling rate, `(frequency [Hz], |X|^2 / N)`, by Goertzel's
/// recursion; white noise has its variance at each.
#[must_use]
pub fn periodogram(x: &[f64], interval_s: f64) -> Vec<(f64, f64)> {
    let count = x.len();
    (1..count.div_ceil(2))
        .map(|k| {
            let turn = 2.0 * (std::f64::consts::TAU * k as f64 / count as f64).cos();
            let (mut last, mut before) = (0.0, 0.0);
            for value in x {
                (last, before) = (value + turn * last - before, last);
            }
            (k as f64 / (count as f64 * interval_s), (last * last + before * before - turn * last * before) / count as f64)
        })
        .collect()
}

/// Ordinates on either side, at least, from which the continuum is taken.
pub const CONTINUUM_MIN: usize = 24;

/// Divides ordinates in the order of their frequencies by the geometric mean of their surroundings, which a line hardly moves.
pub fn over_continuum(ordinates: &mut [f64]) {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for power in ordinates.iter() {
        sum += power.max(f64::MIN_POSITIVE).ln();
        sums.push(sum);
    }
    let count = ordinates.len();
    for (k, power) in ordinates.iter_mut().enumerate() {
        let reach = CONTINUUM_MIN.max(k / 3);
        let (from, to) = (k.saturating_sub(reach), (k + reach + 1).min(count));
        *power /= ((sums[to] - sums[from]) / (to - from) as f64).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_line() {
        let x: Vec<f64> = (0..600).map(|k| (std::f64::consts::TAU * 1.5 * f64::from(k) / 15.0).sin()).collect();
        let ordinates = periodogram(&x, 1.0 / 15.0);
        let (frequency, power) = ordinates.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((frequency - 1.5).abs() < 1e-9 && (power - 150.0).abs() < 1e-6, "{frequency} {power}");
        assert!((ordinates.iter().map(|o| o.1).sum::<f64>() - power).abs() < 1e-6);
        assert_eq!((band(0.05), band(1.5), band(1.0), band(100.0)), (0, 4, 3, 9));
    }
}
