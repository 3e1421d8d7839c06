//! `raven-capture record` against a master and publishers that live in the test.

use std::net::{Ipv4Addr, Ipv6Addr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crate::lab::{self, Master, Publisher, aloud, numbers, signal, wait_for};
use clap::Parser;
use raven::cli::Outcome;
use raven::log::{Survey, active_name, topics};
use raven_capture::ros1::{Endpoint, Server};

const TOPIC: &str = "/numbers";

/// Records in this process; gives the outcome, what was printed and the JSON.
fn record(folder: &Path, master: &Endpoint, more: &[&str]) -> (Outcome, String, serde_json::Value) {
    let (file, json) = (folder.join("session.mcap"), folder.join("record.json"));
    let master = master.to_string();
    let words = ["raven-capture", "record", "--ros-master", &master, "--topic", TOPIC, "--min-space", "1"];
    let files = ["-o", file.to_str().unwrap(), "--json", json.to_str().unwrap()];
    let args = raven_capture::Args::parse_from(words.iter().chain(&files).chain(more));
    let mut out = Vec::new();
    let outcome = raven_capture::run(args, &mut out).unwrap();
    let json = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    (outcome, String::from_utf8(out).unwrap(), json)
}

/// The program itself, recording; its file is `session.mcap`.
fn spawn(folder: &Path, master: &Endpoint, shell: &str) -> Child {
    let line = format!(
        "{shell} exec {} record --ros-master {master} --topic {TOPIC} --min-space 1 -o session.mcap",
        env!("CARGO_BIN_EXE_raven-capture")
    );
    Command::new("sh").args(["-c", &line]).current_dir(folder).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn every_message_at_1_khz_is_recorded_and_counted() {
    const COUNT: u64 = 3000;
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let recorded = thread::scope(|scope| {
        let recording = scope.spawn(|| record(folder.path(), &master.at(), &["--duration", "4.5", "--session", "operator=Kim"]));
        wait_for("the subscriber", || publisher.subscribers() == 1);
        publisher.stream(0..COUNT, 1000.0, || true);
        recording.join().unwrap()
    });
    let (outcome, printed, json) = recorded;
    let file = folder.path().join("session.mcap");
    assert_eq!(numbers(&file, TOPIC), ((0..COUNT).collect(), true));
    assert_eq!((outcome, &json["topics"][0]["written"]), (Outcome::Done, &COUNT.into()), "{printed}{json}");
    assert!(json["lost"].as_array().unwrap().is_empty());
    assert!(!active_name(&file).exists());

    let survey = Survey::of(&file).unwrap();
    assert_eq!((survey.session["operator"].as_str(), survey.damage.is_none()), ("Kim", true));
    let topic = survey.topic(TOPIC).unwrap();
    assert_eq!((topic.schema.as_str(), topic.quality.messages, topic.quality.without_stamp), (lab::TYPE, COUNT as usize, 0));
    assert!((topic.rate_hz.unwrap() - 1000.0).abs() < 20.0);
    // 4.5 s and a reading at either end.
    let clock = survey.topic(topics::CLOCK).unwrap().quality.messages;
    assert!((5..=7).contains(&clock), "{clock} readings of the clocks");
}

#[test]
fn a_publisher_that_dies_and_comes_back_is_taken_up_again_and_so_is_its_master() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let at = master.at();
    let (outcome, _, json) = thread::scope(|scope| {
        let recording = scope.spawn(|| record(folder.path(), &at, &["--duration", "8"]));
        let first = Publisher::start(&at, TOPIC);
        wait_for("the subscriber", || first.subscribers() == 1);
        first.stream(0..200, 1000.0, || true);
        // Killed without a word to the master; a successor that came at once would look like a change of publishers.
        drop(first);
        thread::sleep(Duration::from_millis(300));
        let second = Publisher::start(&at, TOPIC);
        wait_for("the subscriber of the second", || second.subscribers() == 1);
        second.stream(200..400, 1000.0, || true);
        // The master goes; whoever is connected stays connected.
        drop(master);
        second.stream(400..600, 1000.0, || true);
        let _master = Master::start(at.port);
        let third = Publisher::start(&at, TOPIC);
        wait_for("the subscriber of the third", || third.subscribers() == 1);
        third.stream(600..800, 1000.0, || true);
        // Goodbyes are no losses: one said, the other from a publisher that the new master never heard of.
        third.unregister();
        thread::sleep(Duration::from_millis(200));
        drop(third);
        drop(second);
        recording.join().unwrap()
    });
    let (numbers, whole) = numbers(&folder.path().join("session.mcap"), TOPIC);
    assert_eq!((numbers, whole), ((0..800).collect(), true));
    assert_eq!((outcome, json["topics"][0]["interruptions"].as_u64()), (Outcome::DataLost, Some(1)), "{json}");
}

#[test]
fn a_robot_is_reached_over_ipv6() {
    if TcpListener::bind((Ipv6Addr::LOCALHOST, 0)).is_err() {
        return aloud("SKIPPED: a robot that is reached over IPv6: this machine has none");
    }
    let folder = tempfile::tempdir().unwrap();
    let master = Master::on(Ipv6Addr::LOCALHOST.into(), 0);
    let (outcome, _, json) = thread::scope(|scope| {
        let recording = scope.spawn(|| record(folder.path(), &master.at(), &["--duration", "2.5"]));
        // A publisher that comes later: the master has to call the recorder.
        wait_for("the recording", || active_name(&folder.path().join("session.mcap")).exists());
        let publisher = Publisher::start(&master.at(), TOPIC);
        wait_for("the subscriber", || publisher.subscribers() == 1);
        publisher.stream(0..500, 1000.0, || true);
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done, "{json}");
    assert_eq!(numbers(&folder.path().join("session.mcap"), TOPIC), ((0..500).collect(), true));
    let session = Survey::of(&folder.path().join("session.mcap")).unwrap().session;
    assert_eq!(session["source /numbers"], format!("ros://[::1]:{}{TOPIC}", master.at().port));
}

#[test]
fn ctrl_c_completes_the_file() {
    for name in ["-INT", "-TERM"] {
        let folder = tempfile::tempdir().unwrap();
        let master = Master::start(0);
        let publisher = Publisher::start(&master.at(), TOPIC);
        let child = spawn(folder.path(), &master.at(), "");
        wait_for("the subscriber", || publisher.subscribers() == 1);
        publisher.stream(0..100, 1000.0, || true);
        // What is under way when the signal comes may be left out.
        thread::sleep(Duration::from_millis(300));
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(numbers(&folder.path().join("session.mcap"), TOPIC), ((0..100).collect(), true));
        assert!(String::from_utf8_lossy(&output.stdout).contains("100 messages"));
    }
}

/// Both signals come while the program is stopped, so that the second finds it before it could finish.
#[test]
fn a_second_ctrl_c_ends_it_at_once_and_leaves_what_was_flushed() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let mut child = spawn(folder.path(), &master.at(), "");
    wait_for("the subscriber", || publisher.subscribers() == 1);
    publisher.stream(0..100, 1000.0, || true);
    let active = active_name(&folder.path().join("session.mcap"));
    wait_for("the messages", || numbers(&active, TOPIC).0.len() == 100);
    ["-STOP", "-INT", "-TERM", "-CONT"].into_iter().for_each(|name| signal(&child, name));
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(numbers(&active, TOPIC), ((0..100).collect(), true));
}

/// A limit on the size of files stands in for a full disk: the write fails in the same place.
#[test]
fn a_disk_that_takes_no_more_ends_the_recording_and_keeps_what_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let child = spawn(folder.path(), &master.at(), "trap '' XFSZ; ulimit -f 1500;");
    wait_for("the subscriber", || publisher.subscribers() == 1);
    let stop = AtomicBool::new(false);
    let (output, published) = thread::scope(|scope| {
        let publishing = scope.spawn(|| publisher.stream(0..10_000, 1000.0, || !stop.load(Ordering::Relaxed)));
        let output = child.wait_with_output().unwrap();
        stop.store(true, Ordering::Relaxed);
        (output, publishing.join().unwrap())
    });
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("ended early") && said.contains("too large"), "{said}");
    let (read, whole) = numbers(&folder.path().join("session.mcap"), TOPIC);
    assert_eq!((&read, whole), (&(0..read.len() as u64).collect(), true));
    let counted = format!("{} messages", read.len());
    assert!(String::from_utf8_lossy(&output.stdout).contains(&counted), "{counted}: {}", String::from_utf8_lossy(&output.stdout));
    let bytes = folder.path().join("session.mcap").metadata().unwrap().len();
    assert!(read.len() > 500 && bytes > 500_000, "{} of {published} messages in {bytes} bytes", read.len());
}

