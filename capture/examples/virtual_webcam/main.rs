//! A virtual USB webcam: speaks USB/IP to the kernel's own `vhci_hcd`, so that the real `uvcvideo` driver binds to it and makes a real
//! `/dev/videoN`. It sends the JPEG files of a folder one after the other, or a moving pattern as YUYV, 640x480 at 15, 30 and 60 frames per second,
//! and fails in the ways that webcams fail. For machines of which one may break the kernel: the tests run it in a virtual one.

mod controls;
mod descriptors;
mod film;
mod plug;

use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use clap::Parser;

/// A webcam that is not there.
#[derive(Debug, Clone, Parser)]
pub struct Args {
    /// Port of the virtual hub.
    #[arg(long)]
    port: u32,
    /// Its product name.
    #[arg(long, default_value = "Virtual webcam")]
    name: String,
    /// Its serial number.
    #[arg(long)]
    serial: String,
    /// Folder of JPEG files, sent in the order of their names.
    #[arg(long)]
    frames: PathBuf,
    /// The first frame comes so much later [us].
    #[arg(long, default_value_t = 0)]
    delay_us: u64,
    /// Every K-th frame has the error bit.
    #[arg(long, value_name = "K")]
    error_every: Option<u32>,
    /// Every K-th frame is cut off after a third.
    #[arg(long, value_name = "K")]
    short_every: Option<u32>,
    /// Every K-th frame is left out.
    #[arg(long, value_name = "K")]
    skip_every: Option<u32>,
    /// Every K-th frame has the contents of the one before.
    #[arg(long, value_name = "K")]
    repeat_every: Option<u32>,
    /// No frame comes after so many, until it is opened again.
    #[arg(long, value_name = "N")]
    stall_at: Option<u32>,
    /// It is unplugged after so long [s].
    #[arg(long, value_name = "SECONDS")]
    unplug_after: Option<f64>,
    /// It is plugged in again after so long [s].
    #[arg(long, value_name = "SECONDS", requires = "unplug_after")]
    replug_after: Option<f64>,
}

fn main() -> std::io::Result<()> {
    let mut args = Args::parse();
    plug::plug(&args)?;
    if let Some(seconds) = args.replug_after {
        thread::sleep(Duration::from_secs_f64(seconds));
        args.unplug_after = None;
        plug::plug(&args)?;
    }
    Ok(())
}
