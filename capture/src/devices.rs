//! `raven-capture check --devices`: what would come of a recording, before it is made.
//!
//! Lists what is plugged in, runs the chosen cameras together for some seconds as a recording would, and holds what they deliver against what was
//! asked for, and their bytes against what the disk can take.

use std::collections::BTreeMap;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use raven::cli::{self, Outcome};
use raven::log::{FrameLosses, Stamp};
use raven::{Error, Result, files};
use serde::Serialize;

use crate::camera::find::{Device, Identity, SYSFS, devices, two_cameras};
use crate::camera::judge::Judge;
use crate::camera::modes::OfferedMode;
use crate::camera::{CameraFault, Driver, Opened, Selector, offered};
use crate::number::within;
use crate::record::args::CameraArgs;
use crate::record::source::Counts;
use crate::record::stop::Stop;
use crate::record::writer::free_bytes;
use crate::robot_trial::{disagreement, is_clock_kept, robot_trial};
use crate::ros1::TopicAddress;
use crate::table::table;

/// What is written to see how fast the disk is.
const PROBE_BYTES: usize = 64 << 20;
/// A disk must be so many times as fast as what is recorded, since it is not ours alone.
const DISK_MARGIN: f64 = 2.0;
/// The rate may fall short of the mode by so much.
const RATE_SHORTFALL: f64 = 0.02;
/// How long cameras may be tried (s).
const TRIAL_S: RangeInclusive<f64> = 0.1..=3600.0;
/// How soon a camera's trial notices that it is to end.
const GLANCE: Duration = Duration::from_millis(100);
/// An exposure longer than this part of the interval leaves no time to read the sensor.
const EXPOSURE_PART: f64 = 0.9;

/// Arguments of the preflight.
#[derive(Debug, Clone, clap::Args)]
pub struct DeviceArgs {
    /// List the cameras that are plugged in, and try those that are chosen, or all where nothing is, as a recording would.
    #[arg(long)]
    pub devices: bool,
    /// The left camera, as `record` takes it.
    #[arg(long, value_name = "CAMERA", requires = "devices")]
    pub left: Option<Selector>,
    /// The right camera.
    #[arg(long, value_name = "CAMERA", requires = "devices")]
    pub right: Option<Selector>,
    /// A robot, whose clock is held against this machine's.
    #[arg(long, value_name = "ros://HOST:PORT/TOPIC", requires = "devices")]
    pub robot: Option<TopicAddress>,
    /// What is asked of the cameras.
    #[command(flatten)]
    pub camera: CameraArgs,
    /// How long the cameras are tried [s].
    #[arg(long, value_name = "SECONDS", value_parser = trial_time, default_value = "3")]
    pub seconds: Duration,
    /// Folder of the disk that would be recorded to.
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    pub folder: PathBuf,
}

/// Lists and tries cameras.
///
/// # Errors
/// If it is stopped before the end, or the disk cannot be written to.
pub fn run(args: &DeviceArgs, json: Option<&Path>, out: &mut dyn Write) -> Result<Outcome> {
    files::apart(None::<&Path>, &[("--json", json)])?;
    let devices = devices(Path::new(SYSFS));
    two_cameras(args.left.as_ref(), args.right.as_ref(), &devices)?;
    let present: Vec<Present> = devices.iter().filter_map(|device| Some(Present::new(device, &devices, offered(&device.path)?))).collect();
    if present.is_empty() && args.left.is_none() && args.right.is_none() && args.robot.is_none() {
        return Err(Error::Data("no camera is plugged in.".to_owned()));
    }
    let mut cameras: Vec<(String, Box<dyn Driver>)> = Vec::new();
    let chosen = [("left", &args.left), ("right", &args.right)];
    cameras.extend(chosen.into_iter().filter_map(|(name, camera)| Some((name.to_owned(), args.camera.driver(camera.clone()?)))));
    // Who asks for the robot alone is not shown in a picture.
    if cameras.is_empty() && args.robot.is_none() {
        let all = present.iter().map(|present| (present.choose.clone(), args.camera.driver(Selector::Device(present.path.clone()))));
        cameras.extend(all);
    }
    let stop = Stop::on_signals()?;
    let stopped = || stop.asked();
    let mut preflight = Preflight::run(present, cameras, args.seconds, &args.folder, &stopped)?;
    preflight.clock_kept = is_clock_kept();
    if let Some(address) = &args.robot {
        preflight.try_robot(address, args.seconds, &stopped)?;
    }
    preflight.problems.iter().for_each(|sentence| cli::warn(sentence));
    cli::results(out, &preflight.render(), json, &preflight)?;
    Ok(if preflight.problems.is_empty() { Outcome::Done } else { Outcome::DataLost })
}

