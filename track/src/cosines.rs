//! The cosine transform of a JPEG file's squares (ITU-R T.81, A.3.3), of many functions at a time.
//!
//! It is orthonormal: sums of products of coefficients are those of samples, and back goes what is transposed.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;

/// Samples of a square and direction.
pub(crate) const SIDE: usize = 8;
/// Samples, or coefficients, of a square.
pub(crate) const COUNT: usize = SIDE * SIDE;
/// `cos(i pi / 16) / 2`.
const C: [f32; SIDE] = [0.5, 0.490_392_64, 0.461_939_77, 0.415_734_8, 0.353_553_4, 0.277_785_12, 0.191_341_72, 0.097_545_16];

/// Coefficients of samples that are written row by row; rows are vertical frequencies.
#[inline(always)]
pub(crate) fn cosines<S: Simd>(samples: [f32x16<S>; COUNT]) -> [f32x16<S>; COUNT] {
    along_both(samples, forth)
}

/// Samples of coefficients.
#[inline(always)]
pub(crate) fn samples<S: Simd>(coefficients: [f32x16<S>; COUNT]) -> [f32x16<S>; COUNT] {
    along_both(coefficients, back)
}

/// Columns, then rows.
#[inline(always)]
fn along_both<S: Simd>(mut values: [f32x16<S>; COUNT], line: impl Fn([f32x16<S>; SIDE]) -> [f32x16<S>; SIDE]) -> [f32x16<S>; COUNT] {
    for (first, step) in (0..SIDE).map(|x| (x, SIDE)).chain((0..SIDE).map(|y| (y * SIDE, 1))) {
        let changed = line(std::array::from_fn(|i| values[first + i * step]));
        for (i, value) in changed.into_iter().enumerate() {
            values[first + i * step] = value;
        }
    }
    values
}

/// Even coefficients come from sums of a sample and its mirror image, odd ones from differences.
#[inline(always)]
fn forth<S: Simd>(x: [f32x16<S>; SIDE]) -> [f32x16<S>; SIDE] {
    let s: [f32x16<S>; 4] = std::array::from_fn(|i| x[i] + x[7 - i]);
    let d: [f32x16<S>; 4] = std::array::from_fn(|i| x[i] - x[7 - i]);
    let (outer, inner) = ([s[0] + s[3], s[1] + s[2]], [s[0] - s[3], s[1] - s[2]]);
    [
        (outer[0] + outer[1]) * C[4],
        d[0] * C[1] + d[1] * C[3] + d[2] * C[5] + d[3] * C[7],
        inner[0] * C[2] + inner[1] * C[6],
        d[0] * C[3] - d[1] * C[7] - d[2] * C[1] - d[3] * C[5],
        (outer[0] - outer[1]) * C[4],
        d[0] * C[5] - d[1] * C[1] + d[2] * C[7] + d[3] * C[3],
        inner[0] * C[6] - inner[1] * C[2],
        d[0] * C[7] - d[1] * C[5] + d[2] * C[3] - d[3] * C[1],
    ]
}

#[inline(always)]
fn back<S: Simd>(x: [f32x16<S>; SIDE]) -> [f32x16<S>; SIDE] {
    let (plus, minus) = ((x[0] + x[4]) * C[4], (x[0] - x[4]) * C[4]);
    let (outer, inner) = (x[2] * C[2] + x[6] * C[6], x[2] * C[6] - x[6] * C[2]);
    let s = [plus + outer, minus + inner, minus - inner, plus - outer];
    let d = [
        x[1] * C[1] + x[3] * C[3] + x[5] * C[5] + x[7] * C[7],
        x[1] * C[3] - x[3] * C[7] - x[5] * C[1] - x[7] * C[5],
        x[1] * C[5] - x[3] * C[1] + x[5] * C[7] + x[7] * C[3],
        x[1] * C[7] - x[3] * C[5] + x[5] * C[3] - x[7] * C[1],
    ];
    std::array::from_fn(|i| if i < 4 { s[i] + d[i] } else { s[7 - i] - d[7 - i] })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use fearless_simd::dispatch;

    use super::*;
    use crate::sieve::LEVEL;

    #[test]
    fn coefficients_are_those_of_the_standard_and_go_back() {
        let sample = |i: usize| ((i * i * 37 + i * 11) % 256) as f32 - 128.0;
        let [there, again] = dispatch!(*LEVEL, simd => {
            let there = cosines(std::array::from_fn(|i| f32x16::splat(simd, sample(i))));
            [there, samples(there)].map(|values| values.map(|value| value[3]))
        });
        for k in 0..COUNT {
            let basis = |at: usize, frequency: usize| ((2 * at + 1) as f64 * frequency as f64 * PI / 16.0).cos();
            let scale = |frequency: usize| if frequency == 0 { 0.5_f64.sqrt() } else { 1.0 };
            let (v, u) = (k / SIDE, k % SIDE);
            let sum: f64 = (0..COUNT).map(|i| f64::from(sample(i)) * basis(i % SIDE, u) * basis(i / SIDE, v)).sum();
            let coefficient = 0.25 * scale(u) * scale(v) * sum;
            assert!((f64::from(there[k]) - coefficient).abs() < 1e-3, "{k}: {} {coefficient}", there[k]);
            assert!((again[k] - sample(k)).abs() < 1e-3, "{k}: {} {}", again[k], sample(k));
        }
    }
}
