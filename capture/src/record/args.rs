//! Arguments of `raven-capture record`, and what they ask for.

use std::path::{Path, PathBuf};

use raven::log::{Side, topics};
use raven::{Error, Result, cli};

use crate::camera::find::{SYSFS, devices, two_cameras};
use crate::camera::mode::size_px;
use crate::camera::{Driver, Encoding, Request, Selector, V4l2};
use crate::number::positive;
use crate::ros1::{Endpoint, MASTER_PORT, TopicAddress, topic_name};

/// What is asked of both cameras.
#[derive(Debug, Clone, clap::Args)]
pub struct CameraArgs {
    /// Columns and rows of the images.
    #[arg(long, value_name = "WxH", value_parser = size_px, default_value = "640x480")]
    pub size: [u32; 2],
    /// Frames per second.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=1000), allow_negative_numbers = true)]
    pub fps: u32,
    /// mjpg is recorded as it comes from the camera, yuyv as raw images (ten times the size).
    #[arg(long, default_value = "mjpg")]
    pub format: Encoding,
    /// Exposure time to hold [ms]; if left off, what the camera finds by itself before the recording starts.
    #[arg(long, value_name = "MS", value_parser = positive, allow_negative_numbers = true)]
    pub exposure: Option<f64>,
    /// Leave exposure, focus and white balance to the camera; they are held otherwise, and put back afterwards.
    #[arg(long, conflicts_with = "exposure")]
    pub no_lock: bool,
}

impl CameraArgs {
    /// A driver for this camera.
    #[must_use]
    pub fn driver(&self, selector: Selector) -> Box<dyn Driver> {
        let request =
            Request { encoding: self.format, size_px: self.size, rate_hz: self.fps, lock: !self.no_lock, exposure_ms: self.exposure };
        Box::new(V4l2::new(selector, request))
    }
}

/// Arguments of `raven-capture record`.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("source").args(["left", "right", "robot", "joint_encoders", "topic"]).multiple(true).required(true),
    after_help = "Example:\n  raven-capture record --left serial:2B4F91C0 --right serial:77D03A12 --robot ros://robot:11311/ravenstate -o session.mcap\n  \
                  raven-capture record --ros-master http://robot:11311 --topic /ravenstate --topic /joint_states -o session.mcap\n\n\
                  Ctrl-C ends the recording and completes the file; a second one aborts. Until then it is called session.mcap.active, and\n\
                  all programs here open it by that name too: a kill costs the last second, and nothing else.\n\n\
                  Exit codes: 0 recorded, 1 failed, 2 wrong arguments, 3 recorded, but data were lost."
)]
pub struct Args {
    /// The left camera, by serial number, USB port or device: serial:2B4F91C0, usb:1-4.2, /dev/video0. `raven-capture check --devices` lists
    /// them. A camera is known by its serial number or port from then on, whatever number it comes back with.
    #[arg(long, value_name = "CAMERA")]
    pub left: Option<Selector>,
    /// The right camera.
    #[arg(long, value_name = "CAMERA")]
    pub right: Option<Selector>,
    /// What is asked of the cameras.
    #[command(flatten)]
    pub camera: CameraArgs,
    /// The robot's own message, recorded as /ravenstate.
    #[arg(long, value_name = "ros://HOST:PORT/TOPIC")]
    pub robot: Option<TopicAddress>,
    /// Reference encoders at the joints, recorded as /joint_encoders.
    #[arg(long, value_name = "ros://HOST:PORT/TOPIC")]
    pub joint_encoders: Option<TopicAddress>,
    /// A topic recorded under its own name; may be repeated.
    #[arg(long, value_name = "TOPIC", value_parser = topic_name)]
    pub topic: Vec<String>,
    /// The ROS master of --topic; ROS_MASTER_URI or this machine if left off. ROS_IP or ROS_HOSTNAME say how the robot reaches this machine,
    /// if it is not by the address that the master sees.
    #[arg(long, value_name = "URI", requires = "topic")]
    pub ros_master: Option<Endpoint>,
    /// End after so long [s].
    #[arg(long, value_name = "SECONDS", value_parser = positive, allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// Begin another file after so much [MB]: NAME_000.mcap, NAME_001.mcap and so on.
    #[arg(long, value_name = "MB", value_parser = positive, allow_negative_numbers = true)]
    pub split_size: Option<f64>,
    /// Space that must stay free on the disk [MB]; below it the recording ends.
    #[arg(long, value_name = "MB", default_value_t = 1000, allow_negative_numbers = true)]
    pub min_space: u64,
    /// What to remember of the session, as in operator=Kim; may be repeated.
    #[arg(long, value_name = "KEY=VALUE", value_parser = pair)]
    pub session: Vec<(String, String)>,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// The recording; .mcap is added if it is left off.
    #[arg(short, long, value_name = "NAME")]
    pub output: PathBuf,
}

