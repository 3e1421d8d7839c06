//! Recordings of an independent plant, and parts of them.

use std::path::Path;

use raven_tests::{json, shared, typed};
use serde_json::Value;

/// The report on a part of a practice recording [s].
fn diagnosed(name: &str, from_s: f64, to_s: f64) -> Option<Value> {
    let log = shared(&format!("data/practice/{name}.mcap"))?;
    let folder = tempfile::tempdir().unwrap();
    cut(&log, [from_s, to_s], folder.path(), "part.mcap");
    let [robot, cameras] = ["robot/raven2-gold.yaml", "data/practice/cameras.yaml"].map(|file| shared(file).unwrap().display().to_string());
    let arguments = ["{part.mcap}", "--robot", &robot, "--cameras", &cameras, "--json", "{report.json}"];
    typed(folder.path(), raven_diagnose::run, &arguments).unwrap();
    Some(json(folder.path(), "report.json"))
}

fn cut(log: &Path, [from_s, to_s]: [f64; 2], folder: &Path, part: &str) {
    let [from, to] = [from_s, to_s].map(|s| s.to_string());
    let part = format!("{{{part}}}");
    typed(folder, raven_capture::run, &["cut", &log.display().to_string(), "--from", &from, "--to", &to, "-o", &part]).unwrap();
}

#[test]
fn a_recording_that_begins_in_a_motion_has_no_effect_that_the_whole_one_lacks() {
    let Some(report) = diagnosed("null-p2", 15.0, 45.0) else { return };
    assert_eq!(report["verdict"], "none", "{:#}", report["effects"]);
}

#[test]
fn a_part_of_a_pair_has_no_third_effect() {
    let Some(report) = diagnosed("p10", 0.0, 46.5) else { return };
    let named: Vec<String> = report["effects"].as_array().unwrap().iter().map(|e| format!("{}:{}", e["id"], e["joint"])).collect();
    assert_eq!(named.len(), 2, "{named:?}");
    for effect in ["pulley-radius", "hysteresis"] {
        assert!(named.iter().any(|named| named.contains(effect)), "{named:?}");
    }
    let radius = report["effects"].as_array().unwrap().iter().find(|effect| effect["id"] == "pulley-radius").unwrap();
    let capstan = &radius["ties"][0];
    assert_eq!([&capstan["id"], &capstan["joint"]], ["capstan-radius", radius["joint"].as_str().unwrap()], "{capstan:#}");
    assert!(capstan["exact"] == true && capstan["gap_nats"] == 0.0, "{capstan:#}");
}

/// Five parts of each of the twelve recordings, as shares of their length.
#[test]
#[ignore = "takes ten minutes; docs/diagnosis.md has its figures"]
fn parts_of_recordings_lead_to_the_verdict_of_the_whole() {
    const PARTS: [[f64; 2]; 5] = [[0.0, 0.62], [0.38, 1.0], [0.19, 0.81], [0.0, 0.45], [0.55, 1.0]];
    let Some(practice) = shared("data/practice") else { return };
    let folder = tempfile::tempdir().unwrap();
    let read = |path: &Path| serde_json::from_str::<Value>(&std::fs::read_to_string(path).unwrap()).unwrap();
    let whole = read(&practice.join("labels.json"));
    let mut labels = serde_json::Map::new();
    for (name, label) in whole.as_object().unwrap() {
        let log = practice.join(format!("{name}.mcap"));
        let length_s = length_s(&log);
        for (k, share) in PARTS.iter().enumerate() {
            let part = format!("{name}-{k}");
            cut(&log, share.map(|share| share * length_s), folder.path(), &format!("{part}.mcap"));
            let mut label = label.clone();
            label["case"] = part.clone().into();
            labels.insert(part, label);
        }
    }
    let text = Value::Object(labels).to_string();
    std::fs::write(folder.path().join("labels.json"), &text).unwrap();
    std::fs::write(folder.path().join("labels.sha256"), format!("{}  labels.json\n", raven::files::sha256_of(text.as_bytes()))).unwrap();
    std::fs::copy(practice.join("cameras.yaml"), folder.path().join("cameras.yaml")).unwrap();
    let [robot, cameras] =
        [shared("robot/raven2-gold.yaml").unwrap(), practice.join("cameras.yaml")].map(|file| file.display().to_string());
    let folder_name = folder.path().display().to_string();
    let arguments = [
        "check",
        &folder_name,
        "--alone",
        "--robot",
        &robot,
        "--cameras",
        &cameras,
        "--verdicts",
        "{verdicts.json}",
        "--json",
        "{score.json}",
    ];
    let (_, printed) = typed(folder.path(), raven_diagnose::run, &arguments).unwrap();
    println!("{printed}");
    let score = json(folder.path(), "score.json");
    assert_eq!(score["false_alarms"]["hits"], 0, "{printed}");
    for share in ["top1_shown", "pairs_shown"] {
        assert_eq!(score[share]["hits"], score[share]["of"], "{share}: {printed}");
    }
}

/// From the first message to the last [s].
fn length_s(log: &Path) -> f64 {
    let [first, last] = raven::log::Survey::of(log).unwrap().span().unwrap();
    last.seconds_since(first)
}
