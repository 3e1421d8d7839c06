//! From coefficients to pixels: inverse cosine transform, chroma brought to full resolution, RGB.
//!
//! All in the integer arithmetic that the Independent JPEG Group's library has by default, so that pixels are the ones that OpenCV, ROS and
//! browsers see: the transform of Loeffler, Ligtenberg and Moschytz (1989) with 13 fractional bits, linear interpolation of chroma between its
//! samples' centres, BT.601 over the full range.

use fearless_simd::{Simd, SimdInto, i32x8};

/// Fractional bits of the transform's constants, and those that its first pass keeps.
const CONSTANT_BITS: u32 = 13;
const PASS_BITS: u32 = 2;

/// Cosines of the transform in fixed point.
const fn fixed(value: f64) -> i32 {
    (value * (1 << CONSTANT_BITS) as f64 + if value < 0.0 { -0.5 } else { 0.5 }) as i32
}

type Lanes = [i32; 8];

/// Values of a block of 8x8 from its coefficients, 0 to 255 row by row.
#[inline(always)]
pub(super) fn inverse_cosine<S: Simd>(simd: S, block: &[i32; 64]) -> [u8; 64] {
    if block[1..].iter().fold(0, |any, value| any | value) == 0 {
        return [(((block[0] + 4) >> 3) + 128).clamp(0, 255) as u8; 64];
    }
    let mut lines = [[0; 8]; 8];
    for (line, row) in lines.iter_mut().zip(block.as_chunks::<8>().0) {
        *line = *row;
    }
    let columns_done = eight(simd, lines, CONSTANT_BITS - PASS_BITS);
    let both_done = transposed(eight(simd, transposed(columns_done), CONSTANT_BITS + PASS_BITS + 3));
    let mut out = [0; 64];
    for (out, value) in out.iter_mut().zip(both_done.as_flattened()) {
        *out = (value + 128).clamp(0, 255) as u8;
    }
    out
}

#[inline(always)]
fn transposed(lines: [Lanes; 8]) -> [Lanes; 8] {
    std::array::from_fn(|i| std::array::from_fn(|j| lines[j][i]))
}

/// Eight transforms of eight values side by side, shifted down and rounded.
#[inline(always)]
fn eight<S: Simd>(simd: S, lines: [Lanes; 8], shift: u32) -> [Lanes; 8] {
    let [c0, c1, c2, c3, c4, c5, c6, c7]: [i32x8<S>; 8] = lines.map(|line| line.simd_into(simd));
    // Even part.
    let turned = (c2 + c6) * fixed(0.541_196_100);
    let (low, high) = (turned - c6 * fixed(1.847_759_065), turned + c2 * fixed(0.765_366_865));
    let (sum, difference) = ((c0 + c4) << CONSTANT_BITS, (c0 - c4) << CONSTANT_BITS);
    let half = 1 << (shift - 1);
    let even = [sum + high, difference + low, difference - low, sum - high].map(|value| value + half);
    // Odd part.
    let five = (c7 + c3 + c5 + c1) * fixed(1.175_875_602);
    let (outer, inner) = ((c7 + c1) * fixed(-0.899_976_223), (c5 + c3) * fixed(-2.562_915_447));
    let (sevens, fives) = (five - (c7 + c3) * fixed(1.961_570_560), five - (c5 + c1) * fixed(0.390_180_644));
    let odd = [
        c1 * fixed(1.501_321_110) + outer + fives,
        c3 * fixed(3.072_711_026) + inner + sevens,
        c5 * fixed(2.053_119_869) + inner + fives,
        c7 * fixed(0.298_631_336) + outer + sevens,
    ];
    let mut out = [[0; 8]; 8];
    for i in 0..4 {
        out[i] = *((even[i] + odd[i]) >> shift);
        out[7 - i] = *((even[i] - odd[i]) >> shift);
    }
    out
}

/// A row of chroma at twice its resolution: three quarters of the nearer sample and one of the farther.
///
/// `weighted` is a row of samples times `1 << (bits - 2)`; rounding alternates between the two pixels of a sample.
#[inline(always)]
pub(super) fn double(weighted: &[i32], bits: u32, out: &mut Vec<u8>) {
    out.clear();
    out.resize(2 * weighted.len(), 0);
    let [first_up, second_up] = if bits == 2 { [1, 2] } else { [8, 7] };
    let mix = |here: i32, other: i32, up: i32| ((3 * here + other + up) >> bits) as u8;
    let (pairs, _) = out.as_chunks_mut::<2>();
    for (pair, [before, here, after]) in pairs.iter_mut().skip(1).zip(weighted.array_windows()) {
        *pair = [mix(*here, *before, first_up), mix(*here, *after, second_up)];
    }
    // At either end there is nothing beyond.
    if let ([first, ..], Some(here)) = (&mut *pairs, weighted.first()) {
        *first = [mix(*here, *here, first_up), mix(*here, *weighted.get(1).unwrap_or(here), second_up)];
    }
    if let ([.., last], [.., before, here]) = (pairs, weighted) {
        *last = [mix(*here, *before, first_up), mix(*here, *here, second_up)];
    }
}

/// Red, green and blue of luma and chroma.
#[inline(always)]
pub(super) fn rgb(luma: u8, blue: u8, red: u8) -> [u8; 3] {
    let (y, cb, cr) = (i32::from(luma), i32::from(blue) - 128, i32::from(red) - 128);
    // Factors 1.402, 0.34414, 0.71414 and 1.772 with 16 fractional bits.
    let half = 1 << 15;
    [y + ((91_881 * cr + half) >> 16), y + ((-22_554 * cb - 46_802 * cr + half) >> 16), y + ((116_130 * cb + half) >> 16)]
        .map(|value| value.clamp(0, 255) as u8)
}