impl Args {
    /// The cameras that were asked for.
    fn chosen(&self) -> impl Iterator<Item = (Side, &Selector)> {
        [(Side::Left, &self.left), (Side::Right, &self.right)].into_iter().filter_map(|(side, camera)| Some((side, camera.as_ref()?)))
    }
}

/// The cameras that were asked for.
///
/// # Errors
/// If both are the same.
pub fn cameras(args: &Args) -> Result<Vec<(Side, Box<dyn Driver>)>> {
    two_cameras(args.left.as_ref(), args.right.as_ref(), &devices(Path::new(SYSFS)))?;
    Ok(args.chosen().map(|(side, camera)| (side, args.camera.driver(camera.clone()))).collect())
}

/// Every topic that was asked for, with its name in the recording.
pub(super) fn wanted(args: &Args) -> Result<Vec<(String, TopicAddress)>> {
    let mut wanted: Vec<(String, TopicAddress)> = Vec::new();
    wanted.extend(args.robot.iter().map(|address| (topics::RAVEN_STATE.to_owned(), address.clone())));
    wanted.extend(args.joint_encoders.iter().map(|address| (topics::JOINT_ENCODERS.to_owned(), address.clone())));
    if !args.topic.is_empty() {
        let master = args.ros_master.clone().map_or_else(usual_master, Ok)?;
        wanted.extend(args.topic.iter().map(|topic| (topic.clone(), TopicAddress { master: master.clone(), topic: topic.clone() })));
    }
    let frames = args.chosen().flat_map(|(side, _)| [topics::compressed(side), topics::raw(side), topics::frame_meta(side)]);
    let mut names: Vec<&str> = wanted.iter().map(|(name, _)| name.as_str()).chain([topics::CLOCK]).chain(frames).collect();
    names.sort_unstable();
    if let Some([twice, _]) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::Argument(format!(
            "`{twice}` would be in the recording twice; the recorder's own clocks are on `{}`, and its cameras' frames below `/stereo`.",
            topics::CLOCK
        )));
    }
    for (k, (name, address)) in wanted.iter().enumerate() {
        if let Some((other, _)) = wanted[..k].iter().find(|(_, other)| other == address) {
            let TopicAddress { master, topic } = address;
            return Err(Error::Argument(format!(
                "ros://{}{topic} is asked for as `{other}` and as `{name}`; leave one away.",
                master.authority()
            )));
        }
    }
    Ok(wanted)
}

/// The master that ROS's own programs would take.
fn usual_master() -> Result<Endpoint> {
    match std::env::var("ROS_MASTER_URI") {
        Ok(uri) if !uri.is_empty() => uri.parse().map_err(|what| Error::Argument(format!("ROS_MASTER_URI: {what}."))),
        _ => Ok(Endpoint { host: "localhost".to_owned(), port: MASTER_PORT }),
    }
}

/// The recording's name; standard output keeps its own, by which it is refused.
pub(crate) fn with_extension(output: &Path) -> PathBuf {
    if output.as_os_str() == cli::STANDARD_OUTPUT || output.extension().is_some_and(|extension| extension == "mcap") {
        return output.to_owned();
    }
    let mut name = output.as_os_str().to_owned();
    name.push(".mcap");
    name.into()
}

fn pair(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').filter(|(key, _)| !key.is_empty()).ok_or("expected KEY=VALUE")?;
    Ok((key.to_owned(), value.to_owned()))
}
