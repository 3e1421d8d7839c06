//! A lab session recorded by another virtual robot, from its images to the joint angles.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::Command;

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use raven::camera::{Cameras, Pinhole, Quality};
use raven::log::{Item, MotorSource, Recording, TipStatus, Walker, ros1};
use raven::robot::Robot;
use raven_tests::{json, number, python, shared, typed};
use serde_json::{Value, json};

#[test]
fn from_images_to_joint_angles() {
    let Some(lab) = shared("data/lab") else { return };
    goes_through_the_chain(&lab, &json(&lab, "truth.json"), &["sinusoid", "fls1"]);
}

/// Writes a bag, compressed: a line of JSON says what is on which topic, and before each message stand its topic's number, its time and its length.
const TO_BAG: &str = "import json, struct, sys, genpy, rosbag\n\
    with open(sys.argv[1], 'rb') as file, rosbag.Bag(sys.argv[2], 'w', compression='lz4') as bag:\n\
    \x20   topics = json.loads(file.readline())\n\
    \x20   kinds = [type('Kind', (), dict(_type=t['type'], _md5sum=t['md5'], _full_text=t['definition'])) for t in topics]\n\
    \x20   while head := file.read(16):\n\
    \x20       number, seconds, nanoseconds, length = struct.unpack('<4I', head)\n\
    \x20       topic, data = topics[number], file.read(length)\n\
    \x20       message = (topic['type'], data, topic['md5'], kinds[number])\n\
    \x20       bag.write(topic['topic'], message, t=genpy.Time(seconds, nanoseconds), raw=True)\n";

/// Writes the messages of a log as `rosbag` does.
fn to_bag(python: &str, log: &Path, bag: &Path) {
    let (mut topics, mut numbers) = (Vec::new(), BTreeMap::new());
    Walker::open(log)
        .unwrap()
        .run(|item| {
            if let Item::Channel(channel) = item
                && !numbers.contains_key(&channel.topic)
            {
                let schema = channel.schema.as_ref().unwrap();
                let definition = std::str::from_utf8(&schema.data).unwrap();
                let md5 = ros1::md5::md5sum(&ros1::Definition::parse(&schema.name, definition).unwrap()).unwrap();
                numbers.insert(channel.topic.clone(), topics.len() as u32);
                topics.push(json!({"topic": channel.topic, "type": schema.name, "md5": md5, "definition": definition}));
            }
            Ok(())
        })
        .unwrap();
    let messages = bag.with_extension("messages");
    let mut file = BufWriter::new(File::create(&messages).unwrap());
    writeln!(file, "{}", Value::Array(topics)).unwrap();
    Walker::open(log)
        .unwrap()
        .run(|item| {
            if let Item::Message(message) = item {
                let (seconds, nanoseconds) = message.log_time.to_ros();
                for word in [numbers[&message.channel.topic], seconds, nanoseconds, message.data.len() as u32] {
                    file.write_all(&word.to_le_bytes()).unwrap();
                }
                file.write_all(message.data).unwrap();
            }
            Ok(())
        })
        .unwrap();
    file.into_inner().unwrap();
    let written = Command::new(python).args(["-c", TO_BAG]).args([&messages, &bag.to_owned()]).output().unwrap();
    assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
    std::fs::remove_file(messages).unwrap();
}

#[test]
fn bags_of_the_session_go_the_same_way() {
    let Some(lab) = shared("data/lab") else { return };
    let Some(python) = python("rosbag", "Debian: python3-rosbag") else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["board", "hardstop", "sinusoid"] {
        let bag = folder.path().join(format!("{name}.bag"));
        to_bag(python, &lab.join(format!("{name}.mcap")), &bag);
        let import = ["import", &format!("{{{name}.bag}}"), "-o", &format!("{{{name}.mcap}}")];
        typed(folder.path(), raven_capture::run, &import).unwrap();
        std::fs::remove_file(bag).unwrap();
    }
    goes_through_the_chain(folder.path(), &json(&lab, "truth.json"), &["sinusoid"]);
}

