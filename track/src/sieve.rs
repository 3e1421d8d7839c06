//! Which pixels may have a colour: necessary conditions by sums, products and comparisons of 16-bit integers, many pixels at a time.
//!
//! With `v` the largest of a pixel's values, `r` the largest minus the smallest, and `h` its place on the hexagon of hues times `r` (six
//! sides, `h = G - B` where red is largest, and so on), a pixel of saturation `s` at least and hue `from` to `to`, both of OpenCV's 8 bits, has
//!
//! ```text
//! 128 r >= v K_s,   40 h >= r K_from,   40 h <= r K_to
//! ```
//!
//! The three constants are rounded so that what OpenCV's fixed-point arithmetic rounds into the range passes as well. A few pixels too many
//! pass: the caller decides on those that do.

use std::sync::LazyLock;

use fearless_simd::{Level, Simd, dispatch};

/// Pixels that are tried at a time, as many as a word of a mask holds.
const WORD: usize = 64;
/// By how much OpenCV's 8-bit saturation and hue may differ from the exact ones: half a unit, and what a reciprocal rounded to 12 bits does.
const SATURATION_ROUNDING: f64 = 0.5 + 255.0 * 0.5 / 4096.0;
const HUE_ROUNDING: f64 = 0.5 + 5.0 * 255.0 * 0.5 / 4096.0;

/// The processor's vector instructions, looked up once.
pub(crate) static LEVEL: LazyLock<Level> = LazyLock::new(Level::new);

/// Conditions on a pixel, as integers.
#[derive(Debug, Clone, Copy)]
pub struct Sieve {
    min_value: u16,
    saturation: u16,
    from: u16,
    to: u16,
    /// Whether the range holds red, where the circle of hues begins and ends.
    over_red: bool,
}

impl Sieve {
    /// For `[hue from, hue to, saturation, value]` in OpenCV's units, bounds included.
    #[must_use]
    pub fn new([from, to, saturation, value]: [u8; 4]) -> Self {
        let (low, high) = (f64::from(from) - HUE_ROUNDING, f64::from(to) + HUE_ROUNDING);
        let whole_circle = (f64::from(to) - f64::from(from)).rem_euclid(180.0) + 2.0 * HUE_ROUNDING >= 180.0;
        let (low, high) = if whole_circle { (0.0, 180.0) } else { (low.rem_euclid(180.0), high.rem_euclid(180.0)) };
        Self {
            min_value: value.into(),
            saturation: ((f64::from(saturation) - SATURATION_ROUNDING).max(0.0) * 128.0 / 255.0).floor() as u16,
            from: (40.0 * low / 30.0).floor() as u16,
            to: (40.0 * high / 30.0).ceil() as u16,
            over_red: low > high,
        }
    }

    /// Sets the bits of a mask's rows, black so far, where the pixels of an image's rows pass and `is` says yes.
    pub fn rows<'a>(&self, rows: impl Iterator<Item = (&'a [u8], &'a mut [u64])>, is: impl Fn([u8; 3]) -> bool) {
        let level = *LEVEL;
        for (row, words) in rows {
            dispatch!(level, simd => row_passes(simd, self, row, words));
            for (word, pixels) in words.iter_mut().zip(row.as_chunks().0.chunks(WORD)) {
                let mut passed = *word;
                while passed != 0 {
                    let lowest = passed & passed.wrapping_neg();
                    passed ^= lowest;
                    if !pixels.get(lowest.trailing_zeros() as usize).is_some_and(|&pixel| is(pixel)) {
                        *word ^= lowest;
                    }
                }
            }
        }
    }

    /// Whether one pixel passes, as 1 or 0. Without branches, so that the compiler does many at a time.
    #[inline(always)]
    fn passes(&self, [red, green, blue]: [u8; 3]) -> u8 {
        let value = red.max(green).max(blue);
        let [r, g, b] = [red, green, blue].map(i16::from);
        let range = i16::from(value - red.min(green).min(blue));
        let side = if value == red {
            // Hues just below red are at the far end of the circle.
            g - b + if green < blue { 6 * range } else { 0 }
        } else if value == green {
            b - r + 2 * range
        } else {
            r - g + 4 * range
        };
        let (place, range, value) = (40 * side as u16, range as u16, u16::from(value));
        let (after, before) = (place >= range * self.from, place <= range * self.to);
        let hue = if self.over_red { after | before } else { after & before };
        u8::from(hue & (128 * range >= value * self.saturation) & (value >= self.min_value))
    }
}

/// Bits of a row's pixels that pass.
#[inline(always)]
fn row_passes<S: Simd>(_: S, sieve: &Sieve, row: &[u8], words: &mut [u64]) {
    let (blocks, rest) = row.as_chunks::<{ 3 * WORD }>();
    for (word, block) in words.iter_mut().zip(blocks) {
        *word = word_passes(sieve, block);
    }
    if let Some(word) = words.get_mut(blocks.len()).filter(|_| !rest.is_empty()) {
        let mut block = [0; 3 * WORD];
        for (to, from) in block.iter_mut().zip(rest) {
            *to = *from;
        }
        *word = word_passes(sieve, &block) & ((1 << (rest.len() / 3)) - 1);
    }
}

#[inline(always)]
fn word_passes(sieve: &Sieve, block: &[u8; 3 * WORD]) -> u64 {
    // A plane for each colour first: one loop that does both is not done many at a time.
    let [mut reds, mut greens, mut blues] = [[0; WORD]; 3];
    for (((red, green), blue), &[r, g, b]) in reds.iter_mut().zip(&mut greens).zip(&mut blues).zip(block.as_chunks().0) {
        (*red, *green, *blue) = (r, g, b);
    }
    let mut passed = [0; WORD];
    for (((passed, &red), &green), &blue) in passed.iter_mut().zip(&reds).zip(&greens).zip(&blues) {
        *passed = sieve.passes([red, green, blue]);
    }
    let mut word = 0;
    for (i, eight) in passed.as_chunks().0.iter().enumerate() {
        // Gathers the lowest bits of eight bytes in the highest byte.
        word |= (u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * i);
    }
    word
}
