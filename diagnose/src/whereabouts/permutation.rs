//! Significance by circular block shifts: squares stay in blocks, the blocks change places, the bins stay.
//!
//! The sum of each bin is studentised by its own permutations. The largest over all bins of all series in one round gives the distribution
//! to which each is held (max-T; Westfall & Young 1993), so the chance of any false alarm is the level. Series are permuted apart, which
//! makes the largest of dependent ones larger than it need be: the test errs on the safe side.
//!
//! Ordinates of a periodogram are held against exponential deviates, which those of white noise are: one line among them would stay one
//! line in every order, and some bin would always have it.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::spectrum::over_continuum;

/// A sample that is in no bin.
pub const NOWHERE: u8 = u8::MAX;
/// Fewer samples than this make no bin.
pub const SAMPLES_MIN: usize = 10;

/// Values, and one or more ways to sort them into bins.
#[derive(Debug, Clone)]
pub struct Scores {
    /// Squares.
    pub values: Vec<f64>,
    /// For each way, the bin of each value or [`NOWHERE`], and how many bins there are.
    pub bins: Vec<(Vec<u8>, usize)>,
    /// What they would be if they knew nothing of the bins.
    pub chance: Chance,
}

/// How values come about that know nothing of the bins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chance {
    /// As blocks of so many samples in a random order.
    Blocks(usize),
    /// As exponential deviates over their own continuum.
    Spectrum,
}

struct Studentised {
    observed: Vec<Vec<f64>>,
    largest: Vec<f64>,
}

/// Family-wise P value of each bin of each way of each series, for more than its share. Equal seeds give equal values.
#[must_use]
pub fn family_wise(series: &[Scores], permutations: usize, seed: u64) -> Vec<Vec<Vec<f64>>> {
    let each: Vec<Studentised> =
        series.par_iter().enumerate().map(|(k, scores)| scores.studentised(permutations, seed.wrapping_add(k as u64))).collect();
    let mut largest: Vec<f64> =
        (0..=permutations).map(|round| each.iter().map(|s| s.largest[round]).fold(f64::NEG_INFINITY, f64::max)).collect();
    largest.sort_by(f64::total_cmp);
    let p = |z: &f64| {
        let at_least = largest.len() - largest.partition_point(|l| l < z);
        at_least.max(1) as f64 / largest.len() as f64
    };
    each.iter().map(|s| s.observed.iter().map(|bins| bins.iter().map(p).collect()).collect()).collect()
}

impl Scores {
    fn studentised(&self, permutations: usize, seed: u64) -> Studentised {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let offsets: Vec<usize> = self.bins.iter().scan(0, |at, (_, count)| Some(std::mem::replace(at, *at + count))).collect();
        let width: usize = self.bins.iter().map(|(_, count)| count).sum();
        let mut sums = vec![0.0; width * (permutations + 1)];
        let mut shuffled = self.values.clone();
        let mut until = vec![0.0; self.values.len() + 1];
        let stretches: Vec<Vec<(usize, u8)>> = self.bins.iter().map(|(bins, _)| stretches(bins)).collect();
        for round in sums.chunks_exact_mut(width.max(1)) {
            let mut total = 0.0;
            for (until, value) in until[1..].iter_mut().zip(&shuffled) {
                total += value;
                *until = total;
            }
            for ((stretches, (_, count)), &offset) in stretches.iter().zip(&self.bins).zip(&offsets) {
                // One place more than there are bins takes what is nowhere.
                let (mut sum, mut before) = ([0.0; NOWHERE as usize + 1], 0.0);
                for &(end, bin) in stretches {
                    sum[usize::from(bin)] += until[end] - before;
                    before = until[end];
                }
                round[offset..offset + count].copy_from_slice(&sum[..*count]);
            }
            match self.chance {
                Chance::Blocks(block) => self.shuffle(block, &mut rng, &mut shuffled),
                Chance::Spectrum => draw(&mut rng, &mut shuffled),
            }
        }
        let mut largest = vec![f64::NEG_INFINITY; permutations + 1];
        let mut observed = Vec::new();
        for ((bins, count), &offset) in self.bins.iter().zip(&offsets) {
            let inside = |bin: usize| bins.iter().filter(|&&b| usize::from(b) == bin).count();
            let of_bin = |bin: usize| {
                let column = || sums.iter().skip(offset + bin).step_by(width);
                let mean = column().sum::<f64>() / (permutations + 1) as f64;
                let spread = (column().map(|s| (s - mean).powi(2)).sum::<f64>() / (permutations + 1) as f64).sqrt();
                // Where every order gives the same sum, nothing is learnt from it.
                if inside(bin) < SAMPLES_MIN || spread.is_nan() || spread <= 1e-12 * mean.abs() {
                    return (f64::NEG_INFINITY, Vec::new());
                }
                (0.0, column().map(|s| (s - mean) / spread).collect::<Vec<f64>>())
            };
            observed.push(
                (0..*count)
                    .map(|bin| {
                        let (none, z) = of_bin(bin);
                        largest.iter_mut().zip(&z).for_each(|(largest, z)| *largest = largest.max(*z));
                        z.first().copied().unwrap_or(none)
                    })
                    .collect(),
            );
        }
        Studentised { observed, largest }
    }