/// Calibrates, registers, tracks and identifies from the logs of a folder, the last from the first of `motions`, and holds the outcome against the
/// truth.
fn goes_through_the_chain(logs: &Path, truth: &Value, motions: &[&str]) {
    let Some(robot) = shared("robot/raven2-gold.yaml") else { return };
    let log = |name: &str| logs.join(name).display().to_string();
    let robot = robot.display().to_string();
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();

    let cameras =
        ["cameras", &log("board.mcap"), "--board", "9x6", "--square", "0.012", "-o", "{cameras.yaml}", "--json", "{cameras.json}"];
    typed(at, raven_calibrate::run, &cameras).unwrap();
    let cameras = json(at, "cameras.json");
    for (side, key) in [("left", "/camera/fl"), ("right", "/camera/fr")] {
        let error_px = number(&cameras, &format!("/{side}/fx")) - number(truth, key);
        assert!(error_px.abs() < 0.5, "fx of the {side} camera is off by {error_px} px");
    }
    let baseline_error_m = number(&cameras, "/stereo/baseline_m") - number(truth, "/camera/base");
    assert!(baseline_error_m.abs() < 4e-5, "baseline off by {baseline_error_m} m");

    let register = ["register", &log("hardstop.mcap"), "--robot", &robot, "--cameras", "{cameras.yaml}", "-o", "{cameras.yaml}"];
    typed(at, raven_calibrate::run, &register).unwrap();
    for motion in motions {
        let (input, output) = (log(&format!("{motion}.mcap")), format!("{{{motion}-tracked.mcap}}"));
        typed(at, raven_track::run, &[&input, "--robot", &robot, "--cameras", "{cameras.yaml}", "-o", &output]).unwrap();
    }
    let identify =
        [&*format!("{{{}-tracked.mcap}}", motions[0]), "--robot", &robot, "--cameras", "{cameras.yaml}", "-o", "{identified.yaml}"];
    typed(at, raven_identify::run, &identify).unwrap();
    let identified = raven::robot::Robot::read(&at.join("identified.yaml")).unwrap();
    let hidden_m = number(truth, "/r_l1_m");
    let error = identified.joints[0].link_pulley_radius / hidden_m - 1.0;
    assert!(error.abs() < 0.006, "r_l1 is off by {:.2} %", 100.0 * error);
    // What the motion does not tell stays as it was, and keeps nothing from the controller.
    typed(at, raven_identify::run, &["export", "{identified.yaml}", "--format", "defines", "-o", "{new.h}"]).unwrap();
    assert!(std::fs::read_to_string(at.join("new.h")).unwrap().contains("/* r_l1: 0.0"));

    // The motion that the parameters come from, and one that they have not seen.
    for motion in motions {
        let log = format!("{{{motion}-tracked.mcap}}");
        typed(at, raven_replay::run, &[&log, "--robot", "{identified.yaml}", "--cameras", "{cameras.yaml}", "--json", "{replay.json}"])
            .unwrap();
        let report = json(at, "replay.json");
        let improvement = number(&report, "/joints/0/improvement_percent");
        assert!(improvement >= 43.0, "{motion}: the shoulder is only {improvement:.1} % better than transmission kinematics");
        // Three where the filter is told what the images' errors have in common, two where it is not.
        let nis = number(&report, "/logs/0/nis_mean");
        assert!((nis - 3.0).abs() < 0.5, "{motion}: innovations have a mean square of {nis:.2} instead of 3");
    }
}

/// The cameras that the session was made with, and where they stood.
fn true_cameras(truth: &Value) -> Cameras {
    let of = |key: &str| number(truth, &format!("/camera/{key}"));
    let vector = |key: &str| Vector3::from_fn(|i, _| of(&format!("{key}/{i}")));
    let rotation = |key: &str| {
        let matrix = Matrix3::from_fn(|row, column| of(&format!("{key}/{row}/{column}")));
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
    };
    let camera = |focal_px: f64, side: usize| Pinhole {
        width: 640,
        height: 480,
        fx: focal_px,
        fy: focal_px,
        cx: of(&format!("cx/{side}")),
        cy: of(&format!("cy/{side}")),
        distortion: [of(&format!("k1/{side}")), of(&format!("k2/{side}")), 0.0, 0.0, 0.0],
    };
    // `Rr` has the right camera's axes as columns, in the left one's frame.
    let right_from_left = rotation("Rr").inverse();
    let right_left_m = Vector3::new(of("base"), 0.0, 0.0);
    Cameras {
        left: camera(of("fl"), 0),
        right: camera(of("fr"), 1),
        right_from_left: Isometry3::from_parts((-(right_from_left * right_left_m)).into(), right_from_left),
        base_from_left: Some(Isometry3::from_parts(vector("t").into(), rotation("R"))),
        latency_s: number(truth, "/latency_s"),
        // The stamps have it already.
        right_minus_left_s: 0.0,
        quality: Quality::default(),
    }
}

#[test]
fn tips_err_by_what_they_claim() {
    let (Some(lab), Some(robot_file)) = (shared("data/lab"), shared("robot/raven2-gold.yaml")) else { return };
    let folder = tempfile::tempdir().unwrap();
    true_cameras(&json(&lab, "truth.json")).write(&folder.path().join("cameras.yaml")).unwrap();
    let robot = Robot::read(&robot_file).unwrap();
    for motion in ["sinusoid", "fls1"] {
        let log = lab.join(format!("{motion}.mcap"));
        let [log, robot_file] = [&log, &robot_file].map(|path| path.display().to_string());
        let track = [&*log, "--robot", &robot_file, "--cameras", "{cameras.yaml}", "-o", "{tracked.mcap}"];
        typed(folder.path(), raven_track::run, &track).unwrap();
        let tracked = folder.path().join("tracked.mcap");
        let recording = Recording::read(&tracked, &MotorSource::from(&robot)).unwrap();
        let encoders = recording.require_joint_encoders().unwrap();
        let joints: Vec<usize> =
            robot.joints[..3].iter().map(|joint| encoders.names.iter().position(|name| *name == joint.name).unwrap()).collect();
        let squares = recording.require_tip().unwrap().iter().filter(|tip| tip.status == TipStatus::Seen).filter_map(|tip| {
            let time_s = tip.stamp.seconds_since(recording.start);
            let q: Option<Vec<f64>> = joints.iter().map(|&joint| encoders.interpolate(joint, time_s)).collect();
            let error_m = tip.position_m - robot.arm().ok()?.kinematics.forward(&Vector3::from_vec(q?));
            Some(error_m.dot(&(tip.covariance_m2.try_inverse()? * error_m)) / 3.0)
        });
        let squares: Vec<f64> = squares.collect();
        let mean = squares.iter().sum::<f64>() / squares.len() as f64;
        println!("{motion}: squared error over covariance, per axis, of {} tips: {mean:.3}", squares.len());
        assert!(squares.len() > 300 && (0.7..1.4).contains(&mean), "{motion}: {mean} of {} tips", squares.len());
        std::fs::remove_file(tracked).unwrap();
    }
}
