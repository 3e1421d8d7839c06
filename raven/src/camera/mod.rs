//! Cameras: the pinhole with plumb-bob distortion, a pair of them, and `cameras.yaml`.
//!
//! Pixel (0, 0) is the centre of the top-left pixel. Camera frames: x right, y down, z along the view.

mod file;
mod pinhole;
mod stereo;
mod tracked;

pub use file::Quality;
pub use pinhole::Pinhole;
pub use stereo::{Cameras, StereoPoint};

#[cfg(test)]
mod tests;
