//! Transcripts of the command line, and the paper's experiments in short.

use clap::Parser;
use raven::robot::nominal;
use raven::simulation::{Motion, Options, Session};

#[test]
fn transcripts() {
    trycmd::TestCases::new().case("tests/cmd/*.md");
}

/// Even on seconds of recordings the filter must beat what the controller believed, and everything must be left in the folder.
#[test]
fn the_papers_experiments_run_with_one_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let args = raven_replay::Args::parse_from(["raven-replay", "paper", path, "--quick", "--seed", "7"]);
    let mut printed = Vec::new();
    raven_replay::run(args, &mut printed).unwrap();
    let printed = String::from_utf8(printed).unwrap();
    assert!(["Experiment A", "Experiment B", "Table I:", "Table II:", "Experiment D"].iter().all(|title| printed.contains(title)));
    let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.path().join("paper.json")).unwrap()).unwrap();
    let summary = report["trials"]["summary"].as_array().unwrap();
    assert_eq!(summary.len(), 3);
    for (joint, least) in summary.iter().zip([43.0, 33.0, 40.0]) {
        let improvement = joint["improvement_percent"].as_f64().unwrap();
        assert!(improvement > least, "{}: {improvement} %", joint["joint"]);
    }
    assert_eq!(report["trials"]["rows"].as_array().unwrap().len(), 18);
    assert_eq!(report["occlusion"]["runs"].as_array().unwrap().len(), 24);
    for figure in ["positions", "errors", "histograms", "trials", "occlusion"] {
        let svg = std::fs::read(folder.path().join(format!("figure-{figure}.svg"))).unwrap();
        assert!(svg.starts_with(b"<svg") && svg.len() < 300_000, "{figure}: {} bytes", svg.len());
    }
}

#[test]
fn no_tips_are_told_and_nothing_is_better_than_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    nominal::gold().write(&file("robot.yaml")).unwrap();
    let session = Session::new(&nominal::gold(), Options::default()).unwrap();
    session.record(Motion::Hardstop, 3.0, &file("hardstop.mcap"), |_| {}).unwrap();
    let untracked = Session::new(&nominal::gold(), Options { images: true, rate_hz: 1.0, ..Options::default() }).unwrap();
    untracked.record(Motion::Sinusoid, 3.0, &file("untracked.mcap"), |_| {}).unwrap();
    let said = |log: &str| {
        let (log, robot) = (file(log).display().to_string(), file("robot.yaml").display().to_string());
        let mut printed = Vec::new();
        raven_replay::run(raven_replay::Args::parse_from(["raven-replay", &log, "--robot", &robot]), &mut printed).unwrap();
        String::from_utf8(printed).unwrap()
    };
    let hardstop = said("hardstop.mcap");
    assert!(!hardstop.contains(" %  ") && !hardstop.contains("no tip"), "{hardstop}");
    let untracked = said("untracked.mcap");
    assert!(untracked.contains("untracked.mcap has no tip that was seen") && untracked.contains("raven-track"), "{untracked}");
}
