//! What can be told of a JPEG file without decoding it: whether its end is there, its size, and a shorter one that holds its upper rows.
//!
//! After the start `FF D8` follow segments `FF marker length ...`. The frame header (ITU-T T.81, B.2.2) holds
//!
//! ```text
//! FF C0 length(2) precision(1) height(2) width(2) components(1) ...
//! ```
//!
//! and the scan header `FF DA length(2) components(1) ...` is followed by the pixels. In a sequential file with one scan, as cameras send it,
//! these come from the top to the bottom, so that a decoder stops early where the header says that the image is lower.

/// Frame headers of sequential files: baseline and extended. Of the others, C4, C8 and CC are no frame headers.
const SEQUENTIAL: [u8; 2] = [0xc0, 0xc1];
const FRAMES: std::ops::RangeInclusive<u8> = 0xc0..=0xcf;
const NO_FRAMES: [u8; 3] = [0xc4, 0xc8, 0xcc];
pub(super) const SCAN: u8 = 0xda;
/// Rows decoded together are a multiple of this many, but for the rare samplings by four.
const UNIT: u32 = 16;
/// Rows above the end of an image whose chroma may lack what is below.
const FRINGE: u32 = 8;

/// Where the frame header is, and what it says.
struct Header {
    /// Place of the height's two bytes.
    height_at: usize,
    width: u16,
    height: u16,
    /// Whether all pixels come in one pass from the top to the bottom.
    in_one_pass: bool,
}

impl Header {
    fn of(bytes: &[u8]) -> Option<Self> {
        let mut header: Option<(Self, u8)> = None;
        for segment in Segments::of(bytes) {
            if segment.marker == SCAN {
                let (header, components) = header?;
                let all = segment.content.first() == Some(&components);
                return Some(Self { in_one_pass: header.in_one_pass && all, ..header });
            }
            if segment.is_frame() {
                let [_, h1, h0, w1, w0, components] = *segment.content.first_chunk()?;
                let (height, width) = (u16::from_be_bytes([h1, h0]), u16::from_be_bytes([w1, w0]));
                let in_one_pass = SEQUENTIAL.contains(&segment.marker);
                header = Some((Self { height_at: segment.at + 1, width, height, in_one_pass }, components));
            }
        }
        None
    }
}

/// One segment of a file.
pub(super) struct Segment<'a> {
    /// What it is.
    pub(super) marker: u8,
    /// Where its content begins in the file.
    at: usize,
    /// What follows its length.
    pub(super) content: &'a [u8],
}

impl Segment<'_> {
    /// Whether it is a frame header.
    pub(super) fn is_frame(&self) -> bool {
        FRAMES.contains(&self.marker) && !NO_FRAMES.contains(&self.marker)
    }
}

/// The segments of a file up to the first one that is not whole, the first scan's header the last that are headers.
pub(super) struct Segments<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Segments<'a> {
    /// Of a JPEG file; none of anything else.
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        Self { bytes, at: if bytes.starts_with(&[0xff, 0xd8]) { 2 } else { bytes.len() } }
    }
}

impl<'a> Iterator for Segments<'a> {
    type Item = Segment<'a>;

    fn next(&mut self) -> Option<Segment<'a>> {
        loop {
            let [0xff, marker, high, low] = *self.bytes.get(self.at..)?.first_chunk()? else { return None };
            if marker == 0xff {
                // Padding before a marker.
                self.at += 1;
                continue;
            }
            let length = usize::from(u16::from_be_bytes([high, low]));
            let (at, end) = (self.at + 4, self.at + 2 + length);
            self.at = end;
            return self.bytes.get(at..end).map(|content| Segment { marker, at, content });
        }
    }
}

/// Width and height [px] by the file's header; `None` of what is no JPEG.
pub(super) fn size(bytes: &[u8]) -> Option<(u32, u32)> {
    Header::of(bytes).map(|header| (header.width.into(), header.height.into()))
}

