//! `raven-capture record` with cameras that live in the test: frames, losses by cause, unplugging, silence.

mod lab;

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use lab::{Master, Publisher, numbers, wait_for};
use raven::cli::Outcome;
use raven::log::{FrameData, Side, Survey, active_name, frames};
use raven_capture::Command;
use raven_capture::camera::{CameraFault, Driver, Encoding, Frame, Mode, Opened, Stream};
use raven_capture::clock::Arrival;
use raven_capture::devices::Preflight;
use raven_capture::record::record;

const ENODEV: i32 = 19;
/// Frames are sent only after so long, when the recording certainly has begun.
const DELAY: Duration = Duration::from_millis(600);
const INTERVAL_MS: u64 = 10;
const MJPG: Mode = Mode { encoding: Encoding::Mjpg, size_px: [8, 8], interval_s: [1, 100], stride_bytes: 0 };

/// What a camera does when it is opened.
enum Life {
    /// Delivers these frames, the n-th at `n` intervals, and then ends.
    Frames(Vec<(u64, Frame)>, End),
    /// Is not there.
    Absent,
    /// Comes back as something else.
    Other(Mode),
}

/// What a camera does after its last frame.
#[derive(Clone, Copy)]
enum End {
    /// Stays there and says nothing.
    Silence,
    /// Is unplugged.
    Unplugged,
    /// Makes the library panic.
    Panic,
}

/// A camera whose every opening is one life; the last one lasts.
struct Replayed {
    mode: Mode,
    /// When the first frame is due; a later life begins when it is opened.
    start: Option<Start>,
    lives: VecDeque<Life>,
}

/// A moment, also on the monotonic clock (ns).
#[derive(Clone, Copy)]
struct Start(Instant, u64);

impl Start {
    fn soon() -> Self {
        Self(Instant::now() + DELAY, Arrival::now().monotonic_ns + DELAY.as_nanos() as u64)
    }
}

impl Driver for Replayed {
    fn open(&mut self) -> Result<Opened, CameraFault> {
        let (mode, frames, end) = match self.lives.pop_front() {
            Some(Life::Frames(frames, end)) => (self.mode, frames.into(), end),
            Some(Life::Other(mode)) => (mode, VecDeque::new(), End::Silence),
            Some(Life::Absent) | None => {
                return Err(CameraFault::NotFound { wanted: "with serial number L1".into(), found: "none".into() });
            }
        };
        let words = [("card", "Replayed"), ("mode", &mode.to_string()), ("control exposure_time_100us", "95 (found at 40)")];
        let record = words.map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        let start = self.start.take().unwrap_or_else(Start::soon);
        Ok(Opened { stream: Box::new(Playing { start, frames, end }), mode, record, notices: Vec::new() })
    }
}

struct Playing {
    start: Start,
    frames: VecDeque<(u64, Frame)>,
    end: End,
}

impl Stream for Playing {
    fn next(&mut self, within: Duration) -> Result<Option<Frame>, CameraFault> {
        let Some((at_ms, _)) = self.frames.front() else {
            return match self.end {
                End::Silence => {
                    thread::sleep(within);
                    Ok(None)
                }
                End::Unplugged => {
                    let source = std::io::Error::from_raw_os_error(ENODEV);
                    Err(CameraFault::System { action: "get a frame", source })
                }
                End::Panic => panic!("what a driver may do to the library"),
            };
        };
        let left = (self.start.0 + Duration::from_millis(*at_ms)).saturating_duration_since(Instant::now());
        thread::sleep(left.min(within));
        if left > within {
            return Ok(None);
        }
        // Exact stamps, as a kernel gives them; the moment of taking is whatever this machine makes of it.
        Ok(self.frames.pop_front().map(|(at_ms, frame)| Frame {
            kernel_ns: self.start.1 + at_ms * 1_000_000,
            dequeued: Arrival::now(),
            ..frame
        }))
    }
}

/// A JPEG, as far as its ends go, that no other number has.
fn jpeg(number: u32) -> Vec<u8> {
    let middle = (0..500_u32).flat_map(|i| (number.wrapping_mul(2_654_435_761).wrapping_add(i * 40_503) | 0x0101_0101).to_le_bytes());
    [0xff, 0xd8].into_iter().chain(middle).chain([0xff, 0xd9]).collect()
}

