//! Does a filter err as much as it says? Innovations and, where references are known, errors against the filter's own covariance.
//!
//! ```text
//! NIS  = v' S^-1 v      innovations, mean 3, independent from one to the next
//! NEES = e' P^-1 e      errors against a reference, mean 3, alike for as long as the errors last
//! ```
//!
//! Source: Bar-Shalom, Li, Kirubarajan 2001, section 5.4. The mean of independent chi-squares lies in a narrow band. Errors of joint
//! angles are alike over many estimates, so their band counts effective samples: `N / (1 + 2 sum rho_k)` by [`effective_count`].

use nalgebra::Vector3;
use serde::Serialize;

use super::{FilterRun, Innovation, JointTrack};
use crate::log::JointSeries;
use crate::stats::{chi_square_mean_band, effective_count};

/// What the filter's errors say about its covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Errors are as large as it says.
    Consistent,
    /// Errors are larger than it says.
    ClaimsTooMuch,
    /// Errors are smaller than it says.
    ClaimsTooLittle,
}

/// A mean of normalised squares of three components beside what it should be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NormalisedSquares {
    /// Mean; 3 if all is as claimed.
    pub mean: f64,
    /// Where it lies in 95 % of cases.
    pub band95: [f64; 2],
    /// How many went into it.
    pub samples: usize,
    /// How many independent ones they are worth.
    pub effective_samples: f64,
    /// Size of the errors over what is claimed of them.
    pub times_claimed: f64,
    /// Whether the mean is in the band, above or below.
    pub verdict: Verdict,
}

impl NormalisedSquares {
    /// Of squares that are worth `effective` independent ones. `None` of nothing.
    #[must_use]
    pub fn new(squares: &[f64], effective: f64) -> Option<Self> {
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        let band95 = chi_square_mean_band(3.0, effective)?;
        let verdict = match mean {
            m if m > band95[1] => Verdict::ClaimsTooMuch,
            m if m < band95[0] => Verdict::ClaimsTooLittle,
            m if m.is_finite() => Verdict::Consistent,
            _ => return None,
        };
        let times_claimed = (mean / 3.0).sqrt();
        Some(Self { mean, band95, samples: squares.len(), effective_samples: effective, times_claimed, verdict })
    }

    /// The verdict about `who`, as a sentence.
    #[must_use]
    pub fn sentence(&self, who: &str, errors: &str) -> String {
        let times = self.times_claimed;
        match self.verdict {
            Verdict::Consistent => format!("{who} is consistent: its {errors} are as large as it says."),
            Verdict::ClaimsTooMuch => {
                format!("{who} states deviations that are too small: its {errors} are {times:.2} times what it says.")
            }
            Verdict::ClaimsTooLittle => {
                format!("{who} states deviations that are too large: its {errors} are {times:.2} times what it says.")
            }
        }
    }
}

/// Correlation of each innovation with the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Whiteness {
    /// Lag-one autocorrelation of the whitened innovations, their three components together.
    pub lag_one: f64,
    /// Half the band that holds it in 95 % of cases if they are independent.
    pub band95: f64,
    /// Whether it is in the band.
    pub white: bool,
}

/// NIS of the innovations that were accepted.
#[must_use]
pub fn nis(run: &FilterRun) -> Option<NormalisedSquares> {
    let squares: Vec<f64> = accepted(run).map(|innovation| innovation.nis).collect();
    NormalisedSquares::new(&squares, squares.len() as f64)
}

/// Whiteness of the innovations that were accepted.
#[must_use]
pub fn whiteness(run: &FilterRun) -> Option<Whiteness> {
    let whitened: Vec<Vector3<f64>> = accepted(run).filter_map(|i| i.factor.solve_lower_triangular(&i.residual)).collect();
    let power: f64 = whitened.iter().map(Vector3::norm_squared).sum();
    let across: f64 = whitened.windows(2).map(|pair| pair[0].dot(&pair[1])).sum();
    let band95 = 1.96 / (3.0 * whitened.len() as f64).sqrt();
    let lag_one = across / power;
    lag_one.is_finite().then(|| Whiteness { lag_one, band95, white: lag_one.abs() <= band95 })
}

fn accepted(run: &FilterRun) -> impl Iterator<Item = &Innovation<3>> {
    run.innovations.iter().map(|(_, innovation)| innovation).filter(|innovation| innovation.accepted)
}

/// NEES of joint estimates against reference encoders, wherever these are known. The covariance must have a factor without zeros.
#[must_use]
pub fn nees(track: &JointTrack, reference: &JointSeries) -> Option<NormalisedSquares> {
    let mut squares = Vec::with_capacity(track.time_s.len());
    for ((&time_s, joints), factor) in track.time_s.iter().zip(&track.joints).zip(&track.factor) {
        let known = [0, 1, 2].map(|j| reference.interpolate(j, time_s));
        let [Some(a), Some(b), Some(c)] = known else { continue };
        let Some(whitened) = factor.solve_lower_triangular(&(joints - Vector3::new(a, b, c))) else { continue };
        squares.push(whitened.norm_squared());
    }
    let effective = effective_count(&squares)?;
    NormalisedSquares::new(&squares, effective)
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Innovations of a filter whose true errors are `times` what it claims and remember `memory` of the one before.
    fn run(times: f64, memory: f64) -> FilterRun {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let factor = Matrix3::new(2.0, 0.0, 0.0, 0.5, 1.0, 0.0, -0.3, 0.2, 0.7);
        let mut last = Vector3::zeros();
        let innovations = (0..3000).map(|k| {
            last = last * memory + Vector3::from_fn(|_, _| normal()) * (1.0 - memory * memory).sqrt();
            let whitened = last * times;
            (f64::from(k), Innovation { residual: factor * whitened, factor, nis: whitened.norm_squared(), accepted: true })
        });
        FilterRun { innovations: innovations.collect(), ..FilterRun::default() }
    }

    #[test]
    fn an_honest_filter_is_told_from_one_that_claims_too_much_or_too_little() {
        assert_eq!(nis(&run(1.0, 0.0)).unwrap().verdict, Verdict::Consistent);
        let boastful = nis(&run(1.8, 0.0)).unwrap();
        assert!(boastful.verdict == Verdict::ClaimsTooMuch && (boastful.times_claimed - 1.8).abs() < 0.05);
        assert!(boastful.sentence("The filter", "errors").starts_with("The filter states deviations that are too small: its errors are "));
        assert_eq!(nis(&run(0.7, 0.0)).unwrap().verdict, Verdict::ClaimsTooLittle);
    }

    #[test]
    fn innovations_that_remember_are_not_white() {
        assert!(whiteness(&run(1.0, 0.0)).unwrap().white);
        let slow = whiteness(&run(1.0, 0.6)).unwrap();
        assert!(!slow.white && (slow.lag_one - 0.6).abs() < 0.05);
    }

    #[test]
    fn errors_that_last_widen_the_band() {
        let squares = |memory| run(1.0, memory).innovations.iter().map(|(_, i)| i.nis).collect::<Vec<f64>>();
        let [quick, slow] = [0.0, 0.95].map(|memory| effective_count(&squares(memory)).unwrap());
        // Squares of a process that remembers 0.95 remember 0.95^2: N (1 - r) / (1 + r) are left.
        let expected = 3000.0 * (1.0 - 0.9025) / 1.9025;
        assert!(quick > 2400.0 && (slow / expected - 1.0).abs() < 0.5, "{quick} {slow} {expected}");
    }
}
