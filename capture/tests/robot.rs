//! A robot on the network, recorded: the log must be the robot's own, byte for byte.

mod lab;

use std::path::Path;
use std::thread;

use clap::Parser;
use lab::{Master, Publisher, wait_for};
use raven::cli::Outcome;
use raven::log::{Item, MotorSource, RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, Recording, Stamp, Walker, topics};

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