#[test]
fn parts_hold_everything_once() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let (outcome, _, json) = thread::scope(|scope| {
        let recording = scope.spawn(|| record(folder.path(), &master.at(), &["--duration", "4.5", "--split-size", "0.2"]));
        wait_for("the subscriber", || publisher.subscribers() == 1);
        publisher.stream(0..3000, 1000.0, || true);
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done, "{json}");
    let parts = json["files"].as_array().unwrap();
    assert!(parts.len() >= 3, "{parts:?}");
    let mut all = Vec::new();
    for (i, part) in parts.iter().enumerate() {
        let path = Path::new(part.as_str().unwrap());
        assert_eq!(path.file_name().unwrap().to_str().unwrap(), format!("session_{i:03}.mcap"));
        let (numbers, whole) = numbers(path, TOPIC);
        assert!(whole);
        assert_eq!(Survey::of(path).unwrap().session["part"], i.to_string());
        all.extend(numbers);
    }
    assert_eq!(all, (0..3000).collect::<Vec<u64>>());
}

#[test]
fn a_name_that_a_later_part_would_take_ends_no_recording() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let (at, file) = (master.at().to_string(), folder.path().join("session.mcap"));
    let words = ["raven-capture", "record", "--ros-master", &at, "--topic", TOPIC, "--min-space", "1", "--duration", "0.2"];
    let split = ["--split-size", "1", "-o", file.to_str().unwrap()];
    let run = || raven_capture::run(raven_capture::Args::parse_from(words.iter().chain(&split)), &mut Vec::new());
    for (name, must_say) in [("session_003.mcap", "never written over"), ("session_1000.mcap.active", "was cut off")] {
        let part = folder.path().join(name);
        std::fs::write(&part, "someone's data").unwrap();
        let said = run().unwrap_err().to_string();
        assert!(said.contains(name) && said.contains(must_say), "{said}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        std::fs::remove_file(&part).unwrap();
    }
    // Names that no part has.
    for name in ["session_x.mcap", "session_01.mcap", "session_001.json", "other_000.mcap", "session.mcap"] {
        std::fs::write(folder.path().join(name), "").unwrap();
    }
    assert_eq!(run().unwrap(), Outcome::DataLost, "nobody publishes");
}

