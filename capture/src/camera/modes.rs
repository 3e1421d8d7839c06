//! The modes that a camera offers.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use serde::Serialize;
use v4l::Device;
use v4l::capability::Flags;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::video::Capture;

/// One layout and size, with the rates it comes at.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfferedMode {
    /// V4L2's four characters.
    pub encoding: String,
    /// Columns and rows (px).
    pub size_px: [u32; 2],
    /// Frames per second.
    pub rates_hz: Vec<f64>,
}

impl fmt::Display for OfferedMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size_px;
        let rates: Vec<String> = self.rates_hz.iter().map(|rate_hz| ((rate_hz * 100.0).round() / 100.0).to_string()).collect();
        write!(f, "{} {width}x{height} at {} frames/s", self.encoding, rates.join(", "))
    }
}

/// What the device at `path` offers; `None` if it gives no images or cannot be asked. Sizes and rates that a driver gives as a range are left
/// out: webcams list theirs.
#[must_use]
pub fn offered(path: &Path) -> Option<Vec<OfferedMode>> {
    // The library panics at descriptions that are not UTF-8.
    catch_unwind(AssertUnwindSafe(|| ask(path))).ok().flatten()
}

fn ask(path: &Path) -> Option<Vec<OfferedMode>> {
    let device = Device::with_path(path).ok()?;
    if !device.query_caps().ok()?.capabilities.contains(Flags::VIDEO_CAPTURE) {
        return None;
    }
    let mut modes = Vec::new();
    for format in device.enum_formats().unwrap_or_default() {
        for size in device.enum_framesizes(format.fourcc).unwrap_or_default() {
            let FrameSizeEnum::Discrete(size) = size.size else { continue };
            let intervals = device.enum_frameintervals(format.fourcc, size.width, size.height).unwrap_or_default();
            let rate_hz = |interval| match interval {
                FrameIntervalEnum::Discrete(time) if time.numerator > 0 => Some(f64::from(time.denominator) / f64::from(time.numerator)),
                _ => None,
            };
            let rates_hz = intervals.into_iter().filter_map(|interval| rate_hz(interval.interval)).collect();
            modes.push(OfferedMode { encoding: format.fourcc.to_string(), size_px: [size.width, size.height], rates_hz });
        }
    }
    Some(modes)
}