fn film(numbers: std::ops::Range<u32>) -> Vec<(u64, Frame)> {
    let frame = |number: u32| Frame { bytes: jpeg(number), sequence: number, flags: 0x1_2001, kernel_ns: 0, dequeued: Arrival::default() };
    numbers.map(|number| (INTERVAL_MS * u64::from(number), frame(number))).collect()
}

fn camera(mode: Mode, lives: Vec<Life>) -> Box<dyn Driver> {
    Box::new(Replayed { mode, start: None, lives: lives.into() })
}

/// Records in this process; gives the outcome, what was printed and the JSON. The cameras of the command line are not opened.
fn recorded(folder: &Path, cameras: Vec<(Side, Box<dyn Driver>)>, more: &[&str]) -> raven::Result<(Outcome, String, serde_json::Value)> {
    let (file, json) = (folder.join("session.mcap"), folder.join("record.json"));
    let words = ["raven-capture", "record", "--left", "serial:L1", "--min-space", "1"];
    let files = ["-o", file.to_str().unwrap(), "--json", json.to_str().unwrap()];
    let Command::Record(args) = raven_capture::Args::parse_from(words.iter().chain(&files).chain(more)).command else { unreachable!() };
    let mut out = Vec::new();
    let outcome = record(&args, cameras, &mut out)?;
    let json = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    Ok((outcome, String::from_utf8(out).unwrap(), json))
}

/// Bytes of the JPEG frames of a camera in a recording.
fn jpegs(file: &Path, side: Side) -> Vec<Vec<u8>> {
    let frames = frames(file).unwrap().map(Result::unwrap).filter(|frame| frame.side == side);
    frames.map(|frame| if let FrameData::Jpeg(bytes) = frame.data { bytes } else { panic!("no JPEG") }).collect()
}

#[test]
fn frames_are_recorded_as_they_came_and_losses_counted_by_cause() {
    let folder = tempfile::tempdir().unwrap();
    let left = film(0..100);
    let sent: Vec<Vec<u8>> = left.iter().map(|(_, frame)| frame.bytes.clone()).collect();
    // The right camera is 4 ms late. Numbers 20 to 22 are lost on the bus, 40 is left out by the camera.
    let mut right = film(0..100);
    right.retain(|(_, frame)| !(20..23).contains(&frame.sequence) && frame.sequence != 40);
    for (at_ms, frame) in &mut right {
        *at_ms += 4;
        frame.sequence -= u32::from(frame.sequence > 40);
    }
    let at = |number: usize| number - 4;
    right[at(60)].1.flags |= 0x40;
    right[at(70)].1.bytes.truncate(700);
    right[at(71)].1.bytes.truncate(700);
    right[at(80)].1.bytes = right[at(79)].1.bytes.clone();
    let kept: Vec<Vec<u8>> = right.iter().filter(|(_, frame)| frame.flags & 0x40 == 0).map(|(_, frame)| frame.bytes.clone()).collect();

    let start = Some(Start::soon());
    let one = |film| -> Box<dyn Driver> { Box::new(Replayed { mode: MJPG, start, lives: [Life::Frames(film, End::Silence)].into() }) };
    let cameras = vec![(Side::Left, one(left)), (Side::Right, one(right))];
    let (outcome, printed, json) = recorded(folder.path(), cameras, &["--duration", "2.2"]).unwrap();
    assert_eq!(outcome, Outcome::DataLost, "{printed}");
    let file = folder.path().join("session.mcap");
    assert!(jpegs(&file, Side::Left) == sent, "every frame of the left camera, byte for byte");
    assert!(jpegs(&file, Side::Right) == kept, "every frame of the right camera but the damaged one");

    let survey = Survey::of(&file).unwrap();
    assert!(survey.damage.is_none());
    let clean = survey.losses[&Side::Left];
    assert_eq!((clean.frames, clean.total()), (100, 0));
    assert_eq!(survey.losses[&Side::Right].causes().map(|(count, _)| count), [3, 1, 1, 2, 1], "{printed}");
    let counted: BTreeMap<Side, serde_json::Value> =
        [(Side::Left, &json["topics"][0]), (Side::Right, &json["topics"][1])].map(|(side, topic)| (side, topic["frames"].clone())).into();
    assert_eq!(serde_json::to_value(&survey.losses).unwrap(), serde_json::to_value(&counted).unwrap(), "recorder and check count alike");
    assert_eq!(json["lost"].as_array().unwrap().len(), 5, "one sentence per cause: {}", json["lost"]);
    let skew = survey.cameras.unwrap();
    assert!((skew.right_minus_left_s - 0.004).abs() < 1e-6 && skew.spread_s < 1e-6, "{skew:?}");
    assert_eq!(survey.records["camera.left"]["card"], "Replayed");
    let mut checked = Vec::new();
    let check = raven_capture::Args::parse_from(["raven-capture", "check", file.to_str().unwrap()]);
    assert_eq!(raven_capture::run(check, &mut checked).unwrap(), Outcome::Done, "the file is whole, whatever the cameras lost");
    let checked = String::from_utf8(checked).unwrap();
    let row = checked.lines().find(|line| line.starts_with("right ")).unwrap();
    assert_eq!(row.split_whitespace().collect::<Vec<_>>(), ["right", "96", "3", "1", "1", "2", "1"], "{checked}");
    for line in ["camera.left: Replayed, MJPG 8x8", "cameras: right minus left 4.00 ms", "clock: the system clock moved"] {
        assert!(checked.contains(line), "{line}: {checked}");
    }
    assert_eq!(survey.records["camera.right"]["mode"], "MJPG 8x8 at 100 frames/s");
}

