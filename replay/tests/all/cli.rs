//! Transcripts of the command line, and the paper's experiments in short.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use clap::Parser;
use nalgebra::Matrix3;
use raven::cli::Outcome;
use raven::log::{Item, LogWriter, MotorSource, Recording, Stamp, TipObservation, Walker, topics};
use raven::robot::nominal;
use raven::simulation::{Motion, Options, Session};

/// Runs the program on `words`, of which `{name}` is a file in the folder.
fn replay(folder: &Path, words: &str) -> Result<(Outcome, String), String> {
    let mut printed = Vec::new();
    let outcome = raven_replay::chain::replay(&raven_replay::chain::typed(folder, "raven-replay", words), &mut printed);
    outcome.map(|outcome| (outcome, String::from_utf8(printed).unwrap())).map_err(|error| error.to_string())
}

/// A folder with the nominal robot's file and its cameras', and `log.mcap`, some seconds of a sinusoid with tips.
fn session() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    nominal::gold().write(&folder.path().join("robot.yaml")).unwrap();
    let words = "simulate --motion sinusoid --duration 6 --cameras-out {cameras.yaml} -o {log.mcap}";
    raven_replay::chain::capture(&raven_replay::chain::typed(folder.path(), "raven-capture", words), &mut Vec::new()).unwrap();
    folder
}

/// Writes `log.mcap` again as `altered.mcap`: messages that are kept, and tips as they are changed.
fn alter(folder: &Path, is_kept: impl Fn(&str, f64) -> bool, change: impl Fn(usize, &mut TipObservation)) -> LogWriter {
    let from = folder.join("log.mcap");
    let recording = Recording::read(&from, &MotorSource::default()).unwrap();
    let mut log = LogWriter::computed(&folder.join("altered.mcap")).unwrap();
    let mut channels = HashMap::new();
    let mut copy = |item: Item<'_>| {
        match item {
            Item::Channel(channel) => drop(channels.insert(channel.id, log.copy_channel(channel)?)),
            Item::Message(message) => {
                let topic = message.channel.topic.as_str();
                if topic != topics::TIP && is_kept(topic, message.publish_time.seconds_since(recording.start)) {
                    log.copy_message(channels[&message.channel.id], &message)?;
                }
            }
            Item::Attachment(file) => log.copy_attachment(&file)?,
            Item::Start { .. } | Item::Metadata(..) => {}
        }
        Ok(())
    };
    Walker::open(&from).unwrap().run(&mut copy).unwrap();
    for (k, tip) in recording.tip.iter().enumerate() {
        let mut tip = tip.clone();
        change(k, &mut tip);
        log.tip(&tip).unwrap();
    }
    log
}

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

#[test]
fn what_could_not_be_used_is_told_and_makes_the_exit_code() {
    let folder = session();
    let at = folder.path();
    let replayed = || {
        let (outcome, printed) = replay(at, "{altered.mcap} --robot {robot.yaml} --json {replay.json}").unwrap();
        let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(at.join("replay.json")).unwrap()).unwrap();
        (outcome, printed, json["logs"][0].clone())
    };
    let all = |_: &str, _: f64| true;
    alter(at, all, |_, _| {}).finish().unwrap();
    let (outcome, _, whole) = replayed();
    let tips = whole["tips"].as_u64().unwrap();
    assert!(outcome == Outcome::Done && tips > 50 && whole.get("lost").is_none(), "{whole}");

    // What an external tracker says that knows no covariance.
    alter(at, all, |k, tip| {
        if k < 30 {
            tip.covariance_m2 = Matrix3::zeros()
        }
    })
    .finish()
    .unwrap();
    let (outcome, _, some) = replayed();
    assert!(outcome == Outcome::DataLost && some["tips"].as_u64().unwrap() < tips - 20, "{some}");
    assert!(some["lost"][0].as_str().unwrap().contains("whose covariance is none"), "{some}");
    alter(at, all, |_, tip| tip.covariance_m2 = Matrix3::zeros()).finish().unwrap();
    let (outcome, printed, none) = replayed();
    assert_eq!((outcome, &none["tips"]), (Outcome::DataLost, &0.into()));
    assert!(!printed.contains("no tip that was seen") && printed.contains("follow the motors alone"), "{printed}");

    // Nobody knows where the robot was in a pause of its messages.
    alter(at, |topic, at_s| topic != topics::RAVEN_STATE || !(2.0..3.0).contains(&at_s), |_, _| {}).finish().unwrap();
    let (outcome, _, paused) = replayed();
    assert_eq!((outcome, &paused["restarts"]), (Outcome::DataLost, &1.into()));
    assert!(paused["lost"][0].as_str().unwrap().contains("pause"), "{paused}");

    let mut log = alter(at, all, |_, _| {});
    let start = Recording::read(&at.join("log.mcap"), &MotorSource::default()).unwrap().start;
    let names = nominal::gold().joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
    log.joint_states(topics::JOINT_ENCODERS, Stamp(start.0 + 500_000), &names, &[f64::NAN; 3], None).unwrap();
    log.finish().unwrap();
    let (outcome, _, damaged) = replayed();
    assert_eq!(outcome, Outcome::DataLost);
    assert!(damaged["lost"][0].as_str().unwrap().contains("1 messages without finite numbers"), "{damaged}");
}

#[test]
fn the_output_carries_the_robot_and_the_cameras_it_was_made_with() {
    let folder = session();
    let at = folder.path();
    let attached = |words: &str| {
        replay(at, &format!("{{log.mcap}} --robot {{robot.yaml}} {words} -o {{out.mcap}}")).unwrap();
        let mut attachments = BTreeMap::new();
        let mut take = |item: Item<'_>| {
            if let Item::Attachment(file) = item {
                attachments.insert(file.name, file.data);
            }
            Ok(())
        };
        Walker::open(&at.join("out.mcap")).unwrap().run(&mut take).unwrap();
        attachments
    };
    let own = Recording::read(&at.join("log.mcap"), &MotorSource::default()).unwrap().attachments;
    let mine = std::fs::read_to_string(at.join("cameras.yaml")).unwrap() + "# The same.\n";
    std::fs::write(at.join("mine.yaml"), &mine).unwrap();
    let given = attached("--cameras {mine.yaml}");
    assert_eq!(given.keys().collect::<Vec<_>>(), ["cameras.yaml", "robot.yaml"]);
    assert_eq!(given["cameras.yaml"], mine.as_bytes());
    assert_eq!(attached("").get("cameras.yaml"), own.get("cameras.yaml"));
}

#[test]
fn a_dash_is_standard_output_for_the_plot_and_none_for_a_log() {
    let folder = session();
    let at = folder.path();
    let (_, printed) = replay(at, "{log.mcap} --robot {robot.yaml} --plot - --json {replay.json}").unwrap();
    assert!(printed.starts_with("<svg") && printed.trim_end().ends_with("</svg>") && at.join("replay.json").exists(), "{printed}");
    let both = replay(at, "{log.mcap} --robot {robot.yaml} --plot - --json -").unwrap_err();
    assert!(both.contains("--json and --plot are both `-`"), "{both}");
    let log = replay(at, "{log.mcap} --robot {robot.yaml} -o -").unwrap_err();
    assert!(log.contains("-o -") && log.contains("name a file"), "{log}");
    assert!(!Path::new("-").exists());
}
