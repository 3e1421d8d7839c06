//! What becomes of files: nothing that is there is lost.

use std::process::Command;
use std::time::Duration;

use raven::robot::Provenance;

use super::{Folder, change, identified, provenance};

#[test]
fn the_old_file_stays_or_is_kept() {
    let mut robot = identified("gold");
    let folder = Folder::new(&robot);
    std::fs::write(folder.path("new.yaml"), "old").unwrap();
    folder.export("rosparam", None, "new.yaml").unwrap();
    assert_eq!(folder.read("new.yaml.old"), "old");
    let good = folder.read("new.yaml");
    robot.calibration[0].identified = false;
    robot.write(&folder.path("identified.yaml")).unwrap();
    folder.export("rosparam", None, "new.yaml").unwrap_err();
    assert_eq!((folder.read("new.yaml"), folder.read("new.yaml.old")), (good, "old".to_owned()));
}

#[test]
fn what_is_there_is_never_lost() {
    let mut robot = identified("gold");
    let folder = Folder::new(&robot);
    let original = folder.read("r2params.yaml");
    let error = folder.export("r2params", Some("r2params.yaml"), "r2params.yaml").unwrap_err();
    assert!(error.contains("nothing that is read is written over"), "{error}");
    assert_eq!(folder.read("r2params.yaml"), original);

    std::fs::write(folder.path("new.yaml"), "the lab's").unwrap();
    let first = folder.export("rosparam", None, "new.yaml").unwrap();
    robot.name = "again".to_owned();
    robot.write(&folder.path("identified.yaml")).unwrap();
    let second = folder.export("rosparam", None, "new.yaml").unwrap();
    assert_ne!(first, second);
    assert_eq!((folder.read("new.yaml.old"), folder.read("new.yaml.old2")), ("the lab's".to_owned(), first.clone()));
    // What is kept already is not kept twice, and the same file is written as it is.
    std::fs::write(folder.path("new.yaml"), &first).unwrap();
    assert_eq!(folder.export("rosparam", None, "new.yaml").unwrap(), second);
    folder.export("rosparam", None, "new.yaml").unwrap();
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 5);
    // Nor does the result for scripts take the place of what is kept.
    std::fs::write(folder.path("new.yaml"), "another").unwrap();
    let error = folder.run("rosparam", "new.yaml", &["--json", "new.yaml.old3"]).unwrap_err();
    assert!(error.contains("--json") && error.contains("new.yaml.old3"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_and_not_read() {
    let folder = Folder::new(&identified("gold"));
    let pipe = folder.path("pipe.yaml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let ended = folder.run("rosparam", "pipe.yaml", &[]);
        let _ = send.send((ended, folder.path("pipe.yaml.old").exists()));
    });
    let text = std::thread::spawn(move || std::fs::read_to_string(pipe).unwrap());
    let (ended, is_kept) = receive.recv_timeout(Duration::from_secs(10)).expect("the export waits for the pipe");
    assert!(ended.is_ok() && !is_kept && text.join().unwrap().contains("raven_calibration:"));
}

#[test]
fn a_script_reads_what_was_written() {
    let mut robot = identified("gold");
    change(&mut robot, "k_e2", "joints.elbow.cable.stiffness", 80_000.0);
    robot.calibration.push(Provenance { identified: false, ..provenance("offset_1", "joints.shoulder.hard_stop", 0.0, 0.0) });
    let folder = Folder::new(&robot);
    let result = |arguments: &[&str]| -> serde_json::Value {
        let printed = folder.run("defines", "new.h", arguments).unwrap();
        let is_file = arguments[1] != "-";
        assert!(printed.is_empty() == is_file, "{printed}");
        serde_json::from_str(&if is_file { folder.read(arguments[1]) } else { printed }).unwrap()
    };
    let written = result(&["--json", "result.json"]);
    let names: Vec<&str> = written["numbers"].as_array().unwrap().iter().map(|n| n["parameter"].as_str().unwrap()).collect();
    assert_eq!(names, ["r_l1", "r_l2", "r_l3", "offset_2", "coupling_12"]);
    let first = &written["numbers"][0];
    assert_eq!((first["key"].as_str(), first["unit"].as_str()), (Some("joints.shoulder.link_pulley_radius"), Some("m")));
    assert_eq!((first["value"].as_f64(), first["prior"].as_f64(), first["std"].as_f64()), (Some(0.059), Some(0.063095), Some(6.3095e-5)));
    assert_eq!((written["format"].as_str(), written["kept"].as_str()), (Some("defines"), None));
    assert_eq!(written["output"].as_str(), folder.path("new.h").to_str());
    assert_eq!(written["logs"][0]["name"].as_str(), Some("sinusoid.mcap"));
    let warnings = written["warnings"].to_string();
    assert!(warnings.contains("offset_1 was not identified") && warnings.contains("no constant for k_e2"), "{warnings}");

    std::fs::write(folder.path("new.h"), "old").unwrap();
    assert_eq!(result(&["--json", "-"])["kept"].as_str(), folder.path("new.h.old").to_str());
    let error = folder.run("defines", "-", &["--json", "-"]).unwrap_err();
    assert!(error.contains("-o and --json are both `-`"), "{error}");
}