/// What one camera delivered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraTrial {
    /// Name on the command line.
    pub name: String,
    /// What it delivers, in words.
    pub mode: String,
    /// Frames per second that the mode promises, and that came.
    pub promised_hz: f64,
    /// See `promised_hz`.
    pub achieved_hz: f64,
    /// The longest time between two frames (s).
    pub longest_interval_s: Option<f64>,
    /// From the driver's stamp to the program, median (s).
    pub latency_s: Option<f64>,
    /// Bytes per second.
    pub bytes_per_second: f64,
    /// Exposure time (s), if the camera says.
    pub exposure_s: Option<f64>,
    /// Frames and what went wrong with them.
    pub frames: FrameLosses,
    /// What the log would know of it.
    pub record: BTreeMap<String, String>,
    /// What could not be done as asked.
    pub notices: Vec<String>,
}

/// What would come of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Preflight {
    /// Video devices that give images, and the modes they offer.
    pub devices: Vec<Present>,
    /// The cameras that ran.
    pub cameras: Vec<CameraTrial>,
    /// The robot's messages, if they were asked for.
    pub robot: Option<Counts>,
    /// Whether a time service keeps this machine's clock, if that can be known.
    pub clock_kept: Option<bool>,
    /// Bytes per second that the disk takes.
    pub disk_bytes_per_second: f64,
    /// Bytes free there.
    pub free_bytes: u64,
    /// Sentences about what would go wrong.
    pub problems: Vec<String>,
}

/// Whether the user has asked for the end.
pub type Stopped<'a> = dyn Fn() -> bool + Sync + 'a;

/// A device that gives images.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Present {
    /// Its file.
    pub path: PathBuf,
    /// Its name.
    pub name: String,
    /// How to choose it for good.
    pub choose: String,
    /// What it offers.
    pub modes: Vec<OfferedMode>,
}

impl Present {
    /// A device among all, with the modes that it offers.
    #[must_use]
    pub fn new(device: &Device, all: &[Device], modes: Vec<OfferedMode>) -> Self {
        let choose = Identity::of(device, all).selector();
        Self { path: device.path.clone(), name: device.name.clone(), choose, modes }
    }
}

impl Preflight {
    /// Runs cameras together for so long, and tries the disk of `folder`.
    ///
    /// # Errors
    /// If it is `stopped` before the end, when all cameras are put back, or the disk cannot be written to.
    pub fn run(
        devices: Vec<Present>,
        cameras: Vec<(String, Box<dyn Driver>)>,
        time: Duration,
        folder: &Path,
        stopped: &Stopped,
    ) -> Result<Self> {
        let trials: Vec<(String, Result<CameraTrial, CameraFault>)> = thread::scope(|scope| {
            let running = cameras.into_iter().map(|(name, driver)| (name.clone(), scope.spawn(move || trial(name, driver, time, stopped))));
            let running: Vec<_> = running.collect();
            running.into_iter().map(|(name, thread)| (name, thread.join().unwrap_or(Err(CameraFault::Broken)))).collect()
        });
        go_on(stopped)?;
        let (disk_bytes_per_second, free_bytes) = (disk_speed(folder)?, free_bytes(&folder.join("session.mcap"))?);
        let (cameras, problems) = (Vec::new(), Vec::new());
        let mut preflight = Self { devices, cameras, robot: None, clock_kept: None, disk_bytes_per_second, free_bytes, problems };
        for (name, trial) in trials {
            match trial {
                Ok(trial) => {
                    preflight.problems.extend(trial.problems());
                    preflight.cameras.push(trial);
                }
                Err(fault) => preflight.problems.push(format!("{name}: {fault}.")),
            }
        }
        preflight.problems.extend(slow_disk(disk_bytes_per_second, preflight.needed_bytes_per_second()));
        Ok(preflight)
    }