#[test]
fn a_camera_that_is_unplugged_comes_back_while_the_other_and_the_robot_go_on() {
    const TOPIC: &str = "/numbers";
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let left = vec![Life::Frames(film(0..50), End::Unplugged), Life::Absent, Life::Absent, Life::Frames(film(0..60), End::Silence)];
    let cameras = vec![(Side::Left, camera(MJPG, left)), (Side::Right, camera(MJPG, vec![Life::Frames(film(0..300), End::Silence)]))];
    let at = master.at().to_string();
    let (outcome, printed, json) = thread::scope(|scope| {
        let recording = scope.spawn(|| recorded(folder.path(), cameras, &["--duration", "4.5", "--ros-master", &at, "--topic", TOPIC]));
        wait_for("the subscriber", || publisher.subscribers() == 1);
        publisher.stream(0..3000, 1000.0, || true);
        recording.join().unwrap()
    })
    .unwrap();
    assert_eq!(outcome, Outcome::DataLost, "{printed}");
    let count = |topic: usize, what: &str| json["topics"][topic][what].as_u64().unwrap();
    assert_eq!([count(0, "written"), count(0, "interruptions")], [110, 1], "{json}");
    assert_eq!([count(1, "written"), count(1, "interruptions")], [300, 0], "{json}");
    assert_eq!(json["topics"][1]["frames"]["missed"], 0);
    let file = folder.path().join("session.mcap");
    assert_eq!(jpegs(&file, Side::Left).len(), 110);
    assert_eq!(numbers(&file, TOPIC), ((0..3000).collect(), true));
    // A count that starts again after the plugging is no loss.
    assert_eq!(Survey::of(&file).unwrap().losses[&Side::Left].total(), 0);
}

#[test]
fn a_camera_that_falls_silent_or_breaks_the_library_is_opened_again() {
    // Silence takes two seconds to be noticed.
    for (end, duration) in [(End::Silence, "5"), (End::Panic, "3.4")] {
        let folder = tempfile::tempdir().unwrap();
        let other = Mode { size_px: [16, 8], ..MJPG };
        let lives = vec![Life::Frames(film(0..30), end), Life::Other(other), Life::Frames(film(0..40), End::Silence)];
        let (outcome, printed, json) = recorded(folder.path(), vec![(Side::Left, camera(MJPG, lives))], &["--duration", duration]).unwrap();
        assert_eq!((outcome, &json["topics"][0]["written"]), (Outcome::DataLost, &70.into()), "{printed}{json}");
        assert_eq!(json["topics"][0]["interruptions"], 1);
    }
}

