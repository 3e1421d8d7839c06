//! Programs that are stopped before they are done.

use std::net::Ipv4Addr;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use raven_capture::ros1::{Server, Value};

use crate::lab::{signal, wait_for};

/// The program, in this folder.
fn spawn(folder: &Path, words: &[&str]) -> Child {
    let mut program = Command::new(env!("CARGO_BIN_EXE_raven-capture"));
    program.args(words).current_dir(folder).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn a_simulation_that_is_stopped_leaves_nothing() {
    for (name, number) in [("-INT", 2), ("-TERM", 15)] {
        let folder = tempfile::tempdir().unwrap();
        let files = || std::fs::read_dir(folder.path()).unwrap().count();
        let mut program = Command::new(env!("CARGO_BIN_EXE_raven-capture"))
            .args(["simulate", "--motion", "sinusoid", "--duration", "30", "--images", "-o"])
            .arg(folder.path().join("sinusoid.mcap"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        wait_for("the file", || files() > 0);
        signal(&program, name);
        assert_eq!(program.wait().unwrap().signal(), Some(number));
        assert_eq!(files(), 0);
    }
}

/// A camera is put back by whoever drops it, and so is a robot's master told.
#[test]
fn a_preflight_that_is_stopped_ends_by_itself() {
    for name in ["-INT", "-TERM"] {
        let (folder, called) = (tempfile::tempdir().unwrap(), Arc::new(Mutex::new(Vec::new())));
        let calls = Arc::clone(&called);
        let answer = move |method: &str, _: &[Value]| {
            calls.lock().unwrap().push(method.to_owned());
            Ok(Value::success("", Value::List(Vec::new())))
        };
        let master = Server::start(Ipv4Addr::LOCALHOST.into(), 0, answer).unwrap();
        let was_called = |method: &str| called.lock().unwrap().iter().any(|call| call == method);
        let robot = format!("ros://127.0.0.1:{}/ravenstate", master.port());
        let child = spawn(folder.path(), &["check", "--devices", "--robot", &robot, "--seconds", "60"]);
        wait_for("the subscriber", || was_called("registerSubscriber"));
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("stopped before everything was tried"), "{said}");
        assert!(was_called("unregisterSubscriber"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

/// A master that takes its time to answer stands in for cameras that settle.
#[test]
fn a_recording_that_is_stopped_before_it_begins_leaves_no_file() {
    let (folder, asked) = (tempfile::tempdir().unwrap(), Arc::new(AtomicBool::new(false)));
    let reached = Arc::clone(&asked);
    let answer = move |method: &str, _: &[Value]| {
        if method == "registerSubscriber" {
            reached.store(true, Ordering::Relaxed);
            thread::sleep(Duration::from_secs(1));
        }
        Ok(Value::success("", Value::List(Vec::new())))
    };
    let master = Server::start(Ipv4Addr::LOCALHOST.into(), 0, answer).unwrap();
    let robot = format!("ros://127.0.0.1:{}/ravenstate", master.port());
    let child = spawn(folder.path(), &["record", "--robot", &robot, "--min-space", "1", "-o", "session"]);
    wait_for("the call", || asked.load(Ordering::Relaxed));
    signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("stopped before the recording began"), "{said}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
