//! The statistics that reports quote: RMS, paired and unpaired t tests, chi-square bands.

use statrs::distribution::{Chi, ChiSquared, Continuous, ContinuousCDF, LogNormal, Normal, StudentsT};

/// Root mean square; `None` of nothing.
#[must_use]
pub fn rms(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt())
}

/// Median of finite values; `None` of nothing.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    let mut finite = values.to_vec();
    finite.retain(|v| v.is_finite());
    let middle = finite.len() / 2;
    let is_odd = finite.len() % 2 == 1;
    if finite.is_empty() {
        return None;
    }
    let (below, &mut above, _) = finite.select_nth_unstable_by(middle, f64::total_cmp);
    if is_odd { Some(above) } else { below.iter().copied().reduce(f64::max).map(|below| 0.5 * (below + above)) }
}

/// Median step from each value to the next, as between the times of a series; `None` of fewer than two.
#[must_use]
pub fn median_step(values: &[f64]) -> Option<f64> {
    median(&values.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<f64>>())
}

/// Standard deviation of a normal distribution by the median size of deviations from its middle, which outliers hardly move (Hampel 1974);
/// `None` of nothing.
#[must_use]
pub fn robust_std(deviations: &[f64]) -> Option<f64> {
    let sizes: Vec<f64> = deviations.iter().map(|d| d.abs()).collect();
    median(&sizes).map(|size| 1.4826 * size)
}

/// Quantiles at `parts` of the finite ones among `values`, interpolated between order statistics; `None` if there are none.
#[must_use]
pub fn quantiles<const N: usize>(values: &[f64], parts: [f64; N]) -> Option<[f64; N]> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    Some(parts.map(|part| {
        let place = part.clamp(0.0, 1.0) * last as f64;
        let below = place.floor() as usize;
        sorted[below] + (sorted[(below + 1).min(last)] - sorted[below]) * place.fract()
    }))
}

/// Logarithm of the density of the length of `n` standard normal numbers; `None` for none.
#[must_use]
pub fn chi_log_density(n: usize, length: f64) -> Option<f64> {
    Some(Chi::new(u64::try_from(n).ok()?).ok()?.ln_pdf(length))
}

/// Logarithm of the density of a number whose logarithm is normal about that of `median`; `None` if `median` or `deviation` is not above zero.
#[must_use]
pub fn log_normal_log_density(median: f64, deviation: f64, value: f64) -> Option<f64> {
    Some(LogNormal::new(median.ln(), deviation).ok()?.ln_pdf(value))
}

/// A t statistic with its degrees of freedom and two-sided P value.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct TTest {
    /// Statistic.
    pub t: f64,
    /// Degrees of freedom.
    pub degrees_of_freedom: f64,
    /// Probability of a statistic at least this far from zero.
    pub p: f64,
}

impl TTest {
    fn new(t: f64, degrees_of_freedom: f64) -> Option<Self> {
        let distribution = StudentsT::new(0.0, 1.0, degrees_of_freedom).ok()?;
        t.is_finite().then(|| Self { t, degrees_of_freedom, p: 2.0 * distribution.sf(t.abs()) })
    }

    /// Student's paired test of `after - before` (Student 1908). `None` for fewer than two pairs or differences all alike.
    #[must_use]
    pub fn paired(before: &[f64], after: &[f64]) -> Option<Self> {
        let differences: Vec<f64> = before.iter().zip(after).map(|(b, a)| a - b).collect();
        let (mean, variance) = moments(&differences)?;
        let n = differences.len() as f64;
        Self::new(mean / (variance / n).sqrt(), n - 1.0)
    }

    /// The two-sample test with equal variances, as the paper used it on paired data.
    #[must_use]
    pub fn unpaired(before: &[f64], after: &[f64]) -> Option<Self> {
        let ((mean_b, variance_b), (mean_a, variance_a)) = (moments(before)?, moments(after)?);
        let (n_b, n_a) = (before.len() as f64, after.len() as f64);
        let degrees = n_b + n_a - 2.0;
        let pooled = ((n_b - 1.0) * variance_b + (n_a - 1.0) * variance_a) / degrees;
        Self::new((mean_a - mean_b) / (pooled * (1.0 / n_b + 1.0 / n_a)).sqrt(), degrees)
    }
}

/// Mean and unbiased variance.
fn moments(values: &[f64]) -> Option<(f64, f64)> {
    if values.len() < 2 {
        return None;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    Some((mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)))
}

/// The interval that holds the mean of `count` independent chi-squares with `degrees` of freedom each in 95 % of cases.
///
/// `count` need not be whole: it may be the number of independent values that correlated ones are worth.
#[must_use]
pub fn chi_square_mean_band(degrees: f64, count: f64) -> Option<[f64; 2]> {
    let total = ChiSquared::new(degrees * count).ok()?;
    let bound = |p: f64| total.inverse_cdf(p) / count;
    (count > 0.0).then(|| [bound(0.025), bound(0.975)])
}

