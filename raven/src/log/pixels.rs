//! Pixels of recorded frames as RGB or as luma.
//!
//! Luma is that of ITU-R BT.601, `Y = 0.299 R + 0.587 G + 0.114 B`, which JPEG and YUYV cameras use themselves.

use std::io::Cursor;
use std::ops::Range;

use image::{GrayImage, ImageReader, RgbImage};
use raven_jpeg::{Part, decode_part};

use super::{CameraFrame, FrameData, jpeg, png};
use crate::{Error, Result};

/// Larger images are damage, not data.
pub const LARGEST_SIDE: u32 = 16_384;

/// The whole of an image, in Rust with vector instructions, takes less time than a larger share of it.
const LARGEST_PART: f64 = 0.5;

/// Layouts of raw frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Rgb,
    Bgr,
    Mono,
    /// `Y0 U Y1 V`.
    Yuyv,
    /// `U Y0 V Y1`.
    Uyvy,
}

impl Layout {
    fn named(encoding: &str) -> Option<Self> {
        Some(match encoding {
            "rgb8" => Self::Rgb,
            "bgr8" | "8UC3" => Self::Bgr,
            "mono8" | "8UC1" => Self::Mono,
            "yuv422_yuy2" | "yuyv" => Self::Yuyv,
            "yuv422" | "uyvy" => Self::Uyvy,
            _ => return None,
        })
    }

    const fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Mono => 1,
            Self::Yuyv | Self::Uyvy => 2,
            Self::Rgb | Self::Bgr => 3,
        }
    }
}

/// Rows of one raw frame, whose lengths have been checked.
struct Raster<'a> {
    layout: Layout,
    width: u32,
    height: u32,
    rows: std::slice::Chunks<'a, u8>,
    row_bytes: usize,
}

impl CameraFrame {
    /// The frame in colour.
    ///
    /// # Errors
    /// A sentence, if the JPEG is broken or the layout is unknown or too short for its size.
    pub fn decode_rgb(&self) -> Result<RgbImage> {
        match &self.data {
            FrameData::Jpeg(bytes) => Ok(self.decode_file(bytes)?.into_rgb8()),
            FrameData::Raw { .. } => self.rgb(self.raster()?),
        }
    }

    /// The frame's pixels in some columns and rows, as far as it has them, and more of it where that costs nothing.
    ///
    /// # Errors
    /// Those of [`CameraFrame::decode_rgb`].
    pub fn decode_rgb_part(&self, columns: Range<u32>, rows: Range<u32>) -> Result<Part> {
        let part = match &self.data {
            FrameData::Jpeg(bytes) if is_worth_a_part(bytes, &columns, &rows) => decode_part(bytes, columns, rows),
            FrameData::Raw { height, .. } if rows.start < rows.end.min(*height) => {
                let image = self.rgb(self.raster()?.between(&rows))?;
                Some(Part { image, corner: [0, rows.start] })
            }
            _ => None,
        };
        part.map_or_else(|| self.decode_rgb().map(Part::whole), Ok)
    }

    fn rgb(&self, raster: Raster<'_>) -> Result<RgbImage> {
        let (width, height) = (raster.width, raster.height);
        let pixels = raster.collect(3 * width as usize, |layout, row, out| match layout {
            Layout::Rgb => out.extend_from_slice(row),
            Layout::Bgr => out.extend(row.as_chunks().0.iter().flat_map(|&[b, g, r]| [r, g, b])),
            Layout::Mono => out.extend(row.iter().flat_map(|&y| [y; 3])),
            Layout::Yuyv => out.extend(row.as_chunks().0.iter().flat_map(|&[y0, u, y1, v]| two_rgb(y0, y1, u, v))),
            Layout::Uyvy => out.extend(row.as_chunks().0.iter().flat_map(|&[u, y0, v, y1]| two_rgb(y0, y1, u, v))),
        });
        RgbImage::from_raw(width, height, pixels).ok_or_else(|| self.bad("its rows are incomplete"))
    }

