//! A robot on the network, recorded: the log must be the robot's own, byte for byte.

use std::path::Path;
use std::thread;

use crate::lab::{JOINT_STATE, JOINTS, Master, Publisher, joint_state, wait_for};
use clap::Parser;
use raven::cli::Outcome;
use raven::log::{Item, MotorSource, RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, Recording, Stamp, Survey, Walker, topics};
use raven::robot::SourceFormat;

/// One message with its channel: schema, definition, sum of the definition, stamp and bytes.
type Kept = (String, Vec<u8>, Option<String>, Stamp, Vec<u8>);

fn robot_messages(path: &Path) -> Vec<Kept> {
    let mut kept = Vec::new();
    Walker::open(path)
        .unwrap()
        .run(|item| {
            if let Item::Message(message) = item
                && message.channel.topic == topics::RAVEN_STATE
            {
                let schema = message.channel.schema.as_ref().unwrap();
                let sum = message.channel.metadata.get("md5sum").cloned();
                kept.push((schema.name.clone(), schema.data.to_vec(), sum, message.publish_time, message.data.to_vec()));
            }
            Ok(())
        })
        .unwrap();
    kept
}

fn run(words: &[&str]) -> Outcome {
    raven_capture::run(raven_capture::Args::parse_from(words), &mut Vec::new()).unwrap()
}

#[test]
fn a_recorded_robot_is_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (simulated, recorded) = (at("simulated.mcap"), at("recorded"));
    run(&["raven-capture", "simulate", "--motion", "sinusoid", "--duration", "1", "-o", &simulated]);
    let sent = robot_messages(Path::new(&simulated));

    let master = Master::start(0);
    let robot = format!("ros://127.0.0.1:{}/raven/state", master.at().port);
    let outcome = thread::scope(|scope| {
        let words = ["raven-capture", "record", "--robot", &robot, "--duration", "3", "--min-space", "1", "-o", &recorded];
        let recording = scope.spawn(move || run(&words));
        let start = || Publisher::of(&master.at(), "/raven/state", RAVEN_STATE_TYPE, RAVEN_STATE_DEFINITION);
        // The controller is started anew between the halves: another publisher of the same type.
        for half in sent.chunks(sent.len() / 2) {
            let publisher = start();
            wait_for("the subscriber", || publisher.subscribers() == 1);
            half.iter().for_each(|(.., data)| publisher.publish_bytes(data));
            publisher.unregister();
            thread::sleep(std::time::Duration::from_millis(200));
        }
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done);
    let recorded = at("recorded.mcap");
    assert_eq!(robot_messages(Path::new(&recorded)), sent);
    let motor = |path: &str| Recording::read(Path::new(path), &MotorSource::default()).unwrap().motor.unwrap();
    let (before, after) = (motor(&simulated), motor(&recorded));
    assert_eq!((before.len(), &before.position), (after.len(), &after.position));
}

#[test]
fn joint_states_are_recorded_as_they_are_and_check_says_what_they_serve() {
    const MESSAGES: u32 = 300;
    let folder = tempfile::tempdir().unwrap();
    let recorded = folder.path().join("crtk.mcap");
    let master = Master::start(0);
    let publisher = Publisher::of(&master.at(), "/PSM1/measured_js", "sensor_msgs/JointState", JOINT_STATE);
    let robot = format!("ros://127.0.0.1:{}/PSM1/measured_js", master.at().port);
    let outcome = thread::scope(|scope| {
        let words =
            ["raven-capture", "record", "--robot", &robot, "--duration", "1.5", "--min-space", "1", "-o", recorded.to_str().unwrap()];
        let recording = scope.spawn(move || run(&words));
        wait_for("the subscriber", || publisher.subscribers() == 1);
        (0..MESSAGES).for_each(|i| publisher.publish_bytes(&joint_state(i)));
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done);
    let kept = robot_messages(&recorded);
    assert!(kept.iter().map(|(.., data)| data).eq(&(0..MESSAGES).map(joint_state).collect::<Vec<_>>()), "byte for byte");
    // The sum that ROS itself has for the type.
    assert_eq!(kept[0].2.as_deref(), Some("3066dcd76a6cfaef579bd0f34173e9fd"));
    assert_eq!(kept[7].3, Stamp(1_700_000_000_007_000_000));

    let source = Survey::of(&recorded).unwrap().motor_source().unwrap();
    assert_eq!((source.topic.as_str(), source.format), (topics::RAVEN_STATE, SourceFormat::JointState));
    let motor = Recording::read(&recorded, &source).unwrap().motor.unwrap();
    assert_eq!((motor.names.as_slice(), motor.len()), (JOINTS.map(String::from).as_slice(), MESSAGES as usize));
    assert!((motor.position[2][200] - 0.2).abs() < 1e-12 && (motor.effort.unwrap()[0][50] - 5.0).abs() < 1e-12);
    let mut checked = Vec::new();
    let check = raven_capture::Args::parse_from(["raven-capture", "check", recorded.to_str().unwrap()]);
    raven_capture::run(check, &mut checked).unwrap();
    let checked = String::from_utf8(checked).unwrap();
    let row = checked.lines().find(|line| line.starts_with("raven-diagnose")).unwrap();
    assert!(row.contains("ready") && row.contains("`source: {topic: /ravenstate, format: joint_state}`"), "{checked}");
}

#[test]
fn the_preflight_holds_the_robots_clock_against_this_machines() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("devices.json");
    let master = Master::start(0);
    let publisher = Publisher::of(&master.at(), "/PSM1/measured_js", "sensor_msgs/JointState", JOINT_STATE);
    let robot = format!("ros://127.0.0.1:{}/PSM1/measured_js", master.at().port);
    let outcome = thread::scope(|scope| {
        let (at, report) = (folder.path().to_str().unwrap(), json.to_str().unwrap());
        let words =
            ["raven-capture", "check", "--devices", "--robot", &robot, "--seconds", "1", "--folder", at, "--json", report, "--no-lock"];
        let trying = scope.spawn(move || run(&words));
        wait_for("the subscriber", || publisher.subscribers() == 1);
        // Stamps of 2023.
        (0..200).for_each(|i| publisher.publish_bytes(&joint_state(i)));
        trying.join().unwrap()
    });
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    assert_eq!((outcome, json["robot"]["received"].as_u64()), (Outcome::DataLost, Some(200)), "{json}");
    assert!(json["robot"]["least_lag_s"].as_f64().unwrap() > 1e7, "{json}");
    let problems = json["problems"].as_array().unwrap();
    assert!(problems.iter().any(|problem| problem.as_str().unwrap().contains("is behind; let one time service keep both")), "{json}");
}
