//! The estimator on linear problems whose answer is known: claimed deviations against sampled ones.

use nalgebra::{DMatrix, DVector, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

/// `r = slopes z - observed`, in blocks of `PER_BLOCK`.
pub struct Line {
    pub slopes: Vec<DMatrix<f64>>,
    pub observed: Vec<Vector3<f64>>,
}

const PER_BLOCK: usize = 20;

impl Line {
    /// Smooth slopes, so that every block sees another part of the motion, and observations without noise.
    pub fn exact(truth: &[f64], count: usize) -> Self {
        let slope = |i: usize, row: usize, k: usize| {
            let t = i as f64 / count as f64;
            (7.0 * t * (k + 1) as f64 + row as f64).sin()
        };
        let slopes: Vec<DMatrix<f64>> = (0..count).map(|i| DMatrix::from_fn(3, truth.len(), |row, k| slope(i, row, k))).collect();
        let truth = DVector::from_row_slice(truth);
        let observed = slopes.iter().map(|m| Vector3::from_iterator((m * &truth).iter().copied())).collect();
        Self { slopes, observed }
    }
}

impl Residuals for Line {
    fn unknowns(&self) -> usize {
        self.slopes[0].ncols()
    }

    fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>> {
        let of = |(m, o): (&DMatrix<f64>, &Vector3<f64>)| Vector3::from_iterator((m * z).iter().copied()) - o;
        Ok(self.slopes.iter().zip(&self.observed).map(of).collect())
    }

    fn blocks(&self) -> Vec<usize> {
        (0..self.observed.len()).map(|i| i / PER_BLOCK).collect()
    }
}

/// Shares of samples in which the truth lay within one and two claimed deviations, per unknown.
fn coverage(samples: u64, blocks: usize, may_hold: &[bool], noise: impl Fn(&mut ChaCha8Rng, &mut [Vector3<f64>])) -> Vec<[f64; 2]> {
    let n = may_hold.len();
    let mut inside = vec![[0.0; 2]; n];
    for seed in 0..samples {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let truth: Vec<f64> = (0..n).map(|_| StandardNormal.sample(&mut random)).collect();
        let mut line = Line::exact(&truth, blocks * PER_BLOCK);
        noise(&mut random, &mut line.observed);
        let estimate = estimate(&line, may_hold, &[], &DVector::zeros(n)).unwrap();
        for k in 0..n {
            let off = (estimate.z[k] - truth[k]).abs() / estimate.std[k];
            inside[k][0] += f64::from(u8::from(off < 1.0)) / samples as f64;
            inside[k][1] += f64::from(u8::from(off < 2.0)) / samples as f64;
        }
    }
    inside
}

fn normal(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(random))
}

/// Three binomial deviations about the nominal rates of one and two deviations.
fn assert_nominal(inside: &[[f64; 2]], samples: u64) {
    for (k, shares) in inside.iter().enumerate() {
        for (share, nominal) in shares.iter().zip([0.6827, 0.9545]) {
            let band = 3.0 * (nominal * (1.0 - nominal) / samples as f64).sqrt();
            assert!((share - nominal).abs() < band, "unknown {k}: {share:.3} inside, expected {nominal} +- {band:.3}");
        }
    }
}

const SAMPLES: u64 = 400;

fn white(random: &mut ChaCha8Rng, observed: &mut [Vector3<f64>]) {
    observed.iter_mut().for_each(|o| *o += normal(random));
}

#[test]
fn claimed_deviations_hold_under_white_noise() {
    assert_nominal(&coverage(SAMPLES, 40, &[true; 3], white), SAMPLES);
}

#[test]
fn claimed_deviations_hold_when_blocks_are_alike() {
    let alike = |random: &mut ChaCha8Rng, observed: &mut [Vector3<f64>]| {
        for block in observed.chunks_mut(PER_BLOCK) {
            let common = 1.5 * normal(random);
            block.iter_mut().for_each(|o| *o += common + normal(random));
        }
    };
    assert_nominal(&coverage(SAMPLES, 40, &[true; 3], alike), SAMPLES);
}

#[test]
fn claimed_deviations_hold_with_false_blobs() {
    let spoilt = |random: &mut ChaCha8Rng, observed: &mut [Vector3<f64>]| {
        white(random, observed);
        observed.iter_mut().step_by(17).for_each(|o| *o += 300.0 * normal(random));
    };
    assert_nominal(&coverage(SAMPLES, 40, &[true; 3], spoilt), SAMPLES);
}

#[test]
fn what_the_data_do_not_determine_goes_back_to_its_prior() {
    // One block has nothing to scatter about.
    for blocks in [40, 1] {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut line = Line::exact(&[1.0, -1.0, 2.0], blocks * PER_BLOCK);
        white(&mut random, &mut line.observed);
        line.slopes.iter_mut().for_each(|m| m.column_mut(2).scale_mut(1e-3));
        let held = estimate(&line, &[true; 3], &[], &DVector::zeros(3)).unwrap();
        assert_eq!((held.z[2], held.identified.as_slice()), (0.0, [true, true, false].as_slice()));
        assert!(held.std[2] > IDENTIFIED_BELOW && held.std.iter().all(|std| std.is_finite()));
        let kept = estimate(&line, &[true, true, false], &[], &DVector::zeros(3)).unwrap();
        assert!(kept.z[2] != 0.0 && !kept.identified[2]);
    }
}

#[test]
fn a_held_unknown_still_counts_in_the_others_deviation() {
    // The sum of the two is seen well, neither alone: the second has the wider room to be wrong in.
    let mut line = Line::exact(&[0.3, 0.3], 40 * PER_BLOCK);
    for slopes in &mut line.slopes {
        let first = slopes.column(0).clone_owned();
        slopes.set_column(1, &(first * 0.2));
    }
    white(&mut ChaCha8Rng::seed_from_u64(4), &mut line.observed);
    let estimate = estimate(&line, &[true, true], &[], &DVector::zeros(2)).unwrap();
    assert_eq!(estimate.identified, [true, false]);
    assert!((estimate.std[0] - 0.2).abs() < 0.02, "0.2 of a held unit deviation, not {}", estimate.std[0]);
}

/// What one block alone tells has nothing to be compared with, and counts as not determined; at its prior it is not for that.
#[test]
fn what_is_seen_once_and_is_not_the_prior_is_not_put_back() {
    let truth = [0.3, 0.3, 5.0];
    let mut line = Line::exact(&truth, 40 * PER_BLOCK);
    for (slopes, observed) in line.slopes.iter_mut().zip(&mut line.observed).skip(PER_BLOCK) {
        *observed -= slopes.column(2) * truth[2];
        slopes.column_mut(2).fill(0.0);
    }
    white(&mut ChaCha8Rng::seed_from_u64(5), &mut line.observed);
    let estimate = estimate(&line, &[true; 3], &[], &DVector::zeros(3)).unwrap();
    assert!(!estimate.identified[2] && estimate.std[2] > IDENTIFIED_BELOW, "{:?}", estimate.std);
    assert!((estimate.z[2] - truth[2]).abs() < 1.0, "{}", estimate.z);
}
