//! Cameras: what a recording needs of one, and what V4L2 gives.
//!
//! A [`Driver`] opens a camera wherever it is plugged in now and gives its frames with the driver's own stamp, sequence number and flags. The
//! recorder sees nothing else of a camera, so a test can hand it one of its own. [`V4l2`] is the real one, on Linux.

pub mod controls;
#[cfg(not(target_os = "linux"))]
mod elsewhere;
pub mod fault;
pub mod find;
pub mod frame;
pub mod judge;
pub mod mode;
pub mod modes;
pub mod note;
#[cfg(target_os = "linux")]
mod offers;
pub mod source;
#[cfg(target_os = "linux")]
mod v4l2;

use std::collections::BTreeMap;
use std::time::Duration;

#[cfg(not(target_os = "linux"))]
pub use self::elsewhere::{V4l2, offered};
pub use self::fault::CameraFault;
pub use self::find::Selector;
pub use self::frame::Frame;
pub use self::mode::{Encoding, Mode, Request};
#[cfg(target_os = "linux")]
pub use self::offers::offered;
#[cfg(target_os = "linux")]
pub use self::v4l2::V4l2;

/// A camera that may come and go.
pub trait Driver: Send {
    /// Opens the camera, starts it, and returns when it delivers.
    ///
    /// # Errors
    /// If it is not there, does not do what was asked of it, or delivers nothing.
    fn open(&mut self) -> Result<Opened, CameraFault>;
}

/// A camera that delivers. Dropping it stops the camera and puts its controls back.
pub trait Stream {
    /// The next frame; `None` if none came in time.
    ///
    /// # Errors
    /// If the camera is gone or its stream has failed: it must be opened again.
    fn next(&mut self, within: Duration) -> Result<Option<Frame>, CameraFault>;
}

/// What came of opening a camera.
pub struct Opened {
    /// Its frames.
    pub stream: Box<dyn Stream>,
    /// What it delivers.
    pub mode: Mode,
    /// What the log should know of it: name, port, mode, controls.
    pub record: BTreeMap<String, String>,
    /// Sentences for the user about what could not be done as asked.
    pub notices: Vec<String>,
}