    fn try_robot(&mut self, address: &TopicAddress, time: Duration, stopped: &Stopped) -> Result<()> {
        let counts = robot_trial(address, time, stopped)?;
        go_on(stopped)?;
        let topic = &address.topic;
        if counts.received == 0 {
            self.problems.push(format!("{topic}: no message came."));
        }
        self.problems.extend(disagreement(topic, counts.least_lag_s));
        if self.clock_kept == Some(false) {
            self.problems.push(format!("no time service keeps this machine's clock: it drifts against that of {}.", address.master.host));
        }
        self.robot = Some(counts);
        Ok(())
    }

    fn needed_bytes_per_second(&self) -> f64 {
        self.cameras.iter().map(|camera| camera.bytes_per_second).sum()
    }

    /// The result as people read it.
    #[must_use]
    pub fn render(&self) -> String {
        let mut lines = Vec::new();
        for Present { path, name, choose, modes } in &self.devices {
            lines.push(format!("{choose}  {name}  {}", path.display()));
            lines.extend(modes.iter().map(|mode| format!("    {mode}")));
        }
        let titles = ["camera", "rate/Hz", "of", "longest/ms", "latency/ms", "MB/s", "exposure/ms", "losses"].map(str::to_owned).to_vec();
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{:.1}", 1e3 * value));
        let row = |camera: &CameraTrial| {
            vec![
                camera.name.clone(),
                format!("{:.2}", camera.achieved_hz),
                format!("{:.2}", camera.promised_hz),
                number(camera.longest_interval_s),
                number(camera.latency_s),
                format!("{:.2}", camera.bytes_per_second * 1e-6),
                number(camera.exposure_s),
                camera.frames.total().to_string(),
            ]
        };
        if !self.cameras.is_empty() {
            lines.push(String::new());
            lines.extend(table(&std::iter::once(titles).chain(self.cameras.iter().map(row)).collect::<Vec<_>>(), 0));
        }
        if let Some(robot) = &self.robot {
            let rate = robot.rate_hz.map_or("-".to_owned(), |rate_hz| format!("{rate_hz:.1}"));
            let lag = number(robot.least_lag_s);
            lines.push(format!(
                "robot: {} messages, {rate} Hz, {} gaps, from stamp to arrival {lag} ms at the least",
                robot.received, robot.gaps
            ));
        }
        let kept = self.clock_kept.map(|kept| if kept { "kept by a time service" } else { "not kept by a time service" });
        lines.extend(kept.map(|kept| format!("clock: {kept}")));
        let (speed, free) = (self.disk_bytes_per_second * 1e-6, self.free_bytes as f64 * 1e-9);
        let needed = self.needed_bytes_per_second();
        let lasts = if needed > 0.0 { format!(", enough for {:.0} min", self.free_bytes as f64 / needed / 60.0) } else { String::new() };
        lines.push(format!("disk: {speed:.0} MB/s, {free:.1} GB free{lasts}"));
        lines.push(String::new());
        lines.join("\n")
    }
}

impl CameraTrial {
    fn problems(&self) -> Vec<String> {
        let mut problems: Vec<String> = self.notices.iter().map(|notice| format!("{}: {notice}.", self.name)).collect();
        let slow = self.achieved_hz < (1.0 - RATE_SHORTFALL) * self.promised_hz;
        let long = self.exposure_s.filter(|exposure_s| exposure_s * self.promised_hz > EXPOSURE_PART);
        if slow {
            let (achieved, promised) = (self.achieved_hz, self.promised_hz);
            problems.push(format!("{}: {achieved:.2} frames/s came where the camera promises {promised:.2}.", self.name));
        }
        if let Some(exposure_s) = long {
            let (exposure_ms, interval_ms) = (1e3 * exposure_s, 1e3 / self.promised_hz);
            problems.push(format!(
                "{}: it exposes for {exposure_ms:.1} ms of {interval_ms:.1} ms between frames, which costs frames: more light, or a shorter \
                 `--exposure`.",
                self.name
            ));
        }
        let losses = self.frames.causes().into_iter().filter(|(count, _)| *count > 0);
        problems.extend(losses.map(|(count, what)| format!("{}: {count} {what}.", self.name)));
        problems
    }
}

fn go_on(stopped: &Stopped) -> Result<()> {
    if stopped() { Err(Error::Data("stopped before everything was tried; the cameras are as they were.".to_owned())) } else { Ok(()) }
}