    /// The frame's luma.
    ///
    /// # Errors
    /// Those of [`CameraFrame::decode_rgb`].
    pub fn decode_gray(&self) -> Result<GrayImage> {
        let raster = match &self.data {
            FrameData::Jpeg(bytes) => {
                return Ok(match self.decode_file(bytes)? {
                    image::DynamicImage::ImageLuma8(gray) => gray,
                    colour => {
                        let rgb = colour.into_rgb8();
                        let luma = rgb.as_raw().as_chunks().0.iter().map(|&[r, g, b]| luma(r, g, b)).collect();
                        GrayImage::from_raw(rgb.width(), rgb.height(), luma).ok_or_else(|| self.bad("its rows are incomplete"))?
                    }
                });
            }
            FrameData::Raw { .. } => self.raster()?,
        };
        let (width, height) = (raster.width, raster.height);
        let pixels = raster.collect(width as usize, |layout, row, out| match layout {
            Layout::Rgb => out.extend(row.as_chunks().0.iter().map(|&[r, g, b]| luma(r, g, b))),
            Layout::Bgr => out.extend(row.as_chunks().0.iter().map(|&[b, g, r]| luma(r, g, b))),
            Layout::Mono => out.extend_from_slice(row),
            Layout::Yuyv => out.extend(row.iter().step_by(2)),
            Layout::Uyvy => out.extend(row.iter().skip(1).step_by(2)),
        });
        GrayImage::from_raw(width, height, pixels).ok_or_else(|| self.bad("its rows are incomplete"))
    }

    /// Width and height [px] as the frame says, whether or not its pixels can be decoded.
    ///
    /// # Errors
    /// A sentence, if it says nothing.
    pub fn size(&self) -> Result<(u32, u32)> {
        match &self.data {
            FrameData::Jpeg(bytes) => {
                jpeg::size(bytes).map_or_else(|| self.reader(bytes)?.into_dimensions().map_err(|e| self.undecodable(&e)), Ok)
            }
            FrameData::Raw { width, height, .. } => Ok((*width, *height)),
        }
    }

    /// Whether a JPEG or PNG lacks its end: the camera, the cable or a copy cut it off. Zeros after the end are padding.
    #[must_use]
    pub fn is_truncated(&self) -> bool {
        match &self.data {
            FrameData::Jpeg(bytes) => jpeg::is_truncated_jpeg(bytes) || png::is_truncated(bytes),
            FrameData::Raw { encoding, width, height, step, data } => {
                let row_bytes = Layout::named(encoding).map_or(*step as usize, |layout| *width as usize * layout.bytes_per_pixel());
                data.len() < raw_bytes(row_bytes, *step as usize, *height as usize)
            }
        }
    }

    fn decode_file(&self, bytes: &[u8]) -> Result<image::DynamicImage> {
        self.reader(bytes)?.decode().map_err(|e| self.undecodable(&e))
    }

    fn reader<'b>(&self, bytes: &'b [u8]) -> Result<ImageReader<Cursor<&'b [u8]>>> {
        let mut reader =
            ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| self.bad(&format!("its bytes cannot be read ({e})")))?;
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(LARGEST_SIDE);
        limits.max_image_height = Some(LARGEST_SIDE);
        reader.limits(limits);
        Ok(reader)
    }

    fn undecodable(&self, error: &image::ImageError) -> Error {
        self.bad(&format!("it cannot be decoded ({error})"))
    }

    fn raster(&self) -> Result<Raster<'_>> {
        let FrameData::Raw { encoding, width, height, step, data } = &self.data else {
            return Err(self.bad("it is no raw frame"));
        };
        let layout = Layout::named(encoding).ok_or_else(|| {
            self.bad(&format!("its encoding `{encoding}` is not one of rgb8, bgr8, mono8, yuv422_yuy2, yuv422; record one of these"))
        })?;
        if *width == 0 || *height == 0 || *width > LARGEST_SIDE || *height > LARGEST_SIDE {
            return Err(self.bad(&format!("its size is {width} x {height}")));
        }
        if matches!(layout, Layout::Yuyv | Layout::Uyvy) && width % 2 == 1 {
            return Err(self.bad(&format!("its width {width} is odd, which `{encoding}` cannot be")));
        }
        let (row_bytes, step, rows) = (*width as usize * layout.bytes_per_pixel(), *step as usize, *height as usize);
        if step < row_bytes || data.len() < raw_bytes(row_bytes, step, rows) {
            return Err(self.bad(&format!("{width} x {height} pixels of `{encoding}` do not fit {} bytes in rows of {step}", data.len())));
        }
        Ok(Raster { layout, width: *width, height: *height, rows: data.chunks(step), row_bytes })
    }

    fn bad(&self, what: &str) -> Error {
        Error::Data(format!("the {} frame at {}: {what}.", self.side.name(), self.stamp))
    }
}

