//! Ten minutes of two webcams and a robot at 1 kHz in one process: nothing lost, memory flat, a small part of one processor. On request, since it
//! takes its time:
//!
//!     cargo test --release -p raven-capture --test soak -- --ignored --nocapture
//!
//! Beside it, at the same time and from the same publisher, the robot's topic alone is recorded by this program and, where ROS is installed, by
//! `rosbag record`. `SOAK_SECONDS` makes it shorter or longer.

mod lab;

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use lab::film::pictures;
use lab::ros::RosMaster;
use lab::{Master, Publisher, example, numbers, signal, wait_for};
use raven::log::{Side, Survey, topics};
use raven_capture::ros1::Endpoint;
use rustix::time::{ClockId, clock_gettime};

const TOPIC: &str = "/ravenstate";
/// Debian's program behind `rosbag record`; the one in Python only starts it.
const ROSBAG: &str = "/usr/lib/rosbag/record";
/// Between two looks at memory and processor time.
const SAMPLE: Duration = Duration::from_secs(10);
/// Looks that are left out at the start: queues and buffers grow to the size that they keep.
const WARMING: usize = 2;
/// Part of one processor, beside what writing the JPEG bytes costs.
const PROCESSOR: f64 = 0.15;
/// Growth over the whole time that is no growth [MB].
const FLAT_MB: f64 = 4.0;

/// A recorder under way, and what it took at every look: processor time [s] and memory [MB].
struct Recorder {
    name: &'static str,
    child: Child,
    looks: Vec<[f64; 3]>,
}

impl Recorder {
    fn start(name: &'static str, command: &mut Command) -> Self {
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        Self { name, child, looks: Vec::new() }
    }

    fn look(&mut self, at_s: f64) {
        let read = |file: &str| std::fs::read_to_string(format!("/proc/{}/{file}", self.child.id())).unwrap();
        let stat = read("stat");
        // After the name in brackets: the 12th and 13th are time in the program and in the kernel, in 1/100 s.
        let words: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
        let ticks: f64 = [11, 12].map(|i| words[i].parse::<f64>().unwrap()).iter().sum();
        let status = read("status");
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
        let kilobytes: f64 = resident.split_whitespace().next().unwrap().parse().unwrap();
        self.looks.push([at_s, ticks / 100.0, kilobytes * 1024e-6]);
    }

    /// Part of one processor, memory at the end [MB], and its growth by a straight line over the whole time [MB].
    fn took(&self) -> [f64; 3] {
        let looks = &self.looks[WARMING.min(self.looks.len() - 2)..];
        let ([first, cpu_before, _], [last, cpu_after, memory]) = (looks[0], looks[looks.len() - 1]);
        let count = looks.len() as f64;
        let [mean_t, mean_m] = [0, 2].map(|i| looks.iter().map(|look| look[i]).sum::<f64>() / count);
        let slope = looks.iter().map(|[t, _, m]| (t - mean_t) * (m - mean_m)).sum::<f64>()
            / looks.iter().map(|[t, ..]| (t - mean_t).powi(2)).sum::<f64>();
        [(cpu_after - cpu_before) / (last - first), memory, slope * (last - first)]
    }

    /// Ends it as Ctrl-C does.
    fn end(&mut self) -> Option<i32> {
        signal(&self.child, "-INT");
        self.child.wait().unwrap().code()
    }
}

/// Processor time that writing so many bytes of pictures takes, with a sync for every second of two webcams [s].
fn writing_s(folder: &Path, bytes: u64) -> f64 {
    let pictures = pictures(Side::Left);
    let path = folder.join("pictures");
    let mut file = File::create(&path).unwrap();
    let now = || {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    };
    let (before, mut written) = (now(), 0);
    for (number, picture) in pictures.iter().cycle().take(1800).enumerate() {
        file.write_all(picture).unwrap();
        written += picture.len() as u64;
        if number % 60 == 59 {
            file.sync_data().unwrap();
        }
    }
    let took_s = now() - before;
    std::fs::remove_file(path).unwrap();
    took_s * bytes as f64 / written as f64
}

/// ROS's master where it is installed, which `rosbag record` needs, or the test's own.
enum AnyMaster {
    Ros(RosMaster),
    Own(Master),
}

impl AnyMaster {
    fn start(folder: &Path) -> Self {
        RosMaster::start(folder).map_or_else(|| Self::Own(Master::start(0)), Self::Ros)
    }

    fn at(&self) -> Endpoint {
        match self {
            Self::Ros(master) => master.at.clone(),
            Self::Own(master) => master.at(),
        }
    }
}

