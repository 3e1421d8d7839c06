//! How far the robot file's numbers are off in other recordings of the same rig, beside the tolerances that the file states.
//!
//! A number `k` of recording `j` is off by `x_jk` of its tolerances, normal with zero mean and a variance `s_g^2` that all numbers of one kind of
//! effect share (the joints' hard stops, the axes of the cameras' translation). A recording alone, with its tolerances as stated, tells
//! `x_j ~ N(m_j, C_j)`; by other variances it tells
//!
//! ```text
//! P_j = C_j^-1 + diag(s^-2 - 1),   x_j ~ N(P_j^-1 C_j^-1 m_j, P_j^-1)
//! ```
//!
//! and variances follow from what they give in turn (expectation maximisation; Dempster, Laird and Rubin 1977), the file's own statement counted as
//! one more number that is off by its tolerance (a prior with the information of one observation; Kass and Wasserman 1995).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use raven::simulation::SEALED_FACTOR;
use rayon::prelude::*;
use serde::{Serialize, Serializer};

use crate::evidence::fit::{Fitter, Hypothesis};

/// Numbers within their tolerances are off by this part of them in the virtual lab, by whose recordings priors and odds were set. What a rig is off by
/// counts with the same margin: without, a coupling of 2.6 deviations was named.
const MARGIN: f64 = SEALED_FACTOR;
/// Variances have settled when none changes by more than this part, and are taken as they are after so many rounds.
const SETTLED: f64 = 1e-4;
const ROUNDS_MAX: usize = 500;

/// What one recording says of how far the file's numbers are off.
#[derive(Debug, Clone)]
pub struct Departures {
    /// The kind of effect that each number would be; nothing for those that an effect of the recording is about.
    kinds: Vec<Option<&'static str>>,
    /// `C^-1`, tolerances to the power of -2.
    information: DMatrix<f64>,
    /// `C^-1 m`.
    score: DVector<f64>,
}

impl Departures {
    /// By the kinds of numbers, where they are best [tolerances] and how they scatter about that; `None` where the covariance is none.
    fn new(kinds: Vec<Option<&'static str>>, mean: &DVector<f64>, covariance: DMatrix<f64>) -> Option<Self> {
        let information = covariance.cholesky()?.inverse();
        let score = &information * mean;
        Some(Self { kinds, information, score })
    }

    /// Of numbers of one kind, where they are best and their deviation [tolerances].
    #[cfg(test)]
    pub(crate) fn of_kind(kind: &'static str, means: &[f64], std: f64) -> Self {
        let n = means.len();
        let covariance = DMatrix::from_diagonal_element(n, n, std.powi(2));
        Self::new(vec![Some(kind); n], &DVector::from_column_slice(means), covariance).unwrap()
    }

    /// Second moments about the file's numbers, by kind, where numbers of a kind spread as `spread` says.
    fn moments(&self, spread: &Spread) -> Option<BTreeMap<&'static str, Moments>> {
        let added = self.kinds.iter().map(|kind| kind.map_or(0.0, |kind| spread.off(kind).powi(-2) - 1.0));
        let precision = &self.information + DMatrix::from_diagonal(&DVector::from_iterator(self.kinds.len(), added));
        let covariance = precision.cholesky()?.inverse();
        let mean = &covariance * &self.score;
        let mut moments: BTreeMap<&'static str, Moments> = BTreeMap::new();
        for (k, kind) in self.kinds.iter().enumerate().filter_map(|(k, kind)| kind.map(|kind| (k, kind))) {
            let of_kind = moments.entry(kind).or_default();
            of_kind.count += 1;
            of_kind.sum += mean[k].powi(2) + covariance[(k, k)];
        }
        Some(moments)
    }
}

/// Sum of the second moments of so many numbers [tolerances squared].
#[derive(Debug, Clone, Copy, Default)]
struct Moments {
    count: usize,
    sum: f64,
}

