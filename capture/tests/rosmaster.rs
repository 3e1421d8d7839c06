//! The subscriber against ROS's own master and publishers of its own, where they are installed.

mod lab;

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use clap::Parser;
use lab::{DEFINITION, Publisher, TYPE, aloud, md5sum, numbers, python, wait_for};
use raven::cli::Outcome;
use raven_capture::ros1::{Endpoint, call_ros};

/// A `rosmaster` that ends with the test.
struct RosMaster(Child);

impl RosMaster {
    /// `None`, with a word about it, where it is not installed.
    fn start(at: &Endpoint, folder: &Path) -> Option<Self> {
        let mut command = Command::new("rosmaster");
        command.args(["--core", "-p", &at.port.to_string()]).env("ROS_HOME", folder).env("ROS_LOG_DIR", folder);
        let Ok(child) = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn() else {
            aloud("SKIPPED: rosmaster is not installed (Debian: python3-rosmaster): nothing is tested against ROS itself");
            return None;
        };
        wait_for("rosmaster", || call_ros("rosmaster", at, "getPid", &["/test".into()]).is_ok());
        Some(Self(child))
    }
}

impl Drop for RosMaster {
    fn drop(&mut self) {
        let _gone = self.0.kill();
        let _gone = self.0.wait();
    }
}

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
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let at = Endpoint { host: "127.0.0.1".to_owned(), port };
    let Some(_master) = RosMaster::start(&at, folder.path()) else { return };
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
    let robot = format!("ros://127.0.0.1:{port}/numbers");
    let mut recorder = Command::new(env!("CARGO_BIN_EXE_raven-capture"))
        .args(["record", "--robot", &robot, "--min-space", "1", "-o", file.to_str().unwrap()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    publish(0, 2000);
    publish(2000, 4000);
    assert!(Command::new("kill").args(["-INT", &recorder.id().to_string()]).status().unwrap().success());
    // One connection was lost, and no message with it.
    assert_eq!(recorder.wait().unwrap().code(), Some(3));
    assert_eq!(numbers(&file, "/ravenstate"), ((0..4000).collect(), true));
}

#[test]
fn a_recording_through_rosmaster_and_its_restart() {
    let folder = tempfile::tempdir().unwrap();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let at = Endpoint { host: "127.0.0.1".to_owned(), port };
    let Some(master) = RosMaster::start(&at, folder.path()) else { return };
    let first = Publisher::start(&at, "/numbers");
    let file = folder.path().join("session.mcap");
    let outcome = thread::scope(|scope| {
        let recording = scope.spawn(|| {
            let robot = format!("ros://127.0.0.1:{port}/numbers");
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
        let _master = RosMaster::start(&at, folder.path());
        let third = Publisher::start(&at, "/numbers");
        wait_for("the subscriber of the third", || third.subscribers() == 1);
        third.stream(2000..2500, 1000.0, || true);
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(numbers(&file, "/ravenstate"), ((0..2500).collect(), true));
}