/// Runs a camera for so long, or until it is stopped.
fn trial(name: String, mut driver: Box<dyn Driver>, time: Duration, stopped: &Stopped) -> Result<CameraTrial, CameraFault> {
    let Opened { mut stream, mode, record, notices } = driver.open()?;
    let (mut judge, mut frames) = (Judge::new(mode), FrameLosses::default());
    let (mut bytes, mut stamps, mut latencies) = (0_u64, Vec::new(), Vec::new());
    let until = Instant::now() + time;
    while Instant::now() < until && !stopped() {
        let Some(frame) = stream.next(until.saturating_duration_since(Instant::now()).min(GLANCE))? else { continue };
        frames.take(&judge.take(&frame));
        bytes += frame.bytes.len() as u64;
        stamps.push(Stamp(frame.monotonic_ns()));
        latencies.push(frame.dequeued.monotonic_ns as f64 * 1e-9 - frame.monotonic_ns() as f64 * 1e-9);
    }
    drop(stream);
    latencies.sort_unstable_by(f64::total_cmp);
    let lasted_s = stamps.last().zip(stamps.first()).map_or(0.0, |(last, first)| last.seconds_since(*first));
    let achieved_hz = if lasted_s > 0.0 { (stamps.len() - 1) as f64 / lasted_s } else { 0.0 };
    Ok(CameraTrial {
        name,
        mode: mode.to_string(),
        promised_hz: mode.rate_hz(),
        achieved_hz,
        longest_interval_s: judge.pace().longest_s(),
        latency_s: latencies.get(latencies.len() / 2).copied(),
        bytes_per_second: bytes as f64 / frames.frames.max(1) as f64 * achieved_hz,
        exposure_s: exposure_s(&record),
        frames,
        record,
        notices,
    })
}

/// The exposure that a camera was recorded with (s).
fn exposure_s(record: &BTreeMap<String, String>) -> Option<f64> {
    let units: f64 = record.get("control exposure_time_100us")?.split_whitespace().next()?.parse().ok()?;
    Some(units * 1e-4)
}

/// A sentence about a disk that leaves no room for others, by the bytes per second that it takes and that are recorded.
fn slow_disk(takes: f64, needed: f64) -> Option<String> {
    let least = DISK_MARGIN * needed;
    (takes < least).then(|| {
        let [takes, needed, least] = [takes, needed, least].map(|rate| 1e-6 * rate);
        format!(
            "the disk takes {takes:.1} MB/s, and should take {least:.1} MB/s, {DISK_MARGIN} times the {needed:.1} MB/s of the cameras, since it \
             is not theirs alone: choose another disk, or MJPG."
        )
    })
}

fn trial_time(text: &str) -> Result<Duration, String> {
    within(&TRIAL_S, text).map(Duration::from_secs_f64)
}

/// Bytes per second that go to the disk and stay there.
fn disk_speed(folder: &Path) -> Result<f64> {
    let mut file = files::nameless_in(folder)?;
    // Bytes that no file system can compress away.
    let block: Vec<u8> = (0..1_u64 << 20).map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 51) as u8).collect();
    let start = Instant::now();
    for _ in 0..PROBE_BYTES / block.len() {
        file.write_all(&block).map_err(|e| Error::io(folder, "write in", e))?;
    }
    file.sync_data().map_err(|e| Error::io(folder, "sync in", e))?;
    Ok(PROBE_BYTES as f64 / start.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disk_is_tried_in_a_folder_that_is_there() {
        let folder = tempfile::tempdir().unwrap();
        assert!(disk_speed(folder.path()).unwrap() > 0.0);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let error = disk_speed(&folder.path().join("lab")).unwrap_err().to_string();
        assert!(error.contains("lab does not exist; make it first"), "{error}");
    }

    #[test]
    fn a_disk_that_is_too_slow_is_held_against_what_it_should_take() {
        assert_eq!([slow_disk(37e6, 18.4e6), slow_disk(1e6, 0.0)], [None, None]);
        let said = slow_disk(30e6, 18.4e6).unwrap();
        assert!(said.starts_with("the disk takes 30.0 MB/s, and should take 36.8 MB/s, 2 times the 18.4 MB/s of the cameras"), "{said}");
    }
}
