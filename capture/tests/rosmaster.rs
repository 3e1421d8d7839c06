//! The subscriber against ROS's own master, where it is installed.

mod lab;

use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;

use clap::Parser;
use lab::{Publisher, numbers, wait_for};
use raven::cli::Outcome;
use raven_capture::ros1::{Endpoint, call_ros};

/// A `rosmaster` that ends with the test.
struct RosMaster(Child);

impl RosMaster {
    fn start(at: &Endpoint, folder: &Path) -> Self {
        let mut command = Command::new("rosmaster");
        command.args(["--core", "-p", &at.port.to_string()]).env("ROS_HOME", folder).env("ROS_LOG_DIR", folder);
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        wait_for("rosmaster", || call_ros("rosmaster", at, "getPid", &["/test".into()]).is_ok());
        Self(child)
    }
}

impl Drop for RosMaster {
    fn drop(&mut self) {
        let _gone = self.0.kill();
        let _gone = self.0.wait();
    }
}

#[test]
fn a_recording_through_rosmaster_and_its_restart() {
    if Command::new("rosmaster").arg("--help").output().is_err() {
        eprintln!("SKIPPED: rosmaster is not installed (apt-get install python3-rosmaster): nothing is tested against ROS itself");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let at = Endpoint { host: "127.0.0.1".to_owned(), port };
    let master = RosMaster::start(&at, folder.path());
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