impl Fitter<'_> {
    /// How far a hypothesis takes the file's numbers to be off, whose free coordinates have these deviations. `None` where they cannot be told.
    #[must_use]
    pub fn departures(&self, hypothesis: &Hypothesis, deviations: &[f64]) -> Option<Departures> {
        let coordinates = self.coordinates;
        // An effect's own numbers have no tolerance: they stay in the units of its prior.
        let number = |&c: &usize| {
            let coordinate = coordinates.all[c];
            match coordinate.spike.filter(|_| coordinates.is_of_file(c, &hypothesis.effects)) {
                Some(spike) => (Some(coordinates.sited[coordinate.effect].effect.id), spike),
                None => (None, 1.0),
            }
        };
        let (kinds, units): (Vec<_>, Vec<f64>) = hypothesis.free.iter().map(number).unzip();
        let n = units.len();
        let mean = DVector::from_iterator(n, hypothesis.free.iter().zip(&units).map(|(&c, unit)| hypothesis.u[c] / unit));
        // Residuals that are alike over time count for what they hold; what numbers have to do with each other stays.
        let inflated = |k: usize| deviations[k] / (hypothesis.covariance[(k, k)].max(f64::MIN_POSITIVE).sqrt() * units[k]);
        let inflated: Vec<f64> = (0..n).map(inflated).collect();
        let covariance = DMatrix::from_fn(n, n, |a, b| hypothesis.covariance[(a, b)] * inflated[a] * inflated[b]);
        Departures::new(kinds, &mean, covariance)
    }
}

/// By how much of the file's tolerances its numbers are off, by the kind of effect they would be. Serializes as the parts that count.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Spread {
    off: BTreeMap<&'static str, f64>,
}

impl Serialize for Spread {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.parts())
    }
}

impl Spread {
    /// As other recordings of the rig show it: as stated where there are none, and never more than that.
    #[must_use]
    pub fn of(others: &[&Departures]) -> Self {
        Self::default().settled(others)
    }

    /// The same from where it is, which may be near.
    fn settled(&self, others: &[&Departures]) -> Self {
        let mut spread = self.clone();
        for _ in 0..ROUNDS_MAX {
            let next = spread.improved(others);
            let change = next.off.iter().map(|(kind, off)| (off / spread.off(kind) - 1.0).abs()).fold(0.0, f64::max);
            spread = next;
            if change < SETTLED {
                break;
            }
        }
        spread
    }

    /// The same for every recording of a rig, by the others: a verdict does not rest on what its own recording said before.
    #[must_use]
    pub fn of_others(all: &[Option<Departures>]) -> Vec<Self> {
        let but = |left_out: Option<usize>| {
            let kept = all.iter().enumerate().filter(|(at, _)| Some(*at) != left_out);
            kept.filter_map(|(_, departures)| departures.as_ref()).collect::<Vec<_>>()
        };
        let together = Self::of(&but(None));
        (0..all.len()).into_par_iter().map(|at| together.settled(&but(Some(at)))).collect()
    }

    /// Part of the stated tolerance that counts in its place for numbers of a kind.
    #[must_use]
    pub fn part(&self, kind: &str) -> f64 {
        (self.off(kind) / MARGIN).min(1.0)
    }

    /// Part of the stated tolerance that they are off by, one sigma.
    fn off(&self, kind: &str) -> f64 {
        self.off.get(kind).copied().unwrap_or(1.0)
    }

    /// Kinds of effects, and the part of their tolerances that counts.
    pub fn parts(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.off.keys().map(|&kind| (kind, self.part(kind)))
    }

