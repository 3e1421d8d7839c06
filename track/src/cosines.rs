//! The cosine transform of a JPEG file's squares (ITU-R T.81, A.3.3), of many functions at a time.
//!
//! It is orthonormal: sums of products of coefficients are those of samples.

use std::ops::{Add, Mul, Sub};

/// Samples of a square and direction.
pub(crate) const SIDE: usize = 8;
/// Samples, or coefficients, of a square.
pub(crate) const COUNT: usize = SIDE * SIDE;
/// First sample of each column and of each row, and from one to the next in it.
const LINES: [(usize, usize); 2 * SIDE] = {
    let mut lines = [(0, SIDE); 2 * SIDE];
    let mut i = 0;
    while i < SIDE {
        (lines[i].0, lines[SIDE + i]) = (i, (i * SIDE, 1));
        i += 1;
    }
    lines
};
/// `cos(i pi / 16) / 2`.
const C: [f32; SIDE] = [0.5, 0.490_392_64, 0.461_939_77, 0.415_734_8, 0.353_553_4, 0.277_785_12, 0.191_341_72, 0.097_545_16];

/// A number, or as many as a processor takes at a time.
pub(crate) trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self> {}

impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>> Number for T {}

/// Coefficients of samples that are written row by row, in their place; rows are vertical frequencies.
#[inline(always)]
pub(crate) fn to_cosines<T: Number>(values: &mut [T; COUNT]) {
    for (first, step) in LINES {
        put(values, first, step, forth(line(values, first, step)));
    }
}

// Vectors stay out of closures: one that is not inlined loses the processor's instructions.
#[inline(always)]
fn line<T: Number>(v: &[T; COUNT], first: usize, step: usize) -> [T; SIDE] {
    let at = |i: usize| first + i * step;
    [v[at(0)], v[at(1)], v[at(2)], v[at(3)], v[at(4)], v[at(5)], v[at(6)], v[at(7)]]
}

#[inline(always)]
fn put<T: Number>(values: &mut [T; COUNT], first: usize, step: usize, line: [T; SIDE]) {
    for i in 0..SIDE {
        values[first + i * step] = line[i];
    }
}

/// Even coefficients come from sums of a sample and its mirror image, odd ones from differences.
#[inline(always)]
fn forth<T: Number>(x: [T; SIDE]) -> [T; SIDE] {
    let s = [x[0] + x[7], x[1] + x[6], x[2] + x[5], x[3] + x[4]];
    let d = [x[0] - x[7], x[1] - x[6], x[2] - x[5], x[3] - x[4]];
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

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn coefficients_are_those_of_the_standard() {
        let sample = |i: usize| ((i * i * 37 + i * 11) % 256) as f32 - 128.0;
        let mut values: [f32; COUNT] = std::array::from_fn(sample);
        to_cosines(&mut values);
        for (k, &value) in values.iter().enumerate() {
            let basis = |at: usize, frequency: usize| ((2 * at + 1) as f64 * frequency as f64 * PI / 16.0).cos();
            let scale = |frequency: usize| if frequency == 0 { 0.5_f64.sqrt() } else { 1.0 };
            let (v, u) = (k / SIDE, k % SIDE);
            let sum: f64 = (0..COUNT).map(|i| f64::from(sample(i)) * basis(i % SIDE, u) * basis(i / SIDE, v)).sum();
            let coefficient = 0.25 * scale(u) * scale(v) * sum;
            assert!((f64::from(value) - coefficient).abs() < 1e-3, "{k}: {value} {coefficient}");
        }
    }
}
