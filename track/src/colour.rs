//! Which pixels have the marker's colour: a threshold in hue, saturation and value.
//!
//! Hue, saturation and value are OpenCV's 8-bit ones (`COLOR_RGB2HSV`), in the same fixed-point arithmetic with 12 fractional bits, so
//! that a mask made here is the mask that OpenCV makes:
//!
//! ```text
//! V = max(R, G, B)      S = 255 (V - min) / V      H = 30 (G - B) / (V - min)  where V = R, and so on by thirds of the circle, 0..179
//! ```
//!
//! Few pixels of an image have the colour. [`crate::sieve`] finds those that may, without division; only they are converted.

use image::{Rgb, RgbImage};

use crate::bits::Bits;
use crate::marker::Region;
use crate::sieve::Sieve;

/// The marker's colour as ranges, bounds included.
///
/// The default is a saturated green, hue 90 to 150 deg, saturation at least 0.45, value at least 0.15. Foliage, cloth and metal under
/// white light stay below 0.35 of saturation; the lower bound lets the shaded side of a sphere and moderate motion blur through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerColour {
    /// From and to, on the circle of 360 deg [deg]: 90 to 150 is green, 340 to 20 is red.
    pub hue_deg: [f64; 2],
    /// Least saturation, 0 to 1.
    pub min_saturation: f64,
    /// Least value, 0 to 1.
    pub min_value: f64,
}

impl Default for MarkerColour {
    fn default() -> Self {
        Self { hue_deg: [90.0, 150.0], min_saturation: 0.45, min_value: 0.15 }
    }
}

/// Hue 0 to 179 (half degrees), saturation and value 0 to 255 of one pixel.
#[must_use]
pub fn hsv(Rgb([red, green, blue]): Rgb<u8>) -> [u8; 3] {
    let [r, g, b] = [red, green, blue].map(i32::from);
    let value = r.max(g).max(b);
    let range = value - r.min(g).min(b);
    let saturation = (range * SATURATION[value as usize] + HALF) >> SHIFT;
    let sixths = if value == r {
        g - b
    } else if value == g {
        b - r + 2 * range
    } else {
        r - g + 4 * range
    };
    let hue = (sixths * HUE[range as usize] + HALF) >> SHIFT;
    let hue = if hue < 0 { hue + 180 } else { hue };
    [hue as u8, saturation as u8, value as u8]
}

const SHIFT: i32 = 12;
const HALF: i32 = 1 << (SHIFT - 1);
const SATURATION: [i32; 256] = reciprocals(255 << SHIFT);
const HUE: [i32; 256] = reciprocals(30 << SHIFT);

/// `numerator / i`, rounded; 0 for 0.
const fn reciprocals(numerator: i32) -> [i32; 256] {
    let mut table = [0; 256];
    let mut i = 1;
    while i < 256 {
        table[i] = (2 * numerator + i as i32) / (2 * i as i32);
        i += 1;
    }
    table
}

impl MarkerColour {
    /// The ranges in OpenCV's units, `[hue from, hue to, saturation, value]`, as its `inRange` takes them (hue 90 to 150 deg is 45 to 75).
    #[must_use]
    pub fn opencv_bounds(&self) -> [u8; 4] {
        let [from, to] = self.hue_deg;
        let hue = |degrees: f64| ((degrees / 2.0).round().rem_euclid(180.0)) as u8;
        // A range that ends at the full circle does not begin again.
        let up_to = if from <= to { to.min(358.0) } else { to };
        let [low, high] = if to - from >= 359.0 { [0, 179] } else { [hue(from), hue(up_to)] };
        let share = |part: f64| (part.clamp(0.0, 1.0) * 255.0).round() as u8;
        [low, high, share(self.min_saturation), share(self.min_value)]
    }

    /// White where a pixel of `image` within `region` has the colour, black elsewhere; as large as the region.
    ///
    /// The region must lie in the image: see [`Region::clipped`].
    #[must_use]
    pub fn mask(&self, image: &RgbImage, region: Region) -> Bits {
        let mut mask = Bits::black(region.width as usize, region.height as usize);
        let columns = 3 * region.x as usize..3 * (region.x + region.width) as usize;
        let rows = image.as_raw().chunks_exact(3 * image.width() as usize).skip(region.y as usize);
        let rows = rows.filter_map(|row| row.get(columns.clone()));
        let bounds = self.opencv_bounds();
        Sieve::new(bounds).rows(rows.zip(mask.rows_mut()), |pixel| is_within(Rgb(pixel), bounds));
        mask
    }
}

/// Whether a hue is within a range on the circle, bounds included.
pub fn is_between<T: PartialOrd>(hue: T, [from, to]: [T; 2]) -> bool {
    if from <= to { (from..=to).contains(&hue) } else { hue >= from || hue <= to }
}

fn is_within(pixel: Rgb<u8>, [from, to, min_saturation, min_value]: [u8; 4]) -> bool {
    let [hue, saturation, value] = hsv(pixel);
    is_between(hue, [from, to]) && saturation >= min_saturation && value >= min_value
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn hsv_of_known_colours() {
        // Values as OpenCV 5.0 converts them.
        for (rgb, expected) in [
            ([255, 0, 0], [0, 255, 255]),
            ([0, 255, 0], [60, 255, 255]),
            ([0, 0, 255], [120, 255, 255]),
            ([10, 20, 30], [105, 170, 30]),
            ([255, 0, 1], [0, 255, 255]),
            ([200, 20, 60], [173, 229, 200]),
            ([1, 2, 2], [90, 128, 2]),
        ] {
            assert_eq!(hsv(Rgb(rgb)), expected, "{rgb:?}");
        }
    }

    #[test]
    fn a_range_over_zero_is_red() {
        let red = MarkerColour { hue_deg: [340.0, 20.0], ..MarkerColour::default() };
        let image = RgbImage::from_fn(3, 1, |x, _| Rgb([[200, 20, 60], [200, 60, 20], [20, 200, 20]][x as usize]));
        let mask = red.mask(&image, Region { x: 0, y: 0, width: 3, height: 1 });
        assert_eq!(mask.row(0), &[0b011]);
    }

    proptest! {
        /// All colours on a grid that holds the extremes, in a row of several words and some more.
        #[test]
        fn the_sieve_loses_nothing(from in 0_u32..=360, width in 1_u32..=360, saturation in 0_u32..=100, value in 0_u32..=100, phase in 0_u32..15) {
            let share = |percent: u32| f64::from(percent) / 100.0;
            let hue_deg = [f64::from(from), f64::from((from + width) % 361)];
            let colour = MarkerColour { hue_deg, min_saturation: share(saturation), min_value: share(value) };
            let level = |i: u32| if i == 17 { 255 } else { (15 * i + phase) as u8 };
            let image = RgbImage::from_fn(18 * 18, 18, |x, y| Rgb([level(x % 18), level(x / 18), level(y)]));
            let region = Region { x: 3, y: 1, width: 18 * 18 - 5, height: 16 };
            let mask = colour.mask(&image, region);
            for (x, y) in (0..region.height).flat_map(|y| (0..region.width).map(move |x| (x, y))) {
                let pixel = *image.get_pixel(region.x + x, region.y + y);
                prop_assert_eq!(mask.get(x as i32, y as i32), is_within(pixel, colour.opencv_bounds()), "{:?} {:?}", pixel, colour);
            }
        }
    }
}
