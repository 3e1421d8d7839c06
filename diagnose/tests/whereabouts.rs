//! Where the gap lies in a recording of another plant, and that a report can be repeated.

use std::path::{Path, PathBuf};

use clap::Parser;
use raven::robot::nominal;
use raven::simulation::{Motion, Options, SealedFolder, Session};
use raven_diagnose::{Args, run};
use raven_tests::shared;
use serde_json::Value;

/// The report on a recording as JSON and HTML, with these arguments more.
fn report(log: &Path, robot: &Path, cameras: &Path, more: &[&str]) -> (Value, String) {
    let case = log.file_stem().unwrap().display();
    let out = |end: &str| PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{case}.{end}"));
    let (json, html) = (out("json"), out("html"));
    let [log, robot, cameras, json_arg, html_arg] = [log, robot, cameras, &json, &html].map(|path| path.display().to_string());
    let line = ["raven-diagnose", &log, "--robot", &robot, "--cameras", &cameras, "--json", &json_arg, "--html", &html_arg];
    run(Args::try_parse_from(line.iter().chain(more)).unwrap(), &mut Vec::new()).unwrap();
    (serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap(), std::fs::read_to_string(html).unwrap())
}

#[test]
fn nothing_stands_out_in_what_the_cameras_see_of_the_exact_model() {
    let files = ["data/practice/null-exact-p1.mcap", "robot/raven2-gold.yaml", "data/practice/cameras.yaml"].map(shared);
    let [Some(log), Some(robot), Some(cameras)] = files else { return };
    let (report, html) = report(&log, &robot, &cameras, &["--gap-only"]);
    let places = report["where"].as_array().unwrap();
    assert!(!places.is_empty());
    for place in places {
        for key in ["stage", "joint", "phase", "share_of_excess", "share_of_time", "p"] {
            assert!(place.get(key).is_some(), "{key} of {place}");
        }
        // That plant's friction holds as a set, which shows in its motors.
        assert!(place["stage"] == "motor" || place["p"].as_f64().unwrap() > 0.05, "{place}");
    }
    assert!(!report["where_in_words"].as_array().unwrap().is_empty());
    assert!(html.contains("<svg") && html.contains("Where it lies") && !html.contains("NaN"));
}

#[test]
fn no_part_of_an_exact_motion_stands_out() {
    let folder = tempfile::tempdir().unwrap();
    let [robot, cameras] = ["robot.yaml", "cameras.yaml"].map(|name| folder.path().join(name));
    std::fs::write(&robot, nominal::GOLD_YAML).unwrap();
    for seed in [203, 205, 208] {
        let log = folder.path().join(format!("exact-{seed}.mcap"));
        let session = Session::new(&nominal::gold(), Options { seed, ..Options::default() }).unwrap();
        session.record(Motion::Fls(0), 60.0, &log, |_| {}).unwrap();
        session.cameras().unwrap().write(&cameras).unwrap();
        let (report, _) = report(&log, &robot, &cameras, &["--gap-only"]);
        assert_eq!(
            report["where_in_words"],
            serde_json::json!(["No part of the motion stands out (family-wise level 0.05)."]),
            "seed {seed}"
        );
    }
}

#[test]
fn equal_recordings_give_equal_reports() {
    let folder = tempfile::tempdir().unwrap();
    let [robot, cameras, log] = ["robot.yaml", "cameras.yaml", "repeated.mcap"].map(|name| folder.path().join(name));
    let effects = vec!["pulley-radius:elbow=0.03".parse().unwrap()];
    let options = Options { seed: 20, effects, rate_hz: 15.0, noise_px: 0.2, ..SealedFolder::options() };
    let session = Session::new(&nominal::gold(), options).unwrap();
    session.record(Motion::Rich, 20.0, &log, |_| {}).unwrap();
    session.cameras().unwrap().write(&cameras).unwrap();
    std::fs::write(&robot, nominal::GOLD_YAML).unwrap();
    let first = report(&log, &robot, &cameras, &[]);
    assert_eq!(first.0["effects"][0]["id"], "pulley-radius", "{}", first.0["effects"]);
    assert_eq!(first, report(&log, &robot, &cameras, &[]));
}