/// A file whose pixels are the file's upper ones, `rows` of them or a few more; `None` where it would be no lower, or its pixels come in
/// several passes.
pub(super) fn top(bytes: &[u8], rows: u32) -> Option<Vec<u8>> {
    let header = Header::of(bytes).filter(|header| header.in_one_pass)?;
    let height = rows.saturating_add(FRINGE).checked_next_multiple_of(UNIT)?;
    let height = u16::try_from(height).ok().filter(|&height| height < header.height)?;
    let mut top = bytes.to_vec();
    top.get_mut(header.height_at..)?.first_chunk_mut().map(|at: &mut [u8; 2]| *at = height.to_be_bytes())?;
    Some(top)
}

/// Whether the last bytes of a JPEG, zeros aside, are not its end marker.
#[must_use]
pub fn is_truncated_jpeg(bytes: &[u8]) -> bool {
    let is_jpeg = bytes.starts_with(&[0xff, 0xd8]);
    let end = bytes.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
    is_jpeg && !bytes.get(..end).is_some_and(|whole| whole.ends_with(&[0xff, 0xd9]))
}

#[cfg(test)]
mod tests {
    use image::{Rgb, RgbImage};
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn end_markers() {
        assert!(!is_truncated_jpeg(&[0xff, 0xd8, 1, 2, 0xff, 0xd9]));
        assert!(!is_truncated_jpeg(&[0xff, 0xd8, 1, 2, 0xff, 0xd9, 0, 0]));
        assert!(is_truncated_jpeg(&[0xff, 0xd8, 1, 2, 0xff]));
        assert!(is_truncated_jpeg(&[0xff, 0xd8, 0, 0]));
    }

    fn decoded(bytes: &[u8]) -> RgbImage {
        image::load_from_memory(bytes).unwrap().into_rgb8()
    }

    const SAMPLINGS: [SamplingFactor; 4] = [SamplingFactor::F_1_1, SamplingFactor::F_2_1, SamplingFactor::F_1_2, SamplingFactor::F_2_2];

    fn picture(sampling: SamplingFactor, change: impl FnOnce(&mut Encoder<&mut Vec<u8>>)) -> Vec<u8> {
        let image = RgbImage::from_fn(90, 150, |x, y| Rgb([(x * 5 + y) as u8, (y * 7) as u8, ((x ^ y) * 3) as u8]));
        let mut jpeg = Vec::new();
        let mut encoder = Encoder::new(&mut jpeg, 90);
        encoder.set_sampling_factor(sampling);
        change(&mut encoder);
        encoder.encode(image.as_raw(), 90, 150, ColorType::Rgb).unwrap();
        jpeg
    }

    #[test]
    fn the_upper_rows_are_those_of_the_whole_file() {
        for sampling in SAMPLINGS {
            for restarts in [0, 7] {
                let jpeg = picture(sampling, |encoder| encoder.set_restart_interval(restarts));
                let whole = decoded(&jpeg);
                assert_eq!(size(&jpeg), Some((90, 150)));
                for rows in [0, 1, 8, 9, 40, 63, 100, 120] {
                    let upper = decoded(&top(&jpeg, rows).unwrap());
                    assert!(upper.height() >= rows && upper.height() <= rows + 32, "{rows}: {}", upper.height());
                    let bytes = 3 * 90 * rows as usize;
                    assert!(upper.as_raw()[..bytes] == whole.as_raw()[..bytes], "{sampling:?}, {rows} rows");
                }
                assert!(top(&jpeg, 145).is_none() && top(&jpeg, u32::MAX).is_none());
            }
        }
    }

    #[test]
    fn a_file_in_several_passes_stays_whole() {
        let progressive = picture(SamplingFactor::F_2_1, |encoder| encoder.set_progressive(true));
        // The encoder writes a colour after the other where chroma is sampled by four.
        let one_by_one = picture(SamplingFactor::F_4_1, |_| {});
        for jpeg in [progressive, one_by_one] {
            assert_eq!((size(&jpeg), top(&jpeg, 40)), (Some((90, 150)), None));
        }
    }

    proptest! {
        #[test]
        fn no_bytes_are_too_odd(junk in prop::collection::vec(any::<u8>(), 0..300), rows: u32) {
            for bytes in [junk.clone(), [&[0xff, 0xd8, 0xff, 0xc0], junk.as_slice()].concat()] {
                let _ = (size(&bytes), top(&bytes, rows), is_truncated_jpeg(&bytes));
            }
        }
    }
}
