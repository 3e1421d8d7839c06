//! What can go wrong with a camera, in words.

use std::io;
use std::path::PathBuf;

/// A camera cannot be opened, or has failed. The text is half a sentence.
#[derive(Debug, thiserror::Error)]
pub enum CameraFault {
    /// There is no V4L2 here.
    #[error("cameras are recorded on Linux only")]
    NotLinux,
    /// No camera fits.
    #[error("no camera {wanted}; found are {found}")]
    NotFound {
        /// What was looked for.
        wanted: String,
        /// What there is.
        found: String,
    },
    /// More than one camera fits.
    #[error("more than one camera fits {wanted}, at the ports {ports}; choose one by its port, as in `usb:{first}`")]
    Ambiguous {
        /// What was looked for.
        wanted: String,
        /// Ports of the cameras that fit.
        ports: String,
        /// The first of them.
        first: String,
    },
    /// The device is there but gives no images.
    #[error("{} gives no images ({card}): most cameras have a second device for metadata; `raven-capture check --devices` shows them", path.display())]
    NoImages {
        /// The device.
        path: PathBuf,
        /// Its own name.
        card: String,
    },
    /// The camera delivers something else than it was asked for.
    #[error("asked for {asked}, but the camera gives {given}; ask for a mode that it has")]
    OtherMode {
        /// What was asked for.
        asked: String,
        /// What the camera gives.
        given: String,
    },
    /// Another program has the camera.
    #[error("another program is using it (cannot {action}: EBUSY)")]
    Busy {
        /// What was tried.
        action: &'static str,
    },
    /// The bus cannot carry another stream.
    #[error(
        "the USB bus has no bandwidth left for it (ENOSPC): take MJPG instead of YUYV, fewer frames per second, or a port of another USB \
         controller"
    )]
    NoBandwidth,
    /// No frame came.
    #[error("no frame came for {seconds:.1} s")]
    Silent {
        /// How long it was waited for (s).
        seconds: f64,
    },
    /// The operating system refused.
    #[error("cannot {action}: {source}")]
    System {
        /// What was tried.
        action: &'static str,
        /// What the operating system says.
        source: io::Error,
    },
    /// The V4L2 library broke off.
    #[error("the camera library cannot cope with what the driver said")]
    Broken,
}

impl CameraFault {
    /// What the operating system said when `action` was tried.
    #[must_use]
    pub fn system(action: &'static str, source: io::Error) -> Self {
        const EBUSY: i32 = 16;
        const ENOSPC: i32 = 28;
        match source.raw_os_error() {
            Some(EBUSY) => Self::Busy { action },
            Some(ENOSPC) => Self::NoBandwidth,
            _ => Self::System { action, source },
        }
    }
}
