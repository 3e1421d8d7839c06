//! A blind check that is stopped before it is done.
#![cfg(unix)]

use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn a_check_that_is_stopped_takes_its_folder_along() {
    let folder = tempfile::tempdir().unwrap();
    let entries =
        |at: &std::path::Path| std::fs::read_dir(at).into_iter().flatten().flatten().map(|entry| entry.path()).collect::<Vec<_>>();
    let mut program = Command::new(env!("CARGO_BIN_EXE_raven-diagnose"))
        .args(["check", "--simulate", "50", "--verdicts"])
        .arg(folder.path().join("verdicts.json"))
        .env("TMPDIR", folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    // In the middle of writing into it.
    while entries(folder.path()).iter().all(|folder| entries(folder).is_empty()) {
        assert!(begun.elapsed() < Duration::from_secs(60), "no recording is made");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &program.id().to_string()]).status().unwrap().success());
    assert_eq!(program.wait().unwrap().signal(), Some(2));
    assert_eq!(entries(folder.path()), Vec::<std::path::PathBuf>::new());
}
