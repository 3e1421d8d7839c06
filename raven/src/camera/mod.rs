//! Cameras: the pinhole with plumb-bob distortion, a pair of them, and `cameras.yaml`.
//!
//! Pixel (0, 0) is the centre of the top-left pixel. Camera frames: x right, y down, z along the view.

mod file;
mod pinhole;
mod stereo;
mod systematic;
mod tracked;

pub use file::Quality;
pub use pinhole::Pinhole;
pub use stereo::{Cameras, StereoPoint};
pub use systematic::{CALIBRATION_STD_PX, CENTRE_STD_PX, SYSTEMATIC, Systematic};

#[cfg(test)]
mod tests;