/// Bytes that so many rows take at least: what pads rows may be missing after the last.
fn raw_bytes(row_bytes: usize, step: usize, rows: usize) -> usize {
    step.saturating_mul(rows.saturating_sub(1)).saturating_add(row_bytes.min(step))
}

impl Raster<'_> {
    /// Some of its rows, which it must have.
    fn between(mut self, rows: &Range<u32>) -> Self {
        self.height = self.height.min(rows.end) - rows.start;
        // Leaves out the rows above.
        rows.start.checked_sub(1).and_then(|last| self.rows.nth(last as usize));
        self
    }

    fn collect(self, row_size: usize, convert: impl Fn(Layout, &[u8], &mut Vec<u8>)) -> Vec<u8> {
        let mut pixels = Vec::with_capacity(row_size * self.height as usize);
        for row in self.rows.take(self.height as usize) {
            convert(self.layout, row.get(..self.row_bytes).unwrap_or(row), &mut pixels);
        }
        pixels
    }
}

/// Whether so much of a JPEG takes less time than the whole.
fn is_worth_a_part(bytes: &[u8], columns: &Range<u32>, rows: &Range<u32>) -> bool {
    let share = |range: &Range<u32>, size: u32| f64::from(range.end.min(size).saturating_sub(range.start)) / f64::from(size);
    let is_small = |(width, height)| share(columns, width) * share(rows, height) < LARGEST_PART;
    jpeg::size_in_one_pass(bytes).is_some_and(is_small)
}

/// Luma after BT.601, in 16-bit fixed point, rounded.
const fn luma(r: u8, g: u8, b: u8) -> u8 {
    ((19_595 * r as u32 + 38_470 * g as u32 + 7_471 * b as u32 + 32_768) >> 16) as u8
}

