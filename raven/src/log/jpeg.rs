//! What can be told of a JPEG file without decoding it: whether its end is there, its size, and whether its pixels come in one pass.
//!
//! After the start `FF D8` follow segments `FF marker length ...`. The frame header (ITU-T T.81, B.2.2) holds
//!
//! ```text
//! FF C0 length(2) precision(1) height(2) width(2) components(1) ...
//! ```
//!
//! and the scan header `FF DA length(2) components(1) ...` is followed by the pixels. In a sequential file with one scan, as cameras send it,
//! these come from the top to the bottom, so that the upper ones are known before the rest is read.

/// Frame headers of sequential files: baseline and extended. Of the others, C4, C8 and CC are no frame headers.
const SEQUENTIAL: [u8; 2] = [0xc0, 0xc1];
const FRAMES: std::ops::RangeInclusive<u8> = 0xc0..=0xcf;
const NO_FRAMES: [u8; 3] = [0xc4, 0xc8, 0xcc];
pub(super) const SCAN: u8 = 0xda;
/// What the frame header says.
struct Header {
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
                header = Some((Self { width, height, in_one_pass }, components));
            }
        }
        None
    }

    fn size(self) -> (u32, u32) {
        (self.width.into(), self.height.into())
    }
}

/// One segment of a file.
pub(super) struct Segment<'a> {
    /// What it is.
    pub(super) marker: u8,
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
            return self.bytes.get(at..end).map(|content| Segment { marker, content });
        }
    }
}

/// Width and height [px] by the file's header; `None` of what is no JPEG.
pub(super) fn size(bytes: &[u8]) -> Option<(u32, u32)> {
    Header::of(bytes).map(Header::size)
}

/// The same of a file whose pixels all come in one pass from the top to the bottom, as cameras send them; `None` of others.
pub(super) fn size_in_one_pass(bytes: &[u8]) -> Option<(u32, u32)> {
    Header::of(bytes).filter(|header| header.in_one_pass).map(Header::size)
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

    #[test]
    fn size_and_passes() {
        let picture = |change: &dyn Fn(&mut Encoder<&mut Vec<u8>>)| {
            let mut jpeg = Vec::new();
            let mut encoder = Encoder::new(&mut jpeg, 90);
            change(&mut encoder);
            encoder.encode(&[77; 3 * 90 * 150], 90, 150, ColorType::Rgb).unwrap();
            jpeg
        };
        let of = |jpeg: &[u8]| (size(jpeg), size_in_one_pass(jpeg).is_some());
        let sampled = |factor: SamplingFactor| picture(&|encoder: &mut Encoder<_>| encoder.set_sampling_factor(factor));
        for factor in [SamplingFactor::F_1_1, SamplingFactor::F_2_1, SamplingFactor::F_1_2, SamplingFactor::F_2_2] {
            assert_eq!(of(&sampled(factor)), (Some((90, 150)), true));
        }
        let progressive = picture(&|encoder: &mut Encoder<_>| encoder.set_progressive(true));
        // The encoder writes a colour after the other where chroma is sampled by four.
        for jpeg in [progressive, sampled(SamplingFactor::F_4_1)] {
            assert_eq!(of(&jpeg), (Some((90, 150)), false));
        }
    }

    proptest! {
        #[test]
        fn no_bytes_are_too_odd(junk in prop::collection::vec(any::<u8>(), 0..300)) {
            for bytes in [junk.clone(), [&[0xff, 0xd8, 0xff, 0xc0], junk.as_slice()].concat()] {
                let _ = (size(&bytes), size_in_one_pass(&bytes), is_truncated_jpeg(&bytes));
            }
        }
    }
}