/// How many independent values the mean of a correlated series is worth: `N / (1 + 2 sum rho_k)`, the sum over pairs of lags as long as
/// they stay positive (Geyer 1992, initial positive sequence); from one to `N`, also where neighbours make up for each other. `None` of fewer
/// than two values or values all alike.
#[must_use]
pub fn effective_count(values: &[f64]) -> Option<f64> {
    let (mean, _) = moments(values)?;
    let n = values.len();
    let covariance = |lag: usize| values[lag..].iter().zip(values).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / n as f64;
    let power = covariance(0);
    if power.is_nan() || power <= 0.0 {
        return None;
    }
    // Pairs (0, 1), (2, 3), ...; the sum of all is half of one more than twice the sum of the correlations.
    let pairs = (0..n / 2).map(|k| (covariance(2 * k) + covariance(2 * k + 1)) / power).take_while(|&pair| pair > 0.0);
    // Below one it is the swing from value to value, which makes none worth more than itself.
    let alike = (2.0 * pairs.sum::<f64>() - 1.0).max(1.0);
    Some((n as f64 / alike).max(1.0))
}

/// Probability that a standard normal variable is below `x`.
#[must_use]
pub fn normal_cdf(x: f64) -> f64 {
    Normal::standard().cdf(x)
}

/// The value that a standard normal variable stays below with probability `p`.
#[must_use]
pub fn normal_quantile(p: f64) -> f64 {
    Normal::standard().inverse_cdf(p)
}

/// The value that a chi-square with `degrees` of freedom stays below with probability `p`.
#[must_use]
pub fn chi_square_quantile(degrees: usize, p: f64) -> Option<f64> {
    ChiSquared::new(degrees as f64).ok().map(|d| d.inverse_cdf(p))
}

/// The value that Student's t with so many `degrees` of freedom stays below with probability `p`.
#[must_use]
pub fn student_quantile(degrees: f64, p: f64) -> Option<f64> {
    StudentsT::new(0.0, 1.0, degrees).ok().map(|d| d.inverse_cdf(p))
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn student_quantiles_of_the_tables() {
        // Abramowitz and Stegun, table 26.10.
        for (degrees, quantile) in [(1.0, 12.706), (2.0, 4.303), (5.0, 2.571), (10.0, 2.228), (30.0, 2.042), (1e5, 1.960)] {
            assert_relative_eq!(student_quantile(degrees, 0.975).unwrap(), quantile, epsilon = 6e-4);
        }
    }

    #[test]
    fn normal_quantiles_of_the_tables() {
        assert_relative_eq!(normal_quantile(0.975), 1.959_964, epsilon = 1e-6);
        assert_relative_eq!(normal_cdf(normal_quantile(0.3)), 0.3, epsilon = 1e-9);
    }

    #[test]
    fn half_of_a_normal_distribution_is_within_0_6745_of_its_standard_deviations() {
        assert_relative_eq!(robust_std(&[-0.674_49, 0.1, -0.3, 0.9, 500.0]).unwrap(), 1.0, epsilon = 1e-4);
        assert_eq!(robust_std(&[]), None);
    }

    #[test]
    fn students_sleep_data() {
        // Student 1908, the ten patients: paired t = 4.0621, p = 0.00283; unpaired t = 1.8608, p = 0.07919.
        let first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0];
        let second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4];
        let paired = TTest::paired(&first, &second).unwrap();
        assert_relative_eq!(paired.t, 4.0621, epsilon = 1e-4);
        assert_relative_eq!(paired.p, 0.00283, epsilon = 1e-5);
        let unpaired = TTest::unpaired(&first, &second).unwrap();
        assert_relative_eq!(unpaired.t, 1.8608, epsilon = 1e-4);
        assert_relative_eq!(unpaired.p, 0.07919, epsilon = 1e-5);
    }

    #[test]
    fn nothing_and_constants_have_no_test() {
        assert!(TTest::paired(&[1.0], &[2.0]).is_none());
        assert!(TTest::paired(&[1.0, 2.0], &[1.0, 2.0]).is_none());
        assert!(rms(&[]).is_none() && median(&[f64::NAN]).is_none());
        assert_eq!(median(&[3.0, 1.0, f64::NAN, 2.0]), Some(2.0));
    }

    #[test]
    fn values_that_swing_from_one_to_the_next_are_worth_no_more_than_their_number_and_no_less() {
        // A deviation is made up for by its neighbours: correlation -2/3, and pairs of lags whose sum is one half, less or more by chance.
        for seed in 0..20 {
            let noise = |k: i32| ((f64::from(k + 1000 * seed) * 12.9898).sin() * 43_758.545).fract();
            let swinging: Vec<f64> = (1..200).map(|k| noise(k - 1) - 2.0 * noise(k) + noise(k + 1)).collect();
            assert_eq!(effective_count(&swinging), Some(199.0), "{seed}");
        }
        assert_eq!(effective_count(&[1.0, -2.0, 1.0]), Some(3.0));
        // What only rises is worth very few.
        let rising: Vec<f64> = (0..100).map(f64::from).collect();
        assert!((1.0..10.0).contains(&effective_count(&rising).unwrap()));
        assert_eq!(effective_count(&[2.0; 5]), None);
    }

    #[test]
    fn chi_square_quantiles_of_the_tables() {
        assert_relative_eq!(chi_square_quantile(3, 0.95).unwrap(), 7.8147, epsilon = 1e-4);
        let [low, high] = chi_square_mean_band(3.0, 100.0).unwrap();
        assert_relative_eq!(low, 2.5391, epsilon = 1e-3);
        assert_relative_eq!(high, 3.4987, epsilon = 1e-3);
    }
}
