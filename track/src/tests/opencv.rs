//! The mask and the contour's centroid against what OpenCV made of the same images, kept in a file.
//!
//! The images follow from integer arithmetic, here and in `benches/marker_frozen.py`, which made the file:
//! `python3 benches/marker_frozen.py > track/src/tests/opencv.json`.

use image::{Rgb, RgbImage};
use serde::Deserialize;

use crate::colour::MarkerColour;
use crate::marker::{Blobs, Region};

#[derive(Debug, Deserialize)]
struct Case {
    width: u32,
    height: u32,
    seed: u32,
    hue_deg: [f64; 2],
    min_saturation: f64,
    min_value: f64,
    region: [u32; 4],
    /// White pixels of the thresholded image and FNV-1a of its bytes, row by row, and the same after the clean-up.
    threshold: [u64; 2],
    clean: [u64; 2],
    /// Centroids of the outer contours that enclose an area, in the image, by the bits of the numbers.
    contours: Vec<[u64; 2]>,
}

/// A disc of the marker's colour, shaded, before bands of other colours, with noise.
fn picture(width: u32, height: u32, seed: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let [x, y] = [x, y].map(i64::from);
        let mut state = (seed as u64) ^ ((x as u64) << 32 | y as u64);
        let mut noise = || {
            // SplitMix64.
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            (z ^ (z >> 31)) >> 33
        };
        let (cx, cy, r) = (i64::from(width) * 11 / 20, i64::from(height) * 9 / 20, i64::from(width.min(height)) / 5);
        let (dx, dy) = (x - cx, y - cy);
        let base = if dx * dx + dy * dy <= r * r {
            let shade = 100 - 40 * (dx + dy) / (2 * r + 1);
            [40, 190, 30].map(|v| v * shade / 100)
        } else {
            let band = (x / 23 + 2 * (y / 17)) % 7;
            [[110, 100, 90], [60, 90, 70], [150, 150, 155], [90, 130, 80], [30, 30, 35], [70, 120, 60], [200, 190, 170]][band as usize]
        };
        Rgb(base.map(|v: i64| (v + (noise() % 41) as i64 - 20).clamp(0, 255) as u8))
    })
}

fn digest(mask: &crate::bits::Bits) -> [u64; 2] {
    let (mut white, mut hash) = (0, 0xCBF2_9CE4_8422_2325_u64);
    for (x, y) in (0..mask.height() as i32).flat_map(|y| (0..mask.width() as i32).map(move |x| (x, y))) {
        let byte = if mask.get(x, y) { 255 } else { 0 };
        white += byte / 255;
        hash = (hash ^ byte).wrapping_mul(0x0100_0000_01B3);
    }
    [white, hash]
}

#[test]
fn mask_and_centroid_are_opencvs_to_the_last_digit() {
    let cases: Vec<Case> = serde_json::from_str(include_str!("opencv.json")).unwrap();
    assert!(cases.len() >= 8);
    for case in cases {
        let image = picture(case.width, case.height, case.seed);
        let colour = MarkerColour { hue_deg: case.hue_deg, min_saturation: case.min_saturation, min_value: case.min_value };
        let [x, y, width, height] = case.region;
        let region = Region { x, y, width, height };
        let mask = colour.mask(&image, region);
        assert_eq!(digest(&mask), case.threshold, "threshold of {case:?}");
        assert_eq!(digest(&mask.clean()), case.clean, "clean-up of {case:?}");
        let blobs = Blobs::find(&image, Some(region), &colour);
        let mut contours: Vec<[u64; 2]> =
            blobs.found.iter().map(|blob| [blob.contour_px.x.to_bits(), blob.contour_px.y.to_bits()]).collect();
        contours.sort_unstable();
        assert_eq!(contours, case.contours, "contours of {case:?}");
    }
}
