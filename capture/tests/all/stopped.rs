//! Programs that are stopped before they are done.

use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};

use crate::lab::{signal, wait_for};

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
