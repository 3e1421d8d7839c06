//! A recording that is diagnosed beside others of its rig, and recordings that are diagnosed together.

use std::path::Path;

use raven_tests::{json, typed};

/// Records the same rig, which is as its files say, into a folder.
fn record(folder: &Path, log: &str, motion: &str, effect: &[&str]) {
    let words = ["simulate", "--robot", "{robot.yaml}", "--cameras-out", "{cameras.yaml}", "--duration", "12", "--seed", "1"];
    let words: Vec<&str> = words.iter().chain(&["--motion", motion, "-o", log]).chain(effect).copied().collect();
    typed(folder, raven_capture::run, &words).unwrap();
}

#[test]
fn other_recordings_of_a_rig_say_how_far_it_is_off() {
    let folder = tempfile::tempdir().unwrap();
    raven::robot::nominal::gold().write(&folder.path().join("robot.yaml")).unwrap();
    // What is behind the others does not matter.
    record(folder.path(), "{today.mcap}", "rich", &["--effect", "tool-length=0.001"]);
    record(folder.path(), "{monday.mcap}", "fls1", &[]);
    record(folder.path(), "{tuesday.mcap}", "fls2", &["--effect", "pulley-radius:elbow=0.05"]);
    let words = ["{today.mcap}", "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "--json", "{report.json}"];
    // One that says nothing of the rig does not keep the others from it.
    record(folder.path(), "{wednesday.mcap}", "sinusoid", &[]);
    let cut = |log: &str, to_s: &str, part: &str| {
        typed(folder.path(), raven_capture::run, &["cut", log, "--from", "0", "--to", to_s, "-o", part]).unwrap();
    };
    cut("{wednesday.mcap}", "3", "{short.mcap}");
    let beside = ["--beside", "{monday.mcap}", "{short.mcap}", "{tuesday.mcap}"];
    let (_, printed) = typed(folder.path(), raven_diagnose::run, &[&words[..], &beside].concat()).unwrap();
    let report = json(folder.path(), "report.json");
    let lost = report["lost"].as_array().unwrap().iter().map(|lost| lost.as_str().unwrap()).collect::<Vec<_>>();
    assert!(lost.len() == 1 && lost[0].contains("short.mcap counts for nothing beside others. No diagnosis: "), "{lost:?}");
    let part = |kind: &str| report["tolerance_parts"][kind].as_f64().unwrap_or_else(|| panic!("{kind}: {:#}", report["tolerance_parts"]));
    assert!(part("pulley-radius") < 0.9 && part("camera-translation") < 0.9, "{:#}", report["tolerance_parts"]);
    assert!(printed.contains("these parts of the file's tolerances count: cable-coupling "), "{printed}");
    cut("{today.mcap}", "8", "{part.mcap}");
    for again in ["{today.mcap}", "{part.mcap}"] {
        let twice = [&words[..], &["--beside", again]].concat();
        let refused = typed(folder.path(), raven_diagnose::run, &twice).unwrap_err();
        assert!(refused.contains("are in ") && refused.contains("would count twice"), "{refused}");
    }
}

#[test]
fn recordings_that_are_diagnosed_together_each_begin_as_the_motion_before_left_them() {
    let folder = tempfile::tempdir().unwrap();
    raven::robot::nominal::gold().write(&folder.path().join("robot.yaml")).unwrap();
    let words = ["simulate", "--motion", "rich", "--duration", "16", "--effect", "cable-slip:elbow=8,0.01", "--seed", "5"];
    let files = ["--cameras-out", "{cameras.yaml}", "-o", "{log.mcap}"];
    typed(folder.path(), raven_capture::run, &[&words[..], &files].concat()).unwrap();
    for [from, to, part] in [["0", "8", "{first.mcap}"], ["8", "16", "{second.mcap}"]] {
        typed(folder.path(), raven_capture::run, &["cut", "{log.mcap}", "--from", from, "--to", to, "-o", part]).unwrap();
    }
    let words = ["{first.mcap}", "{second.mcap}", "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "--json", "{report.json}"];
    typed(folder.path(), raven_diagnose::run, &words).unwrap();
    let report = json(folder.path(), "report.json");
    let [slip] = report["effects"].as_array().unwrap().as_slice() else { panic!("{:#}", report["effects"]) };
    let sizes: Vec<&str> = slip["parameters"].as_array().unwrap().iter().map(|number| number["name"].as_str().unwrap()).collect();
    // How far a cable had slipped before is another number in each, and none of the robot's.
    assert_eq!((slip["id"].as_str().unwrap(), sizes), ("cable-slip", vec!["force", "fraction", "width"]));
    let elbow = report["gap"].as_array().unwrap().iter().find(|gap| gap["channel"] == "elbow").unwrap();
    let [floor, before, after] = ["noise_floor", "before", "after"].map(|key| elbow[key].as_f64().unwrap());
    assert!(before > 10.0 * floor && after < 1.3 * floor, "{elbow}");
}
