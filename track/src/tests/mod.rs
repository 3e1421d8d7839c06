//! Tests on rendered images.

mod exact;
mod marker;
mod opencv;
mod precision;
mod recordings;
mod scene;
mod shaft;

use image::RgbImage;
use raven::log::{CameraFrame, FrameData, Sampling, Side, Stamp};

/// What the tracker sees of a webcam's JPEG file.
fn decoded(jpeg: Vec<u8>) -> (RgbImage, Option<Sampling>) {
    let frame = CameraFrame {
        side: Side::Left,
        stamp: Stamp(1),
        log_time: Stamp(1),
        frame_id: String::new(),
        sequence: None,
        data: FrameData::Jpeg(jpeg),
    };
    (frame.decode_rgb().unwrap(), frame.sampling())
}