    /// A round: what recordings tell by these variances, and the variances that follow.
    fn improved(&self, others: &[&Departures]) -> Self {
        let mut all: BTreeMap<&'static str, Moments> = BTreeMap::new();
        for moments in others.iter().filter_map(|other| other.moments(self)) {
            for (kind, Moments { count, sum }) in moments {
                let of_kind = all.entry(kind).or_default();
                of_kind.count += count;
                of_kind.sum += sum;
            }
        }
        let off = |(kind, Moments { count, sum })| (kind, ((1.0 + sum) / (1.0 + count as f64)).sqrt().min(1.0));
        Self { off: all.into_iter().map(off).collect() }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// What a recording alone tells of numbers that are off by `off` tolerances, where it shows `shown` (a row per sum of numbers) with a
    /// deviation of `noise`.
    fn alone(kinds: &[Option<&'static str>], off: &[f64], shown: &DMatrix<f64>, noise: f64, random: &mut ChaCha8Rng) -> Departures {
        let shows = shown * DVector::from_column_slice(off);
        let seen = shows.map(|s| s + noise * Distribution::<f64>::sample(&StandardNormal, random));
        let precision = shown.transpose() * shown / noise.powi(2) + DMatrix::identity(off.len(), off.len());
        let covariance = precision.cholesky().unwrap().inverse();
        let mean = &covariance * shown.transpose() * seen / noise.powi(2);
        Departures::new(kinds.to_vec(), &mean, covariance).unwrap()
    }

    fn of_all(all: &[Departures]) -> Spread {
        Spread::of(&all.iter().collect::<Vec<_>>())
    }

    #[test]
    fn numbers_spread_as_they_do() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let kinds = [Some("joint-offset"), Some("joint-offset"), Some("pulley-radius"), Some("payload"), None];
        let spreads = [0.3, 0.3, 0.7, 0.5, 3.0];
        // The fourth does not show.
        let shown = DMatrix::from_fn(4, 5, |row, c| f64::from(u8::from([0, 1, 2, 4][row] == c)));
        let recording = |_| {
            let off = spreads.map(|s: f64| s * Distribution::<f64>::sample(&StandardNormal, &mut random));
            alone(&kinds, &off, &shown, 0.5, &mut random)
        };
        let all: Vec<Departures> = (0..400).map(recording).collect();
        let spread = of_all(&all);
        // Variances of 800 and 400 numbers, seen with a deviation of a half.
        approx::assert_relative_eq!(spread.off("joint-offset"), 0.3, epsilon = 0.04);
        approx::assert_relative_eq!(spread.off("pulley-radius"), 0.7, epsilon = 0.06);
        approx::assert_relative_eq!(spread.off("payload"), 1.0, epsilon = 1e-6);
        assert_eq!(spread.parts().count(), 3);
    }

    #[test]
    fn what_only_sums_show_is_shared_among_them() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        let kinds = [Some("joint-offset"), Some("tool-length")];
        let sum = DMatrix::from_element(1, 2, 1.0);
        let recording = |_| {
            let off = [0.0; 2].map(|_| 0.4 * Distribution::<f64>::sample(&StandardNormal, &mut random));
            alone(&kinds, &off, &sum, 0.01, &mut random)
        };
        let all: Vec<Departures> = (0..400).map(recording).collect();
        let spread = of_all(&all);
        let of_sum = spread.off("joint-offset").hypot(spread.off("tool-length"));
        approx::assert_relative_eq!(of_sum, 0.4 * std::f64::consts::SQRT_2, max_relative = 0.1);
    }

    #[test]
    fn few_recordings_leave_much_of_what_is_stated_and_none_all_of_it() {
        let [exact, far] = [0.0, 3.0].map(|off| Departures::of_kind("tool-length", &[off], 1e-4));
        // One that is exact against one's worth of what is stated.
        approx::assert_relative_eq!(of_all(std::slice::from_ref(&exact)).off("tool-length"), 0.5_f64.sqrt(), epsilon = 1e-3);
        assert_eq!(of_all(&[]), Spread::default());
        // Never more than is stated.
        assert_eq!(of_all(&[exact.clone(), far.clone()]).part("tool-length"), 1.0);
        // What a recording says of itself does not count.
        let spreads = Spread::of_others(&[Some(exact.clone()), Some(far), None, Some(exact)]);
        assert_eq!(spreads.iter().map(|spread| spread.part("tool-length") < 1.0).collect::<Vec<_>>(), [false, true, false, false]);
        approx::assert_relative_eq!(spreads[1].off("tool-length"), (1.0_f64 / 3.0).sqrt(), epsilon = 2e-3);
        // With the margin that numbers within their tolerances have.
        approx::assert_relative_eq!(spreads[1].part("tool-length"), spreads[1].off("tool-length") / 0.7, epsilon = 1e-12);
    }
}
