//! Part of a JPEG image, decoded without the pixels around it.
//!
//! A tracker looks at a tenth of a camera's image. The bits of the rows above must be read, as none says where it ends; but the cosine
//! transforms, the interpolation of chroma and the conversion of colours are needed for the part alone, and nothing below it. libjpeg-turbo leaves
//! them out (`jpeg_skip_scanlines`, `jpeg_crop_scanline`); decoders in Rust do not so far. It is a library in C: what calls it is in this crate, the
//! only one of the workspace with unsafe code, and nothing else is.
//!
//! Whatever libjpeg-turbo objects to, be it a file that is cut off or damaged or one that only warns, is left to the decoder of whole images, which
//! says what is wrong.

mod libjpeg;

use std::ops::Range;

use image::RgbImage;

use libjpeg::Decoder;

/// Corners are multiples of this many pixels, so that blocks of 8 x 8 samples, of two pixels each way or of one, begin there too.
const UNIT: u32 = 16;
/// Pixels beside a part on which those at its edge depend, as chroma is interpolated.
const FRINGE: u32 = 2;

/// Some of an image's pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// The pixels.
    pub image: RgbImage,
    /// Column and row of the first of them in the image.
    pub corner: [u32; 2],
}

impl Part {
    /// All of an image.
    #[must_use]
    pub const fn whole(image: RgbImage) -> Self {
        Self { image, corner: [0; 2] }
    }
}

/// Decodes the pixels in `columns` and `rows` that lie in the image, and some around them, from a corner in multiples of 16.
///
/// `None` where none does, and where libjpeg-turbo has any objection to the file as far as it is read.
#[must_use]
pub fn decode_part(bytes: &[u8], columns: Range<u32>, rows: Range<u32>) -> Option<Part> {
    libjpeg::catch(|| {
        let mut decoder = Decoder::start(bytes)?;
        let [width, height] = decoder.size();
        let (columns, rows) = (wider(columns, width)?, wider(rows, height)?);
        let columns = decoder.crop(columns);
        decoder.skip(rows.start);
        let size = [columns.len(), rows.len()];
        let mut pixels = vec![0; 3 * size[0] * size[1]];
        for row in pixels.chunks_exact_mut(3 * size[0]) {
            decoder.read(row)?;
        }
        let image = RgbImage::from_raw(columns.end - columns.start, rows.end - rows.start, pixels)?;
        Some(Part { image, corner: [columns.start, rows.start] })
    })
}