#[test]
fn a_publisher_that_sends_nonsense_is_left_and_the_rest_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let (outcome, _, json) = thread::scope(|scope| {
        let recording = scope.spawn(|| record(folder.path(), &master.at(), &["--duration", "3"]));
        wait_for("the subscriber", || publisher.subscribers() == 1);
        publisher.stream(0..100, 1000.0, || true);
        // A length of 4 GB: the connection cannot be read on, and is made anew.
        publisher.send(&u32::MAX.to_le_bytes());
        wait_for("the subscriber again", || publisher.subscribers() == 2);
        publisher.stream(100..200, 1000.0, || true);
        // Too short for its definition.
        publisher.send(&[2, 0, 0, 0, 1, 2]);
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::DataLost);
    let topic = &json["topics"][0];
    let counts = ["written", "interruptions", "misfits"].map(|count| topic[count].as_u64().unwrap());
    assert_eq!(counts, [201, 1, 1], "{json}");
}

#[test]
fn what_cannot_be_recorded_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let master = Master::start(0);
    let silent = Server::start(Ipv4Addr::LOCALHOST.into(), 0, |_, _| Err("no ROS here".to_owned())).unwrap();
    let no_master = Endpoint { host: "127.0.0.1".to_owned(), port: silent.port() };
    let fails = |at: &Endpoint, more: &[&str], must_say: &str| {
        let at = at.to_string();
        let file = folder.path().join("session.mcap");
        let words = ["raven-capture", "record", "--ros-master", &at, "--topic", TOPIC, "-o", file.to_str().unwrap()];
        let args = raven_capture::Args::parse_from(words.iter().chain(more));
        let said = raven_capture::run(args, &mut Vec::new()).unwrap_err().to_string();
        assert!(said.contains(must_say), "{said}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    fails(&no_master, &[], "refuses registerSubscriber: no ROS here");
    fails(&master.at(), &["--min-space", "1000000000000"], "make room or choose another disk");
    fails(&master.at(), &["--topic", TOPIC], "`/numbers` would be in the recording twice");
    // What fails too late ends by itself.
    let fails_at_once =
        |more: &[&str], must_say: &str| fails(&master.at(), &[more, &["--duration", "0.2", "--min-space", "1"]].concat(), must_say);
    for (reserved, side) in
        [("/stereo/left/image_raw/compressed", "--left"), ("/stereo/left/image_raw", "--left"), ("/stereo/right/frame_meta", "--right")]
    {
        fails_at_once(&["--topic", reserved, side, "serial:none-has-this"], &format!("`{reserved}` would be in the recording twice"));
    }
    let robot = format!("ros://127.0.0.1:{}{TOPIC}", master.at().port);
    fails_at_once(&["--robot", &robot], "is asked for as `/ravenstate` and as `/numbers`; leave one away");
    let file = folder.path().join("session.mcap");
    for json in [folder.path().join("nowhere/record.json"), file.clone()] {
        let must_say = if json == file { "-o and --json both name" } else { "nowhere does not exist; make it first" };
        fails_at_once(&["--json", json.to_str().unwrap()], must_say);
    }
    for (name, must_say) in [(file.clone(), "never written over"), (active_name(&file), "was cut off")] {
        std::fs::write(&name, "someone's data").unwrap();
        let at = master.at().to_string();
        let words = ["raven-capture", "record", "--ros-master", &at, "--topic", TOPIC, "--min-space", "1", "-o", file.to_str().unwrap()];
        let said = raven_capture::run(raven_capture::Args::parse_from(words), &mut Vec::new()).unwrap_err().to_string();
        assert!(said.contains(must_say), "{said}");
        assert_eq!(std::fs::read(&name).unwrap(), b"someone's data");
        std::fs::remove_file(&name).unwrap();
    }
}
