//! Cameras where there is no V4L2: none.

use std::path::Path;

use super::modes::OfferedMode;
use super::{CameraFault, Driver, Opened, Request, Selector};

/// A camera that cannot be opened here.
pub struct V4l2;

impl V4l2 {
    /// A camera of which this is asked.
    #[must_use]
    pub fn new(_: Selector, _: Request) -> Self {
        Self
    }
}

impl Driver for V4l2 {
    fn open(&mut self) -> Result<Opened, CameraFault> {
        Err(CameraFault::NotLinux)
    }
}

/// What the device at `path` offers: nothing.
#[must_use]
pub const fn offered(_: &Path) -> Option<Vec<OfferedMode>> {
    None
}