/// Two pixels that share their chroma, BT.601 with luma 16 to 235 and chroma 16 to 240, as webcams send it.
fn two_rgb(y0: u8, y1: u8, u: u8, v: u8) -> [u8; 6] {
    let (u, v) = (f32::from(u) - 128.0, f32::from(v) - 128.0);
    let one = |y: u8| {
        let y = 255.0 / 219.0 * (f32::from(y) - 16.0);
        // The cast saturates.
        [y + 1.596_03 * v, y - 0.391_76 * u - 0.812_97 * v, y + 2.017_23 * u].map(|value| value.round() as u8)
    };
    let ([r0, g0, b0], [r1, g1, b1]) = (one(y0), one(y1));
    [r0, g0, b0, r1, g1, b1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Side, Stamp};
    use proptest::prelude::*;

    fn raw(encoding: &str, width: u32, height: u32, step: u32, data: Vec<u8>) -> CameraFrame {
        let data = FrameData::Raw { encoding: encoding.into(), width, height, step, data };
        CameraFrame { side: Side::Left, stamp: Stamp(1), log_time: Stamp(2), frame_id: String::new(), sequence: None, data }
    }

    #[test]
    fn layouts_and_row_padding() {
        let rgb = raw("rgb8", 1, 2, 4, vec![200, 100, 50, 9, 1, 2, 3]).decode_rgb().unwrap();
        assert_eq!(rgb.as_raw(), &[200, 100, 50, 1, 2, 3]);
        let bgr = raw("bgr8", 1, 1, 3, vec![50, 100, 200]);
        assert_eq!(bgr.decode_rgb().unwrap().as_raw(), &[200, 100, 50]);
        // 0.299 x 200 + 0.587 x 100 + 0.114 x 50 = 124.2; BT.709 would give 117.7.
        assert_eq!(bgr.decode_gray().unwrap().as_raw(), &[124]);
        assert_eq!(raw("yuv422_yuy2", 2, 1, 4, vec![10, 128, 20, 128]).decode_gray().unwrap().as_raw(), &[10, 20]);
        assert_eq!(raw("yuv422", 2, 1, 4, vec![128, 10, 128, 20]).decode_gray().unwrap().as_raw(), &[10, 20]);
    }

    /// White, black and the colour bars of BT.601 at 100 %.
    #[test]
    fn yuyv_colours_are_those_of_bt601() {
        for (yuv, expected) in [
            ([235, 128, 128], [255, 255, 255]),
            ([16, 128, 128], [0, 0, 0]),
            ([81, 90, 240], [255, 0, 0]),
            ([145, 54, 34], [0, 255, 0]),
            ([41, 240, 110], [0, 0, 255]),
        ] {
            let [y, u, v] = yuv;
            let rgb = raw("yuv422_yuy2", 2, 1, 4, vec![y, u, y, v]).decode_rgb().unwrap();
            for (have, want) in rgb.as_raw().iter().zip(expected.iter().cycle()) {
                assert!(have.abs_diff(*want) <= 2, "{yuv:?}: {have} for {want}");
            }
        }
    }

    #[test]
    fn a_part_is_where_it_says() {
        let pixels = |x: u32, y: u32| image::Rgb([(x * 2) as u8, (y * 2) as u8, 99]);
        let image = RgbImage::from_fn(100, 90, pixels);
        let mut jpeg = raw("", 0, 0, 0, Vec::new());
        let mut file = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 100).encode_image(&image).unwrap();
        jpeg.data = FrameData::Jpeg(file);
        for frame in [raw("rgb8", 100, 90, 300, image.into_raw()), jpeg] {
            for (columns, rows) in [(20..40, 30..50), (0..9, 0..9), (60..200, 70..200), (0..100, 0..90), (120..140, 95..99), (5..5, 7..7)] {
                let Part { image, corner: [left, top] } = frame.decode_rgb_part(columns.clone(), rows.clone()).unwrap();
                for (x, y) in columns.flat_map(|x| rows.clone().map(move |y| (x, y))).filter(|&(x, y)| x < 100 && y < 90) {
                    let off = image.get_pixel(x - left, y - top).0.iter().zip(pixels(x, y).0).map(|(a, b)| a.abs_diff(b)).max();
                    assert!(off <= Some(5), "{x} {y}: {off:?}");
                }
            }
        }
    }

    #[test]
    fn a_gray_jpeg_and_its_colour_twin_have_one_luma() {
        let gray = GrayImage::from_fn(32, 32, |x, y| image::Luma([(x * 4 + y * 3) as u8]));
        let mut jpeg = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 95).encode_image(&gray).unwrap();
        let mut frame = raw("", 0, 0, 0, Vec::new());
        frame.data = FrameData::Jpeg(jpeg);
        let decoded = frame.decode_gray().unwrap();
        let from_rgb = frame.decode_rgb().unwrap();
        for (a, b) in decoded.as_raw().iter().zip(from_rgb.as_raw().chunks_exact(3)) {
            assert!(a.abs_diff(luma(b[0], b[1], b[2])) <= 1);
        }
        for (a, b) in decoded.as_raw().iter().zip(gray.as_raw()) {
            assert!(a.abs_diff(*b) <= 6);
        }
    }

    proptest! {
        #[test]
        fn no_raw_frame_panics(
            encoding in "(rgb8|bgr8|mono8|yuv422_yuy2|yuv422|other)",
            width in 0_u32..9, height in 0_u32..9, step in 0_u32..30,
            data in prop::collection::vec(any::<u8>(), 0..200),
        ) {
            let frame = raw(&encoding, width, height, step, data);
            let _ = frame.decode_rgb_part(1..width, 2..height);
            if let Ok(rgb) = frame.decode_rgb() {
                prop_assert_eq!((rgb.width(), rgb.height()), (width, height));
                prop_assert!(frame.decode_gray().is_ok());
            }
        }

        #[test]
        fn no_jpeg_panics(tail in prop::collection::vec(any::<u8>(), 0..100)) {
            let mut frame = raw("", 0, 0, 0, Vec::new());
            frame.data = FrameData::Jpeg([vec![0xff, 0xd8, 0xff], tail].concat());
            let _ = frame.decode_rgb();
            let _ = frame.decode_gray();
        }
    }
}
