//! What was diagnosed is put into the robot file, and the recording is diagnosed against that.

use raven_tests::{json, typed};

#[test]
fn an_effect_that_is_in_the_file_is_not_named_again() {
    let folder = tempfile::tempdir().unwrap();
    raven::robot::nominal::gold().write(&folder.path().join("robot.yaml")).unwrap();
    // What slipped before a recording is no number of the robot, and is not in its file.
    let words = ["simulate", "--motion", "rich", "--duration", "16", "--effect", "cable-slip:elbow=8,0.01", "--seed", "5"];
    let files = ["--cameras-out", "{cameras.yaml}", "-o", "{log.mcap}"];
    typed(folder.path(), raven_capture::run, &[&words[..], &files].concat()).unwrap();
    let diagnosed = |robot: &str, report: &str| {
        let (robot, file) = (format!("{{{robot}}}"), format!("{{{report}}}"));
        let words = ["{log.mcap}", "--robot", &robot, "--cameras", "{cameras.yaml}", "--json", &file];
        typed(folder.path(), raven_diagnose::run, &words).unwrap();
        json(folder.path(), report)
    };
    let first = diagnosed("robot.yaml", "first.json");
    assert_eq!(first["effects"][0]["id"], "cable-slip", "{:#}", first["effects"]);
    let words = ["--add-effect", "cable-slip:elbow", "--diagnosis", "{first.json}", "--robot", "{robot.yaml}", "-o", "{new.yaml}"];
    typed(folder.path(), raven_identify::run, &words).unwrap();
    let second = diagnosed("new.yaml", "second.json");
    assert_eq!(second["verdict"], "none", "{:#}", second["effects"]);
    // That, half a degree of the elbow, is no gap of the new file.
    let [before, after] = [&first, &second].map(|report| {
        let elbow = report["model_gap"].as_array().unwrap().iter().find(|gap| gap["channel"] == "elbow").unwrap();
        elbow["model"].as_f64().unwrap() / elbow["noise_floor"].as_f64().unwrap()
    });
    assert!(before > 5.0 && after < 1.2, "{before} {after}");
}