/// From a multiple of [`UNIT`] to where the range's last pixel no longer depends on what follows; `None` where nothing is in the image.
fn wider(range: Range<u32>, size: u32) -> Option<Range<u32>> {
    let start = range.start.saturating_sub(FRINGE) / UNIT * UNIT;
    let end = range.end.saturating_add(FRINGE).min(size);
    (range.start < range.end.min(size)).then_some(start..end)
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    use proptest::prelude::*;

    use super::*;

    const SAMPLINGS: [SamplingFactor; 5] =
        [SamplingFactor::F_1_1, SamplingFactor::F_2_1, SamplingFactor::F_1_2, SamplingFactor::F_2_2, SamplingFactor::F_4_1];
    const SIZE: [u32; 2] = [210, 150];

    fn picture(sampling: SamplingFactor, change: impl FnOnce(&mut Encoder<&mut Vec<u8>>)) -> Vec<u8> {
        let [width, height] = SIZE;
        let colour = |x: u32, y: u32| Rgb([(90 + x / 3 + y % 7) as u8, (60 + (x / 9 + y / 11) % 2 * 90) as u8, (200 - y) as u8]);
        let image = RgbImage::from_fn(width, height, colour);
        let mut jpeg = Vec::new();
        let mut encoder = Encoder::new(&mut jpeg, 90);
        encoder.set_sampling_factor(sampling);
        change(&mut encoder);
        encoder.encode(image.as_raw(), width as u16, height as u16, ColorType::Rgb).unwrap();
        jpeg
    }

    fn all(bytes: &[u8]) -> Option<Part> {
        decode_part(bytes, 0..u32::MAX, 0..u32::MAX)
    }

    #[test]
    fn the_whole_is_what_another_decoder_makes_of_it() {
        for sampling in SAMPLINGS {
            let jpeg = picture(sampling, |_| {});
            let other = image::load_from_memory(&jpeg).unwrap().into_rgb8();
            let Part { image, corner } = all(&jpeg).unwrap();
            assert_eq!((image.dimensions(), corner), (other.dimensions(), [0, 0]));
            let off = image.iter().zip(other.iter()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(off <= Some(4), "{sampling:?}: {off:?}");
        }
    }

    #[test]
    fn a_grey_file_is_grey_and_one_for_printers_is_left() {
        let file = |colour: ColorType, bytes: usize| {
            let mut jpeg = Vec::new();
            Encoder::new(&mut jpeg, 90).encode(&vec![77; 32 * 32 * bytes], 32, 32, colour).unwrap();
            jpeg
        };
        let part = decode_part(&file(ColorType::Luma, 1), 20..22, 20..22).unwrap();
        assert!(part.corner == [16, 16] && part.image.pixels().all(|p| *p == Rgb([77; 3])), "{part:?}");
        assert_eq!(decode_part(&file(ColorType::Cmyk, 4), 20..22, 20..22), None);
    }

    #[test]
    fn a_file_that_is_cut_off_within_the_rows_is_left() {
        let jpeg = picture(SamplingFactor::F_2_2, |_| {});
        let cut = &jpeg[..jpeg.len() / 2];
        assert!(decode_part(cut, 20..40, 10..20).is_some() && decode_part(cut, 20..40, 120..140).is_none());
    }

    proptest! {
        #[test]
        fn a_part_is_that_of_the_whole(
            sampling in prop::sample::select(SAMPLINGS.to_vec()),
            restarts in prop::sample::select(vec![0_u16, 7]),
            progressive: bool,
            x in 0..SIZE[0] + 9,
            y in 0..SIZE[1] + 9,
            width in 0..90_u32,
            height in 0..90_u32,
        ) {
            let jpeg = picture(sampling, |encoder| {
                encoder.set_restart_interval(restarts);
                encoder.set_progressive(progressive);
            });
            let whole = all(&jpeg).unwrap().image;
            let [right, bottom] = [(x + width).min(SIZE[0]), (y + height).min(SIZE[1])];
            let part = decode_part(&jpeg, x..x + width, y..y + height);
            prop_assert_eq!(part.is_some(), x < right && y < bottom);
            let Some(Part { image, corner }) = part else { return Ok(()) };
            prop_assert!(corner.iter().all(|c| c % UNIT == 0) && corner[0] <= x && corner[1] <= y);
            prop_assert!(image.width() <= right - x + 16 + 32 && image.height() <= bottom - y + 16 + 4);
            for (u, v) in (x..right).flat_map(|u| (y..bottom).map(move |v| (u, v))) {
                prop_assert_eq!(image.get_pixel(u - corner[0], v - corner[1]), whole.get_pixel(u, v), "{} {}", u, v);
            }
        }

        #[test]
        fn no_bytes_are_too_odd(
            junk in prop::collection::vec(any::<u8>(), 0..300),
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
            sampling in prop::sample::select(SAMPLINGS.to_vec()),
            progressive: bool,
        ) {
            let _ = decode_part(&junk, 0..9, 0..9);
            let _ = decode_part(&[&[0xff, 0xd8, 0xff, 0xc0], junk.as_slice()].concat(), 0..9, 0..9);
            let mut jpeg = picture(sampling, |encoder| encoder.set_progressive(progressive));
            for (at, byte) in changes {
                let at = at.index(jpeg.len());
                jpeg[at] = byte;
            }
            let _ = decode_part(&jpeg, 30..60, 70..90);
            let _ = all(&jpeg);
        }
    }
}