#[test]
fn raw_frames_are_recorded_as_raw_images() {
    let folder = tempfile::tempdir().unwrap();
    let mode = Mode { encoding: Encoding::Yuyv, stride_bytes: 16, ..MJPG };
    let mut film = film(0..50);
    film.iter_mut().for_each(|(_, frame)| frame.bytes = vec![frame.sequence as u8; 128]);
    film[30].1.bytes.truncate(100);
    let cameras = vec![(Side::Right, camera(mode, vec![Life::Frames(film, End::Silence)]))];
    let (outcome, printed, _) = recorded(folder.path(), cameras, &["--duration", "1.7"]).unwrap();
    assert_eq!(outcome, Outcome::DataLost, "{printed}");
    let file = folder.path().join("session.mcap");
    let read: Vec<FrameData> = frames(&file).unwrap().map(|frame| frame.unwrap().data).collect();
    let raw = |number: u8| FrameData::Raw { encoding: "yuv422_yuy2".into(), width: 8, height: 8, step: 16, data: vec![number; 128] };
    assert_eq!(read, (0..50).filter(|number| *number != 30).map(raw).collect::<Vec<_>>());
    assert_eq!(Survey::of(&file).unwrap().losses[&Side::Right].truncated, 1);
}

#[test]
fn without_a_camera_that_was_asked_for_there_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let cameras =
        || vec![(Side::Left, camera(MJPG, vec![Life::Frames(film(0..30), End::Silence)])), (Side::Right, camera(MJPG, vec![Life::Absent]))];
    let said = recorded(folder.path(), cameras(), &[]).unwrap_err().to_string();
    assert_eq!(said, "right camera: no camera with serial number L1; found are none.");
    let file = folder.path().join("session.mcap");
    assert!(!file.exists() && !active_name(&file).exists());
}

#[test]
fn the_preflight_says_what_would_be_lost() {
    let folder = tempfile::tempdir().unwrap();
    let one = |film| camera(MJPG, vec![Life::Frames(film, End::Silence)]);
    // 50 frames per second where the mode promises 100; frame 20 is lost on the bus. 9.5 ms of exposure leave 0.5 ms.
    let mut slow = film(0..40);
    slow.retain(|(_, frame)| frame.sequence != 20);
    slow.iter_mut().for_each(|(at_ms, _)| *at_ms *= 2);
    let cameras = vec![
        ("left".to_owned(), one(film(0..80))),
        ("right".to_owned(), one(slow)),
        ("third".to_owned(), camera(MJPG, vec![Life::Absent])),
    ];
    let preflight = Preflight::run(Vec::new(), cameras, Duration::from_millis(1600), folder.path(), &|| false).unwrap();
    let rates: Vec<f64> = preflight.cameras.iter().map(|camera| camera.achieved_hz).collect();
    assert!((rates[0] - 100.0).abs() < 1e-6 && (rates[1] - 38.0 / 0.78).abs() < 1e-6, "{rates:?}");
    let expected = [
        "left: it exposes for 9.5 ms of 10.0 ms between frames",
        "right: 48.72 frames/s came where the camera promises 100.00.",
        "right: it exposes for 9.5 ms",
        "right: 1 frames that the driver counted but did not deliver.",
        "third: no camera with serial number L1",
    ];
    assert_eq!(preflight.problems.len(), expected.len(), "{:?}", preflight.problems);
    for (problem, start) in preflight.problems.iter().zip(expected) {
        assert!(problem.starts_with(start), "{problem}");
    }
    assert!(preflight.disk_bytes_per_second > 1e6 && preflight.render().contains("left     100.00  100.00"), "{}", preflight.render());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left on the disk");
}

#[test]
fn a_preflight_that_is_stopped_lets_go_of_its_cameras_and_leaves_nothing() {
    let (folder, started) = (tempfile::tempdir().unwrap(), Instant::now());
    let silent = || camera(MJPG, vec![Life::Frames(Vec::new(), End::Silence)]);
    let cameras = vec![("left".to_owned(), camera(MJPG, vec![Life::Frames(film(0..6000), End::Silence)])), ("right".to_owned(), silent())];
    let stopped = || started.elapsed() > Duration::from_millis(300);
    let said = Preflight::run(Vec::new(), cameras, Duration::from_secs(60), folder.path(), &stopped).unwrap_err().to_string();
    assert!(said.contains("stopped before everything was tried"), "{said}");
    // As soon as it looks up; a busy machine may take its time.
    assert!(started.elapsed() < Duration::from_secs(20));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
