//! Prewhitening: what an autoregression cannot foretell of a series (Yule-Walker, Levinson-Durbin; order by Schwarz's criterion).

use raven::stats::effective_count;

/// Innovations of `x` less its mean, each over its own standard deviation. Where a stretch begins (`fresh`) the lower
/// orders predict. Orders beyond `order_max` are not tried.
#[must_use]
pub fn whitened(x: &[f64], fresh: &[bool], order_max: usize) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let centred: Vec<f64> = x.iter().map(|v| v - mean).collect();
    // How many samples in a row stand before each one.
    let follow = |run: &mut Option<usize>, &fresh: &bool| {
        *run = Some(run.filter(|_| !fresh).map_or(0, |before| before + 1));
        *run
    };
    let before: Vec<usize> = fresh.iter().scan(None, follow).collect();
    let covariance = |lag: usize| {
        let pairs = (lag..centred.len()).filter(|&t| before[t] >= lag).map(|t| centred[t] * centred[t - lag]);
        pairs.sum::<f64>() / x.len().max(1) as f64
    };
    let power = covariance(0);
    if power.is_nan() || power <= 0.0 {
        return vec![0.0; x.len()];
    }
    let covariances: Vec<f64> = (0..=order_max).map(covariance).collect();
    let predictors = levinson(&covariances);
    let cost = |order: usize| x.len() as f64 * predictors[order].1.ln() + order as f64 * (x.len() as f64).ln();
    let best = (0..predictors.len()).min_by(|&a, &b| cost(a).total_cmp(&cost(b))).unwrap_or(0);
    (0..x.len())
        .map(|t| {
            let (weights, variance) = &predictors[before[t].min(best)];
            let foretold: f64 = weights.iter().enumerate().map(|(lag, w)| w * centred[t - 1 - lag]).sum();
            (centred[t] - foretold) / variance.sqrt()
        })
        .collect()
}

/// Predictors of every order with the variance of their innovations, as long as that stays positive.
fn levinson(covariance: &[f64]) -> Vec<(Vec<f64>, f64)> {
    let mut predictors = vec![(Vec::new(), covariance[0])];
    for order in 1..covariance.len() {
        let (weights, variance) = &predictors[order - 1];
        let lacking: f64 = covariance[order] - weights.iter().enumerate().map(|(k, w)| w * covariance[order - 1 - k]).sum::<f64>();
        let reflection = lacking / variance;
        let left = variance * (1.0 - reflection * reflection);
        if left.is_nan() || left <= 1e-9 * covariance[0] {
            break;
        }
        let mut longer: Vec<f64> = (0..order - 1).map(|k| weights[k] - reflection * weights[order - 2 - k]).collect();
        longer.push(reflection);
        predictors.push((longer, left));
    }
    predictors
}

/// Integrated autocorrelation time in samples, at least one.
#[must_use]
pub fn integrated_time(x: &[f64]) -> f64 {
    effective_count(x).map_or(1.0, |count| (x.len() as f64 / count).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn an_autoregression_is_white_afterwards_across_a_gap() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let mut uniform = || rng.random_range(-0.5..0.5);
        let mut last = [0.0; 2];
        let x: Vec<f64> = (0..4000)
            .map(|_| {
                last = [1.6 * last[0] - 0.7 * last[1] + uniform(), last[0]];
                last[0]
            })
            .collect();
        let fresh: Vec<bool> = (0..x.len()).map(|t| t == 0 || t == 2000).collect();
        let white = whitened(&x, &fresh, 8);
        assert!(integrated_time(&x) > 3.0, "{}", integrated_time(&x));
        assert!(integrated_time(&white) < 1.2, "{}", integrated_time(&white));
        let variance = white.iter().map(|w| w * w).sum::<f64>() / white.len() as f64;
        assert!((variance - 1.0).abs() < 0.05, "{variance}");
    }

    #[test]
    fn a_constant_has_nothing_to_foretell() {
        assert!(whitened(&[2.0; 50], &[false; 50], 8).iter().all(|&w| w == 0.0));
        assert!(whitened(&[], &[], 8).is_empty());
    }
}