    /// Turns the series by a random amount, cuts it into blocks and puts them in a random order.
    fn shuffle(&self, block: usize, rng: &mut ChaCha8Rng, into: &mut [f64]) {
        let count = self.values.len();
        if count == 0 {
            return;
        }
        let turn = rng.random_range(0..count);
        let block = block.clamp(1, count);
        let mut order: Vec<usize> = (0..count.div_ceil(block)).collect();
        for k in (1..order.len()).rev() {
            order.swap(k, rng.random_range(0..=k));
        }
        let mut at = 0;
        for from in order {
            let (start, length) = (from * block + turn, block.min(count - from * block));
            let start = start % count;
            let first = length.min(count - start);
            into[at..at + first].copy_from_slice(&self.values[start..start + first]);
            into[at + first..at + length].copy_from_slice(&self.values[..length - first]);
            at += length;
        }
    }
}

fn draw(rng: &mut ChaCha8Rng, into: &mut [f64]) {
    into.iter_mut().for_each(|value| *value = -(1.0 - rng.random::<f64>()).ln());
    over_continuum(into);
}

/// Where stretches in one bin end, with the bin.
fn stretches(bins: &[u8]) -> Vec<(usize, u8)> {
    let ends = (0..bins.len()).filter(|&k| bins.get(k + 1) != Some(&bins[k]));
    ends.map(|k| (k + 1, bins[k])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shuffle_keeps_every_value_and_its_blocks() {
        let scores = Scores { values: (0..103).map(f64::from).collect(), bins: vec![], chance: Chance::Blocks(10) };
        let mut into = scores.values.clone();
        scores.shuffle(10, &mut ChaCha8Rng::seed_from_u64(3), &mut into);
        assert_ne!(into, scores.values);
        let neighbours = into.windows(2).filter(|w| (w[1] - w[0] - 1.0).abs() < 0.5 || w[0] - w[1] > 101.5).count();
        assert!(neighbours >= 90, "{neighbours}");
        into.sort_by(f64::total_cmp);
        assert_eq!(into, scores.values);
    }

    #[test]
    fn a_bin_with_more_than_its_share_has_a_small_p() {
        let values: Vec<f64> = (0..400).map(|k| if (k / 20) % 5 == 0 { 3.0 } else { 1.0 } + f64::from(k * 7 % 11) * 0.1).collect();
        let bins = (0..400).map(|k| u8::from((k / 20) % 5 == 0)).collect();
        let p = family_wise(&[Scores { values, bins: vec![(bins, 2)], chance: Chance::Blocks(3) }], 199, 1);
        assert!(p[0][0][1] <= 0.005 + 1e-12 && p[0][0][0] > 0.5, "{p:?}");
    }
}
