//! Shares with their intervals, and how well probabilities are meant.
//!
//! ```text
//! Wilson (1927):  (p + z^2/2n -+ z sqrt(p (1 - p) / n + z^2 / 4 n^2)) / (1 + z^2/n)
//! Brier (1950):   mean of (probability - right)^2
//! ECE:            sum over ten bins of (claims in it / all) |mean probability - part right|   (Naeini et al. 2015)
//! ```

use serde::Serialize;

/// Normal quantile of a two-sided 95 %.
pub const Z95: f64 = 1.959_963_984_540_054;
const BINS: usize = 10;

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Share {
    /// Hits.
    pub hits: usize,
    /// Of how many.
    pub of: usize,
}

impl Share {
    /// Counts one.
    pub fn count(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }

    /// The share; `None` of nothing.
    #[must_use]
    pub fn value(self) -> Option<f64> {
        (self.of > 0).then(|| self.hits as f64 / self.of as f64)
    }

    /// Wilson's 95 % interval; `None` of nothing.
    #[must_use]
    pub fn wilson95(self) -> Option<[f64; 2]> {
        let (p, n) = (self.value()?, self.of as f64);
        let z2 = Z95 * Z95 / n;
        let half = Z95 * (p * (1.0 - p) / n + z2 / (4.0 * n)).sqrt();
        let bound = |b: f64| (b / (1.0 + z2)).clamp(0.0, 1.0);
        Some([bound(p + 0.5 * z2 - half), bound(p + 0.5 * z2 + half)])
    }
}

impl Serialize for Share {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Written {
            hits: usize,
            of: usize,
            share: Option<f64>,
            wilson95: Option<[f64; 2]>,
        }
        Written { hits: self.hits, of: self.of, share: self.value(), wilson95: self.wilson95() }.serialize(serializer)
    }
}

/// Something said with a probability, and whether it was right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Claim {
    /// From 0 to 1.
    pub probability: f64,
    /// Whether it was.
    pub right: bool,
}

/// Brier score; `None` of nothing.
#[must_use]
pub fn brier(claims: &[Claim]) -> Option<f64> {
    let miss = |claim: &Claim| claim.probability - f64::from(u8::from(claim.right));
    (!claims.is_empty()).then(|| claims.iter().map(|claim| miss(claim).powi(2)).sum::<f64>() / claims.len() as f64)
}

/// Expected calibration error; `None` of nothing.
#[must_use]
pub fn calibration_error(claims: &[Claim]) -> Option<f64> {
    let mut surplus = [0.0; BINS];
    for claim in claims {
        let bin = ((claim.probability * BINS as f64) as usize).min(BINS - 1);
        surplus[bin] += claim.probability - f64::from(u8::from(claim.right));
    }
    // |mean probability - part right| times the claims in the bin is the bin's surplus.
    (!claims.is_empty()).then(|| surplus.iter().map(|s: &f64| s.abs()).sum::<f64>() / claims.len() as f64)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn wilson_intervals_of_the_literature() {
        // Half of ten: 0.2366 to 0.7634; none of ninety: 0 to z^2 / (n + z^2) = 3.8415 / 93.8415.
        let [low, high] = Share { hits: 5, of: 10 }.wilson95().unwrap();
        assert_relative_eq!(low, 0.236_59, epsilon = 1e-5);
        assert_relative_eq!(high, 0.763_41, epsilon = 1e-5);
        let [low, high] = Share { hits: 0, of: 90 }.wilson95().unwrap();
        assert_relative_eq!(low, 0.0, epsilon = 1e-12);
        assert_relative_eq!(high, 0.040_936, epsilon = 1e-6);
        // Newcombe 1998, table I: 81 of 263 is 0.2553 to 0.3662.
        let [low, high] = Share { hits: 81, of: 263 }.wilson95().unwrap();
        assert_relative_eq!(low, 0.2553, epsilon = 5e-5);
        assert_relative_eq!(high, 0.3662, epsilon = 5e-5);
        assert!(Share::default().wilson95().is_none());
    }

    #[test]
    fn probabilities_are_scored_by_hand() {
        let claim = |probability, right| Claim { probability, right };
        let claims = [claim(0.95, true), claim(0.95, false), claim(0.65, true), claim(1.0, true)];
        // (0.0025 + 0.9025 + 0.1225 + 0) / 4
        assert_relative_eq!(brier(&claims).unwrap(), 0.256_875, epsilon = 1e-12);
        // Bin 0.9 to 1: 2.9 said, 2 right; bin 0.6 to 0.7: 0.65 said, 1 right: (0.9 + 0.35) / 4.
        assert_relative_eq!(calibration_error(&claims).unwrap(), 0.3125, epsilon = 1e-12);
        assert!(brier(&[]).is_none() && calibration_error(&[]).is_none());
    }
}
