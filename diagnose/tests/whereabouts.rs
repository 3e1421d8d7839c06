//! Where the gap lies in recordings of another plant.

use std::path::PathBuf;

use clap::Parser;
use raven_diagnose::{Args, run};
use raven_tests::shared;
use serde_json::Value;

/// The report on one practice recording as JSON and HTML, with these arguments more; `None` where the data are not there.
fn report(case: &str, more: &[&str]) -> Option<(Value, String)> {
    let files = [&format!("data/practice/{case}.mcap"), "robot/raven2-gold.yaml", "data/practice/cameras.yaml"];
    let [log, robot, cameras] = files.map(|file| shared(file).map(|path| path.display().to_string()));
    let (log, robot, cameras) = (log?, robot?, cameras?);
    let out = |end: &str| PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{case}.{end}")).display().to_string();
    let (json, html) = (out("json"), out("html"));
    let line = ["raven-diagnose", &log, "--robot", &robot, "--cameras", &cameras, "--json", &json, "--html", &html];
    run(Args::try_parse_from(line.iter().chain(more)).unwrap(), &mut Vec::new()).unwrap();
    Some((serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap(), std::fs::read_to_string(html).unwrap()))
}

#[test]
fn nothing_stands_out_in_what_the_cameras_see_of_the_exact_model() {
    let Some((report, html)) = report("null-exact-p1", &["--gap-only"]) else { return };
    let places = report["where"].as_array().unwrap();
    assert!(!places.is_empty());
    for place in places {
        for key in ["stage", "joint", "phase", "share_of_excess", "share_of_time", "p"] {
            assert!(place.get(key).is_some(), "{key} of {place}");
        }
        assert!(place["stage"] == "motor" || place["p"].as_f64().unwrap() > 0.05, "{place}");
    }
    assert!(!report["where_in_words"].as_array().unwrap().is_empty());
    assert!(html.contains("<svg") && html.contains("Where it lies") && !html.contains("NaN"));
}

#[test]
fn equal_recordings_give_equal_reports() {
    let (Some(first), Some(second)) = (report("p05", &[]), report("p05", &[])) else { return };
    assert_eq!(first, second);
}
