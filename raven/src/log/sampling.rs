//! How a JPEG file holds colour: of how many pixels a sample of chroma is the mean, and to what steps the spectrum of blocks was rounded.
//!
//! Luma and chroma are samples, of a pixel or of the mean of some; 8 x 8 of them go through the discrete cosine transform (ITU-R T.81, A.3.3),
//! which as it stands there is orthonormal, and each coefficient is rounded to a multiple of its own step. The frame header names the
//! samplings and tables of the components,
//!
//! ```text
//! FF C0 length(2) precision(1) height(2) width(2) components(1) [id(1) horizontal and vertical(1) table(1)] ...
//! ```
//!
//! and `FF DB length(2) [precision and table(1) steps(64 or 128)] ...` holds the tables, in a zigzag from the lowest frequency.

use super::jpeg::{SCAN, Segments};
use super::{CameraFrame, FrameData};

const TABLES: u8 = 0xdb;
/// The segment in which Adobe's programs say whether there is luma and chroma.
const ADOBE: u8 = 0xee;
/// Place of each coefficient of the zigzag in a block that is written row by row.
const ZIGZAG: [usize; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21, 28, 35, 42, 49, 56,
    57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// Steps of the 64 coefficients of a block, grey levels; rows are vertical frequencies.
pub type Steps = [f32; 64];

/// How a JPEG file in luma and chroma holds them.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampling {
    /// Columns and rows of pixels of which a sample of chroma is the mean: 1 or 2. `[2, 2]` is known as 4:2:0, `[2, 1]` as 4:2:2.
    pub pixels: [u32; 2],
    /// Steps of luma (Y), of Cb and of Cr.
    pub steps: [Steps; 3],
}

impl Sampling {
    /// By a file's header; `None` of what is no JPEG of one luma and two chromas, or where chroma is sampled otherwise.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let mut tables: [Option<Steps>; 4] = [None; 4];
        let mut components = None;
        for segment in Segments::of(bytes) {
            match segment.marker {
                TABLES => add_tables(&mut tables, segment.content)?,
                ADOBE if segment.content.starts_with(b"Adobe") && segment.content.get(11) != Some(&1) => return None,
                SCAN => break,
                _ if segment.is_frame() => {
                    let [3, described @ ..] = segment.content.get(5..)? else { return None };
                    components = Some(*described.as_chunks::<3>().0.first_chunk::<3>()?);
                }
                _ => {}
            }
        }
        let components = components?;
        let [luma, cb, cr] = components.map(|[_, factors, _]| [u32::from(factors >> 4), u32::from(factors & 15)]);
        let pixels = [luma[0].checked_div(cb[0])?, luma[1].checked_div(cb[1])?];
        let whole = (0..2).all(|axis| pixels[axis] * cb[axis] == luma[axis] && (1..=2).contains(&pixels[axis]));
        let [y, b, r] = components.map(|[_, _, table]| tables.get(usize::from(table)).copied().flatten());
        (whole && cb == cr && components.map(|[id, ..]| id) != *b"RGB").then_some(Self { pixels, steps: [y?, b?, r?] })
    }
}

impl CameraFrame {
    /// How the frame holds its colour, where it is a JPEG in luma and chroma.
    #[must_use]
    pub fn sampling(&self) -> Option<Sampling> {
        match &self.data {
            FrameData::Jpeg(bytes) => Sampling::of(bytes),
            FrameData::Raw { .. } => None,
        }
    }
}

/// Reads a segment of tables; `None` where it is cut off.
fn add_tables(tables: &mut [Option<Steps>; 4], mut content: &[u8]) -> Option<()> {
    while let [kind, rest @ ..] = content {
        let bytes = if kind >> 4 == 0 { 64 } else { 128 };
        let (table, rest) = rest.split_at_checked(bytes)?;
        let mut steps = [0.0; 64];
        for (&place, step) in ZIGZAG.iter().zip(table.chunks_exact(bytes / 64)) {
            steps[place] = step.iter().fold(0.0, |step, &byte| 256.0 * step + f32::from(byte));
        }
        *tables.get_mut(usize::from(kind & 15))? = Some(steps);
        content = rest;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use jpeg_encoder::{ColorType, Encoder, QuantizationTableType, SamplingFactor};
    use proptest::prelude::*;

    use super::*;

    fn file(colour: ColorType, change: impl FnOnce(&mut Encoder<&mut Vec<u8>>)) -> Vec<u8> {
        let mut jpeg = Vec::new();
        let mut encoder = Encoder::new(&mut jpeg, 90);
        change(&mut encoder);
        let bytes = match colour {
            ColorType::Luma => 1,
            ColorType::Rgb => 3,
            _ => 4,
        };
        encoder.encode(&vec![77; 32 * 32 * bytes], 32, 32, colour).unwrap();
        jpeg
    }

    #[test]
    fn the_encoders_choices_are_read() {
        let table = |offset: u16| QuantizationTableType::Custom(Box::new(std::array::from_fn(|i| offset + i as u16)));
        for (factor, pixels) in [
            (SamplingFactor::F_1_1, [1, 1]),
            (SamplingFactor::F_2_1, [2, 1]),
            (SamplingFactor::F_1_2, [1, 2]),
            (SamplingFactor::F_2_2, [2, 2]),
        ] {
            let jpeg = file(ColorType::Rgb, |encoder| {
                encoder.set_sampling_factor(factor);
                encoder.set_quantization_tables(table(1), table(101));
            });
            let sampling = Sampling::of(&jpeg).unwrap();
            assert_eq!(sampling.pixels, pixels);
            // The encoder takes its tables row by row, at quality 100 as they are and else scaled.
            let of = |plane: usize| sampling.steps[plane].to_vec();
            assert!(of(0).windows(2).all(|w| w[0] <= w[1]) && of(1) == of(2) && of(1) > of(0), "{:?}", of(0));
        }
    }

    #[test]
    fn what_holds_no_luma_and_chroma_is_left() {
        let four_columns = file(ColorType::Rgb, |encoder| encoder.set_sampling_factor(SamplingFactor::F_4_1));
        for jpeg in [file(ColorType::Luma, |_| {}), file(ColorType::Cmyk, |_| {}), four_columns, b"GIF89a".to_vec()] {
            assert_eq!(Sampling::of(&jpeg), None);
        }
    }

    proptest! {
        #[test]
        fn no_bytes_are_too_odd(junk in prop::collection::vec(any::<u8>(), 0..300), marker in prop::sample::select(vec![0xdb_u8, 0xc0, 0xee])) {
            let _ = Sampling::of(&junk);
            let _ = Sampling::of(&[&[0xff, 0xd8, 0xff, marker], junk.as_slice()].concat());
        }
    }
}
