//! What is believed of an effect's size before a recording is looked at.
//!
//! Fits take a size as normal, `N(0, 1)` in units of its slab. That is most probable where the effect's absence would do as well, and
//! practically excludes five slabs. Sizes on such hardware go by factors: from a third of a slab to two or three. So `r`, the root mean square of an
//! effect's `n` sizes, is log-normal about `MEDIAN`, all directions alike, and evidence counts what the normal prior has too much or too
//! little of that:
//!
//! ```text
//! ln E[p(r) / p_n(r)],   p_n the density of r where each size is N(0, 1),   E over the posterior
//! ```
//!
//! (A non-local prior, as in Johnson and Rossell 2010.)

use raven::stats::{chi_log_density, log_normal_log_density, normal_cdf, normal_quantile};

use crate::evidence::fit::slopes::DIFFERENCE;

/// Median of `r` in slabs, and the deviation of its logarithm.
const MEDIAN: f64 = 0.8;
const SPREAD: f64 = 0.8;
/// Part of the sizes that are to be expected.
const EXPECTED: f64 = 0.95;
/// Points of the mean over the posterior, and how many deviations it goes.
const POINTS: usize = 121;
const REACH: f64 = 6.0;
/// Probability of the other side of what lies on one as a rule.
const UNUSUAL: f64 = 0.05;
/// Deviation from which on nothing is known of a moment: that of all moments alike, as parts of the recording.
const UNKNOWN_MOMENT: f64 = 0.29;

/// Part of the sizes that are smaller than `r` slabs.
#[must_use]
pub fn part_below(r: f64) -> f64 {
    if r > 0.0 { normal_cdf((r / MEDIAN).ln() / SPREAD) } else { 0.0 }
}

/// The largest size that is to be expected, in slabs.
#[must_use]
pub fn largest() -> f64 {
    MEDIAN * (SPREAD * normal_quantile(EXPECTED)).exp()
}

/// What evidence with normal priors lacks [nat] where an effect has `found` sizes, with their posterior deviations.
#[must_use]
pub fn beyond_normal(found: &[(f64, f64)]) -> f64 {
    let n = found.len() as f64;
    if found.is_empty() {
        return 0.0;
    }
    let length = found.iter().map(|(u, _)| u * u).sum::<f64>().sqrt();
    let variance = found.iter().map(|(_, std)| std * std).sum::<f64>() / n;
    let logs: Vec<f64> = (0..POINTS)
        .map(|k| {
            let z = REACH * (2.0 * k as f64 / (POINTS - 1) as f64 - 1.0);
            // Along the direction that was found; the other directions add what they scatter by.
            let r = (((length + z * variance.sqrt()).powi(2) + (n - 1.0) * variance) / n).sqrt().max(f64::MIN_POSITIVE);
            ln_ratio(r, found.len()) - 0.5 * z * z
        })
        .collect();
    let highest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let step = 2.0 * REACH / (POINTS - 1) as f64;
    let mean = logs.iter().map(|l| (l - highest).exp()).sum::<f64>() * step / std::f64::consts::TAU.sqrt();
    highest + mean.ln()
}

/// What evidence with a normal prior lacks [nat] of a number that is below zero as a rule, at `u` with a posterior deviation.
#[must_use]
pub fn side_beyond_normal(u: f64, std: f64) -> f64 {
    let below = normal_cdf(-u / std.max(f64::MIN_POSITIVE));
    (2.0 * ((1.0 - UNUSUAL) * below + UNUSUAL * (1.0 - below))).ln()
}

/// What evidence with a normal prior lacks [nat] of a moment, which is anywhere in the recording with the same probability, at `u` of it with a posterior
/// deviation.
#[must_use]
pub fn moment_beyond_normal(u: f64, std: f64) -> f64 {
    // As wide as all moments is what slopes say nothing of: one before the first tip, say, which is one of those few.
    let std = std.max(f64::MIN_POSITIVE);
    let width = if std < UNKNOWN_MOMENT { std } else { DIFFERENCE };
    let inside = normal_cdf((1.0 - u) / width) - normal_cdf(-u / width);
    0.5 * (u * u + std::f64::consts::TAU.ln()) + (width / std).ln() + inside.ln()
}

