//! A disk that fills up while webcams and a robot are recorded: the recording ends by itself, and everything up to the last chunk is kept.

mod lab;

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use lab::readers::counts_by_pypi;
use lab::{Master, Publisher, aloud, example, numbers, wait_for};
use raven::log::{Survey, topics};

const TOPIC: &str = "/numbers";
/// Size of the disk [MB]: some seconds of two webcams.
const DISK_MB: f64 = 8.0;
/// What may be missing at the end of a full disk [MB]: the chunk that did not fit any more.
const CHUNK_MB: f64 = 1.1;

/// A disk of its own for a recording, whose files are then copied out: FOLDER SIZE PROGRAM ARGUMENTS...
const ON_SMALL_DISK: &str = "disk=$(mktemp -d); mount -t tmpfs -o size=$2 small $disk || exit 99\n\
    out=$1; shift 2\n\
    \"$@\" -o $disk/session.mcap; status=$?\n\
    cp $disk/* $out; exit $status\n";

/// Records on a small disk until it is full; `None`, with a line that says so, where nobody may mount one.
fn recorded(folder: &Path, min_space: &str) -> Option<Output> {
    let program = match example("replayed_lab") {
        Ok(program) => program,
        Err(why) => {
            aloud(&format!("SKIPPED: recordings on a disk that fills up: {why}"));
            return None;
        }
    };
    // Whoever may make a name space of his own is its root.
    let may = Command::new("unshare").args(["-rm", "true"]).output().is_ok_and(|output| output.status.success());
    if !may {
        aloud("SKIPPED: recordings on a disk that fills up: this user may not mount one (unshare -rm)");
        return None;
    }
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let recorder = Command::new("unshare")
        .args(["-rm", "sh", "-c", ON_SMALL_DISK, "sh", folder.to_str().unwrap(), &format!("{}", 1e6 * DISK_MB)])
        .arg(program)
        .args(["record", "--left", "serial:L1", "--right", "serial:R1", "--ros-master", &master.at().to_string()])
        .args(["--topic", TOPIC, "--min-space", min_space])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_for("the subscriber", || publisher.subscribers() == 1);
    let stop = AtomicBool::new(false);
    Some(thread::scope(|scope| {
        scope.spawn(|| publisher.stream(0..100_000, 1000.0, || !stop.load(Ordering::Relaxed)));
        let output = recorder.wait_with_output().unwrap();
        stop.store(true, Ordering::Relaxed);
        output
    }))
}

fn fills(min_space: &str, must_say: &str, least_mb: f64) {
    let folder = tempfile::tempdir().unwrap();
    let Some(output) = recorded(folder.path(), min_space) else { return };
    let (said, printed) = (String::from_utf8_lossy(&output.stderr), String::from_utf8_lossy(&output.stdout));
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("ended early") && said.contains(must_say), "{said}");
    let file = folder.path().join("session.mcap");
    let survey = Survey::of(&file).unwrap();
    assert_eq!(survey.damage, None);
    let megabytes = survey.bytes as f64 * 1e-6;
    assert!(megabytes > least_mb, "{megabytes} MB: {said}");
    let (read, whole) = numbers(&file, TOPIC);
    assert!(whole && read.len() > 500 && read == (0..read.len() as u64).collect::<Vec<_>>(), "{} messages", read.len());
    let row = |topic: &str| printed.lines().find(|line| line.starts_with(topic)).unwrap().split_whitespace().nth(1).unwrap().to_owned();
    for topic in [TOPIC, topics::LEFT_COMPRESSED, topics::RIGHT_COMPRESSED] {
        assert_eq!(row(topic), survey.topic(topic).unwrap().quality.messages.to_string(), "{printed}");
    }
    if let Some(counts) = counts_by_pypi(&[file.display().to_string()]) {
        assert_eq!(counts[0][TOPIC], read.len());
    }
}

#[test]
fn a_recording_on_a_disk_that_fills_up_ends_and_keeps_everything() {
    fills("0", "No space left on device", DISK_MB - CHUNK_MB);
}

#[test]
fn a_recording_ends_when_less_is_free_than_must_stay_free() {
    fills("4", "--min-space keeps 4 MB free", DISK_MB - 4.0 - CHUNK_MB);
}
