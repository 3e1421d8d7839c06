//! What a camera delivers: layout of the pixels, size and interval.

use std::fmt;
use std::str::FromStr;

/// How a camera sends its pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// A JPEG per frame.
    Mjpg,
    /// Rows of Y U Y V.
    Yuyv,
}

impl Encoding {
    /// V4L2's four characters.
    #[must_use]
    pub const fn fourcc(self) -> [u8; 4] {
        match self {
            Self::Mjpg => *b"MJPG",
            Self::Yuyv => *b"YUYV",
        }
    }
}

impl FromStr for Encoding {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.to_ascii_lowercase().as_str() {
            "mjpg" | "mjpeg" => Ok(Self::Mjpg),
            "yuyv" | "yuy2" => Ok(Self::Yuyv),
            _ => Err("expected mjpg or yuyv".to_owned()),
        }
    }
}

/// What a camera delivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// Layout of the pixels.
    pub encoding: Encoding,
    /// Columns and rows (px).
    pub size_px: [u32; 2],
    /// Time from one frame to the next as a fraction: numerator and denominator (s).
    pub interval_s: [u32; 2],
    /// Bytes from one row to the next; 0 for JPEG.
    pub stride_bytes: u32,
}

/// What is asked of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// Layout of the pixels.
    pub encoding: Encoding,
    /// Columns and rows (px).
    pub size_px: [u32; 2],
    /// Frames per second.
    pub rate_hz: u32,
    /// Whether exposure, focus and white balance are held.
    pub lock: bool,
    /// Exposure time to hold (ms); `None` is what the camera finds by itself.
    pub exposure_ms: Option<f64>,
}

impl Mode {
    /// Frames per second, 0 if the camera does not say.
    #[must_use]
    pub fn rate_hz(&self) -> f64 {
        let [numerator, denominator] = self.interval_s.map(f64::from);
        if numerator > 0.0 { denominator / numerator } else { 0.0 }
    }

    /// Bytes of a raw frame; `None` for JPEG, whose frames differ.
    #[must_use]
    pub const fn frame_bytes(&self) -> Option<usize> {
        match self.encoding {
            Encoding::Mjpg => None,
            Encoding::Yuyv => Some(self.stride_bytes as usize * self.size_px[1] as usize),
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        describe(f, self.encoding.fourcc(), self.size_px, self.rate_hz())
    }
}

/// A mode in words; the encoding may be one that is not recorded.
pub(super) fn describe(f: &mut impl fmt::Write, fourcc: [u8; 4], [width, height]: [u32; 2], rate_hz: f64) -> fmt::Result {
    let rate = (rate_hz * 100.0).round() / 100.0;
    write!(f, "{} {width}x{height} at {rate} frames/s", String::from_utf8_lossy(&fourcc))
}

/// `640x480`.
///
/// # Errors
/// What was expected.
pub fn size_px(text: &str) -> Result<[u32; 2], String> {
    let number = |text: &str| text.parse().ok().filter(|&number| number > 0);
    let pair = text.split_once('x').and_then(|(width, height)| Some([number(width)?, number(height)?]));
    pair.ok_or_else(|| "expected columns and rows as in 640x480".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_in_words_and_back() {
        let mode = Mode { encoding: Encoding::Yuyv, size_px: [640, 480], interval_s: [1001, 30_000], stride_bytes: 1280 };
        assert_eq!(mode.to_string(), "YUYV 640x480 at 29.97 frames/s");
        assert_eq!(mode.frame_bytes(), Some(614_400));
        assert_eq!(Mode { interval_s: [0, 0], ..mode }.rate_hz(), 0.0);
        assert_eq!("MJPEG".parse(), Ok(Encoding::Mjpg));
        assert!("h264".parse::<Encoding>().is_err());
        assert_eq!(size_px("640x480"), Ok([640, 480]));
        for text in ["640", "640x", "0x480", "-1x2"] {
            assert!(size_px(text).is_err(), "{text}");
        }
    }
}