/// Logarithm of the density of `r` over the one that it has where `n` sizes are normal.
#[must_use]
pub fn ln_ratio(r: f64, n: usize) -> f64 {
    let root = (n as f64).sqrt();
    let believed = log_normal_log_density(MEDIAN, SPREAD, r);
    let normal = chi_log_density(n, root * r).map(|density| density + root.ln());
    believed.zip(normal).map_or(0.0, |(believed, normal)| believed - normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn both_densities_are_of_the_same_sizes() {
        // The mean of p / p_n over p_n is 1.
        for n in 1..=3_usize {
            let step = 1e-3;
            let of_chi = |r: f64| {
                let x = (n as f64).sqrt() * r;
                // Abramowitz and Stegun 26.4: chi of 1, 2 and 3.
                let chi = match n {
                    1 => (2.0 / std::f64::consts::PI).sqrt() * (-0.5 * x * x).exp(),
                    2 => x * (-0.5 * x * x).exp(),
                    _ => (2.0 / std::f64::consts::PI).sqrt() * x * x * (-0.5 * x * x).exp(),
                };
                (n as f64).sqrt() * chi
            };
            let sum: f64 = (1..12_000).map(|k| k as f64 * step).map(|r| of_chi(r) * ln_ratio(r, n).exp() * step).sum();
            assert_relative_eq!(sum, 1.0, epsilon = 2e-3);
        }
    }

    #[test]
    fn what_says_nothing_of_a_size_leaves_the_evidence() {
        for n in 1..=3 {
            // The other directions are taken at their mean square.
            let lacks = beyond_normal(&vec![(0.0, 1.0); n]);
            assert!(lacks.abs() < 0.6, "{n}: {lacks}");
        }
    }

    #[test]
    fn a_size_that_is_known_counts_as_it_is_believed() {
        // Of one size: log-normal of 0.8 and 0.8 over twice the normal density.
        for u in [0.1, 0.8, 5.0_f64] {
            let log_normal = (-0.5 * ((u / 0.8).ln() / 0.8).powi(2)).exp() / (0.8 * u * std::f64::consts::TAU.sqrt());
            let normal = 2.0 * (-0.5 * u * u).exp() / std::f64::consts::TAU.sqrt();
            assert_relative_eq!(beyond_normal(&[(-u, 1e-4)]), (log_normal / normal).ln(), epsilon = 1e-3);
        }
        assert_relative_eq!(part_below(0.8), 0.5, epsilon = 1e-9);
        assert_relative_eq!(part_below(largest()), 0.95, epsilon = 1e-6);
    }

    #[test]
    fn a_size_counts_by_the_side_it_is_on() {
        assert_relative_eq!(side_beyond_normal(-1.0, 1e-3), 1.9_f64.ln(), epsilon = 1e-9);
        assert_relative_eq!(side_beyond_normal(1.0, 1e-3), 0.1_f64.ln(), epsilon = 1e-9);
        // Where it may be on either, as without it.
        assert_relative_eq!(side_beyond_normal(0.0, 0.3), 0.0, epsilon = 1e-9);
    }

    #[test]
    fn a_moment_is_anywhere_in_the_recording_alike() {
        // Evidence with the normal prior N(0, 1) of a moment that is known to `std`, and without what is known of it: the density at `u` over all of it.
        let with_normal = |u: f64, std: f64| std.ln() - 0.5 * u * u;
        let posterior = |std: f64| (std * std::f64::consts::TAU.sqrt()).ln();
        for u in [0.2, 0.5, 0.9] {
            assert_relative_eq!(with_normal(u, 1e-3) + moment_beyond_normal(u, 1e-3), posterior(1e-3), epsilon = 1e-9);
        }
        // At the very beginning half of that is outside, and where nothing is known of it, it is still one of few.
        let at_start = |std: f64| with_normal(0.0, std) + moment_beyond_normal(0.0, std);
        assert_relative_eq!(at_start(1e-3), posterior(1e-3) + 0.5f64.ln(), epsilon = 1e-9);
        assert_relative_eq!(at_start(0.999), posterior(DIFFERENCE) + 0.5f64.ln(), epsilon = 1e-9);
    }
}
