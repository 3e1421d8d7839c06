//! Parts of frames against whole frames by another decoder.

use image::{Rgb, RgbImage};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use proptest::prelude::*;

use super::*;

fn picture(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let (u, v) = (f64::from(x), f64::from(y));
        let disc = (u - 40.0).hypot(v - 30.0) < 14.0;
        let wave = (70.0 + 40.0 * (u / 5.0).sin() * (v / 9.0).cos()) as u8;
        if disc { Rgb([40, 190, 30]) } else { Rgb([wave + 20, wave, 255 - wave]) }
    })
}

fn jpeg(image: &RgbImage, sampling: SamplingFactor, restart: Option<u16>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 88);
    encoder.set_sampling_factor(sampling);
    if let Some(interval) = restart {
        encoder.set_restart_interval(interval);
    }
    encoder.encode(image.as_raw(), image.width() as u16, image.height() as u16, ColorType::Rgb).unwrap();
    bytes
}

/// Largest difference to the other decoder within a part.
fn difference(bytes: &[u8], part: &Part) -> u8 {
    let whole = image::load_from_memory(bytes).unwrap().into_rgb8();
    let have = decode(bytes, part).expect("an ordinary JPEG");
    assert_eq!(have.dimensions(), whole.dimensions());
    let places = part.rows.clone().flat_map(|y| part.columns.clone().map(move |x| (x, y)));
    let inside = places.filter(|(x, y)| *x < whole.width() && *y < whole.height());
    inside.flat_map(|(x, y)| (0..3).map(move |c| (x, y, c))).map(|(x, y, c)| have[(x, y)][c].abs_diff(whole[(x, y)][c])).max().unwrap_or(0)
}

proptest! {
    #[test]
    fn a_part_is_what_the_whole_frame_has_there(
        width in 17_u32..150, height in 17_u32..100, x in 0_u32..150, y in 0_u32..100, w in 1_u32..90, h in 1_u32..90,
        sampling in 0_usize..3, restart in prop::option::of(1_u16..5),
    ) {
        let sampling = [SamplingFactor::F_1_1, SamplingFactor::F_2_1, SamplingFactor::F_2_2][sampling];
        let bytes = jpeg(&picture(width, height), sampling, restart);
        let part = Part { columns: x..x + w, rows: y..y + h };
        // The decoders interpolate chroma alike but round differently, by which green differs by 3 at most.
        prop_assert!(difference(&bytes, &part) <= 4, "{}", difference(&bytes, &part));
    }

    #[test]
    fn damage_does_no_harm(cut in 0_usize..4000, at in 0_usize..4000, byte: u8) {
        let mut bytes = jpeg(&picture(90, 70), SamplingFactor::F_2_1, None);
        bytes.truncate(cut.max(2));
        if let Some(hit) = bytes.get_mut(at) {
            *hit = byte;
        }
        let _ = decode(&bytes, &Part { columns: 20..60, rows: 10..50 });
    }
}
