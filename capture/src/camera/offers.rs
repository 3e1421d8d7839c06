//! What a camera offers, asked by V4L2.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use v4l::Device;
use v4l::capability::Flags;
use v4l::frameinterval::FrameIntervalEnum;
use v4l::framesize::FrameSizeEnum;
use v4l::video::Capture;

use super::Encoding;
use super::modes::OfferedMode;

/// What the device at `path` offers of what can be recorded; `None` if it gives no images or cannot be asked. Sizes and rates that a driver gives
/// as a range are left out: webcams list theirs.
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
    let recorded = [Encoding::Mjpg, Encoding::Yuyv].map(Encoding::fourcc);
    for format in device.enum_formats().unwrap_or_default().into_iter().filter(|format| recorded.contains(&format.fourcc.repr)) {
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