#[test]
#[ignore = "10 min: two webcams and a robot at 1 kHz, beside rosbag record"]
fn ten_minutes_of_everything_lose_nothing_and_take_no_more_memory() {
    let seconds: f64 = std::env::var("SOAK_SECONDS").map_or(600.0, |text| text.parse().unwrap());
    let replayed = example("replayed_lab").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let master = AnyMaster::start(folder.path());
    let publisher = Publisher::start(&master.at(), TOPIC);
    let robot = format!("ros://{}{TOPIC}", master.at().authority());
    let ours = |program: &Path, name: &str| {
        let mut command = Command::new(program);
        command.args(["record", "--robot", &robot, "--min-space", "1", "-o"]).arg(at(&format!("{name}.mcap")));
        command.arg("--json").arg(at(&format!("{name}.json")));
        command
    };
    let mut recorders = vec![
        Recorder::start("webcams and robot", ours(&replayed, "all").args(["--left", "serial:L1", "--right", "serial:R1"])),
        Recorder::start("robot", &mut ours(Path::new(env!("CARGO_BIN_EXE_raven-capture")), "robot")),
    ];
    let rosbag = matches!(master, AnyMaster::Ros(..)) && Path::new(ROSBAG).exists();
    if rosbag {
        let mut command = Command::new(ROSBAG);
        command.args(["-O"]).arg(at("rosbag.bag")).arg(TOPIC).env("ROS_MASTER_URI", master.at().to_string()).env("ROS_IP", "127.0.0.1");
        recorders.push(Recorder::start("robot by rosbag record", command.env("ROS_HOME", folder.path())));
    } else {
        eprintln!("SKIPPED: rosbag record beside it (Debian: python3-rosmaster, python3-rosbag)");
    }
    let all = recorders.len();
    wait_for("all subscribers", || publisher.subscribers() == all);

    let (stop, start) = (AtomicBool::new(false), Instant::now());
    let (published, lasted_s) = thread::scope(|scope| {
        let publishing = scope.spawn(|| publisher.stream(0..u64::MAX, 1000.0, || !stop.load(Ordering::Relaxed)));
        while start.elapsed().as_secs_f64() < seconds {
            recorders.iter_mut().for_each(|recorder| recorder.look(start.elapsed().as_secs_f64()));
            thread::sleep(SAMPLE.min(Duration::from_secs_f64(seconds / 10.0)));
        }
        recorders.iter_mut().for_each(|recorder| recorder.look(start.elapsed().as_secs_f64()));
        stop.store(true, Ordering::Relaxed);
        (publishing.join().unwrap(), start.elapsed().as_secs_f64())
    });
    // What is under way when the signal comes may be left out.
    thread::sleep(Duration::from_secs(1));
    let ends: Vec<Option<i32>> = recorders.iter_mut().map(Recorder::end).collect();

    if rosbag {
        let words: [PathBuf; 2] = [at("rosbag.bag"), at("rosbag.mcap")];
        let import = ["raven-capture".into(), "import".into(), words[0].clone(), "-o".into(), words[1].clone()];
        raven_capture::run(raven_capture::Args::parse_from(import), &mut Vec::new()).unwrap();
    }
    let survey = Survey::of(&at("all.mcap")).unwrap();
    let bytes: u64 = [topics::LEFT_COMPRESSED, topics::RIGHT_COMPRESSED].iter().map(|topic| survey.topic(topic).unwrap().bytes).sum();
    let writing = writing_s(folder.path(), bytes) / lasted_s;
    println!("{published} messages published in {lasted_s:.1} s");
    println!("writing the JPEG bytes, {:.1} MB/s, takes {:.2} % of one processor", bytes as f64 * 1e-6 / lasted_s, 100.0 * writing);
    for (recorder, file) in recorders.iter().zip(["all.mcap", "robot.mcap", "rosbag.mcap"]) {
        let read = numbers(&at(file), TOPIC).0;
        let [processor, memory_mb, growth_mb] = recorder.took();
        println!(
            "{}: {} messages, {} lost; {:.2} % of one processor, {memory_mb:.1} MB, growth {growth_mb:.2} MB",
            recorder.name,
            read.len(),
            published - read.len() as u64,
            100.0 * processor
        );
    }
    for (side, losses) in &survey.losses {
        println!("{} webcam: {} frames, {} lost", side.name(), losses.frames, losses.total());
        assert!(losses.total() == 0 && losses.frames as f64 > 29.9 * seconds, "{losses:?}");
    }
    for (end, file) in ends.iter().zip(["all", "robot"]) {
        let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(at(&format!("{file}.json"))).unwrap()).unwrap();
        assert_eq!((end, json["lost"].as_array().unwrap().len()), (&Some(0), 0), "{json}");
        assert_eq!(numbers(&at(&format!("{file}.mcap")), TOPIC), ((0..published).collect(), true));
    }
    let [processor, _, growth_mb] = recorders[0].took();
    assert!(growth_mb < FLAT_MB, "memory grew by {growth_mb} MB");
    assert!(processor - writing < PROCESSOR, "{processor} of one processor");
}
