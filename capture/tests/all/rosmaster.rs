//! The subscriber against ROS's own master and publishers of its own, where they are installed.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::lab::ros::RosMaster;
use crate::lab::{DEFINITION, Publisher, TYPE, md5sum, numbers, python, signal, wait_for};
use clap::Parser;
use raven::cli::Outcome;

/// A node of ROS's own Python client, publishing numbered messages at 1 kHz, at no more than that when it was late.
const NODE: &str = "import struct, sys, time, rospy\n\
    kind, md5, definition, first, last = sys.argv[1:]\n\
    class Numbered(rospy.AnyMsg):\n\
    \x20   _type, _md5sum, _full_text, _has_header = kind, md5, definition, False\n\
    rospy.init_node('robot', anonymous=True, disable_rosout=True, disable_signals=True)\n\
    publisher = rospy.Publisher('/numbers', Numbered, queue_size=None, tcp_nodelay=True)\n\
    while publisher.get_num_connections() < 1: time.sleep(0.005)\n\
    due = time.monotonic()\n\
    for number in range(int(first), int(last)):\n\
    \x20   now, message = time.time(), Numbered()\n\
    \x20   message._buff = struct.pack('<4IQ', number, int(now), int(now % 1 * 1e9), 0, number) + bytes(956)\n\
    \x20   publisher.publish(message)\n\
    \x20   due += 0.001\n\
    \x20   time.sleep(max(0, due - time.monotonic()))\n\
    print('published', flush=True)\n\
    time.sleep(60)\n";

#[test]
fn every_message_of_rospy_at_1_khz_arrives_and_so_do_those_of_its_successor() {
    let Some(python) = python("rospy", "Debian: python3-rospy, which python3-rosbag brings") else { return };
    let folder = tempfile::tempdir().unwrap();
    let Some(master) = RosMaster::start(folder.path()) else { return };
    let at = &master.at;
    // Published, and killed without a word to the master.
    let publish = |first: u64, last: u64| {
        let mut node = Command::new(python)
            .args(["-W", "ignore", "-c", NODE, TYPE, &md5sum(), DEFINITION, &first.to_string(), &last.to_string()])
            .envs([("ROS_MASTER_URI", at.to_string()), ("ROS_IP", at.host.clone())])
            .env("ROS_HOME", folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(node.stdout.take().unwrap()).read_line(&mut line).unwrap();
        thread::sleep(Duration::from_millis(100));
        node.kill().unwrap();
        node.wait().unwrap();
        assert_eq!(line, "published\n");
    };
    let file = folder.path().join("session.mcap");
    let robot = format!("ros://{}/numbers", at.authority());
    let mut recorder = Command::new(env!("CARGO_BIN_EXE_raven-capture"))
        .args(["record", "--robot", &robot, "--min-space", "1", "-o", file.to_str().unwrap()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    publish(0, 2000);
    publish(2000, 4000);
    signal(&recorder, "-INT");
    // One connection was lost, and no message with it.
    assert_eq!(recorder.wait().unwrap().code(), Some(3));
    assert_eq!(numbers(&file, "/ravenstate"), ((0..4000).collect(), true));
}

#[test]
fn a_recording_through_rosmaster_and_its_restart() {
    let folder = tempfile::tempdir().unwrap();
    let Some(master) = RosMaster::start(folder.path()) else { return };
    let at = master.at.clone();
    let first = Publisher::start(&at, "/numbers");
    let file = folder.path().join("session.mcap");
    let outcome = thread::scope(|scope| {
        let recording = scope.spawn(|| {
            let robot = format!("ros://{}/numbers", at.authority());
            let words = ["raven-capture", "record", "--robot", &robot, "--duration", "8", "--min-space", "1", "-o", file.to_str().unwrap()];
            raven_capture::run(raven_capture::Args::parse_from(words), &mut Vec::new()).unwrap()
        });
        wait_for("the subscriber", || first.subscribers() == 1);
        first.stream(0..1000, 1000.0, || true);
        // A second publisher is announced to those who are there.
        let second = Publisher::start(&at, "/numbers");
        wait_for("the subscriber of the second", || second.subscribers() == 1);
        second.stream(1000..1500, 1000.0, || true);
        second.unregister();
        drop(master);
        first.stream(1500..2000, 1000.0, || true);
        // The new master knows nobody until they tell it.
        let _master = RosMaster::start_at(at.clone(), folder.path());
        let third = Publisher::start(&at, "/numbers");
        wait_for("the subscriber of the third", || third.subscribers() == 1);
        third.stream(2000..2500, 1000.0, || true);
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(numbers(&file, "/ravenstate"), ((0..2500).collect(), true));
}
