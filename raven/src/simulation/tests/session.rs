//! Whole recordings, read back as any program reads them.

use approx::assert_relative_eq;
use nalgebra::Matrix3;

use super::*;
use crate::effects::Sited;
use crate::log::ros1::{Definition, Extractor};
use crate::log::{Item, MotorSource, RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, Recording, TipStatus, Walker, arm_offset, topics};
use crate::robot::{ArmSide, KinematicsKind, Observation, Robot};

fn recorded(robot: &Robot, options: Options, motion: Motion, duration_s: f64) -> (Session, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let session = Session::new(robot, options).unwrap();
    session.record(motion, duration_s, &path, |_| {}).unwrap();
    let log = Recording::read(&path, &MotorSource::from(robot)).unwrap();
    (session, log)
}

fn options(hidden: &[&str]) -> Options {
    Options { effects: effects(hidden), ..Options::default() }
}

#[test]
fn the_log_reads_back_in_si_units_with_the_arms_signs() {
    let robot = nominal::gold();
    let (session, log) = recorded(&robot, options(&[]), Motion::Fls(0), 3.0);
    let (_, trace) = session.run(Motion::Fls(0), 3.0, || {}).unwrap();
    let motor = log.require_motor().unwrap();
    let arm = robot.arm().unwrap();
    assert_eq!(motor.len(), 3000);
    for k in [0, 1500, 2999] {
        let sample = &trace.samples()[k];
        for j in 0..3 {
            // 32-bit degrees of up to 1250 rad.
            assert_relative_eq!(motor.position[j][k], sample.cycle.motor[j], epsilon = 1e-4);
            assert_relative_eq!(motor.effort.as_ref().unwrap()[j][k], sample.cycle.torque[j], epsilon = 1e-6);
            let belief = arm.transmission.joint_from_motor(&sample.cycle.motor)[j];
            assert_relative_eq!(log.controller_joints.as_ref().unwrap().position[j][k], belief, epsilon = 1e-6);
            let step = if j == 2 { 5e-6 } else { std::f64::consts::TAU / 80_000.0 };
            assert!((log.joint_encoders.as_ref().unwrap().position[j][k] - sample.joint[j]).abs() <= 0.501 * step);
        }
    }
    assert_eq!(log.session["motion"], "fls");
    assert_eq!(log.session["arm"], "gold");
    assert!(log.attachments.contains_key("robot.yaml") && log.attachments.contains_key("cameras.yaml"));
}

/// Raw counts of the shoulder's encoder and its motor's angles [rad], as the messages have them.
fn counts_and_angles(robot: &Robot) -> (Vec<f64>, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    Session::new(robot, options(&[])).unwrap().record(Motion::Sinusoid, 3.0, &path, |_| {}).unwrap();
    let definition = Definition::parse(RAVEN_STATE_TYPE, RAVEN_STATE_DEFINITION).unwrap();
    let extractor = Extractor::new(&definition, &["encVals", "mpos"]).unwrap();
    let joint = arm_offset(MotorSource::from(robot).arm);
    let (mut counts, mut angles) = (Vec::new(), Vec::new());
    let mut visit = |item: Item<'_>| {
        if let Item::Message(message) = item
            && message.channel.topic == topics::RAVEN_STATE
        {
            let [encoders, motors] = extractor.walk(message.data).unwrap();
            counts.push(encoders.unwrap().number(joint).unwrap());
            angles.push(motors.unwrap().number(joint).unwrap().to_radians());
        }
        Ok(())
    };
    Walker::open(&path).unwrap().run(&mut visit).unwrap();
    (counts, angles)
}

#[test]
fn counts_have_the_sign_of_the_arm() {
    let mut robot = nominal::gold();
    let turned = |robot: &Robot| {
        let (counts, angles) = counts_and_angles(robot);
        (counts[2999] - counts[0], angles[2999] - angles[0])
    };
    let per_rad = 4000.0 / std::f64::consts::TAU;
    let (counts, angle) = turned(&robot);
    assert!(angle.abs() > 1.0);
    assert_relative_eq!(counts, -angle * per_rad, epsilon = 0.1);
    if let KinematicsKind::Raven(kinematics) = &mut robot.kinematics {
        kinematics.arm = ArmSide::Green;
    }
    let (counts, angle) = turned(&robot);
    assert_relative_eq!(counts, angle * per_rad, epsilon = 0.1);
}

/// Tip observations against the true joints: scatter as claimed, and nothing else.
#[test]
fn the_tip_scatters_about_the_truth_as_its_covariance_says() {
    for hidden in [&[][..], &["time-offset=0.05", "pulley-radius:shoulder=0.05"]] {
        let robot = nominal::gold();
        let (session, log) = recorded(&robot, options(hidden), Motion::Sinusoid, 30.0);
        let (_, trace) = session.run(Motion::Sinusoid, 30.0, || {}).unwrap();
        let kinematics = robot.arm().unwrap().kinematics;
        let (mut nees, mut seen, mut scatter) = (0.0, 0.0, Matrix3::zeros());
        for tip in log.require_tip().unwrap().iter().filter(|t| t.status == TipStatus::Seen) {
            let time_s = tip.stamp.seconds_since(log.start) - session.truth().delays.latency_s;
            let miss = tip.position_m - kinematics.forward(&trace.joint_at(time_s));
            nees += miss.dot(&(tip.covariance_m2.try_inverse().unwrap() * miss)) / 3.0;
            scatter += miss * miss.transpose();
            seen += 1.0;
        }
        // 3 x 430 squares of unit normals: a standard deviation of sqrt(2 / 1290) = 0.039.
        assert!(seen > 400.0);
        assert_relative_eq!(nees / seen, 1.0, epsilon = 0.16);
    }
}

/// Mean miss of the tip [m, frame 0] against what the encoders and the robot file say, with how fast it moved.
fn tip_misses(hidden: &[&str], motion: Motion) -> Vec<(Vector3<f64>, Vector3<f64>, Vector3<f64>)> {
    let robot = stiff();
    let quiet = Options { noise_px: 1e-4, ..options(hidden) };
    let (session, log) = recorded(&robot, quiet, motion, 12.0);
    let (_, trace) = session.run(motion, 12.0, || {}).unwrap();
    let kinematics = robot.arm().unwrap().kinematics;
    log.tip
        .iter()
        .filter(|t| t.status == TipStatus::Seen)
        .map(|tip| {
            let time_s = tip.stamp.seconds_since(log.start);
            let at = |time_s: f64| kinematics.forward(&trace.joint_at(time_s));
            (tip.position_m - at(time_s), (at(time_s + 1e-3) - at(time_s - 1e-3)) / 2e-3, at(time_s))
        })
        .collect()
}

#[test]
fn late_images_show_the_past() {
    for (miss, rate, _) in tip_misses(&["time-offset=0.02"], Motion::Sinusoid) {
        assert!((miss + rate * 0.02).norm() < 1e-4, "{miss} {rate}");
    }
    let drifting = tip_misses(&["clock-drift=0.005"], Motion::Sinusoid);
    for (k, (miss, rate, _)) in drifting.iter().enumerate().take(150) {
        let time_s = k as f64 / 15.0;
        assert!((miss + rate * (0.005 * time_s)).norm() < 0.05 * miss.norm() + 1e-4, "{time_s}: {miss} {rate}");
    }
}

#[test]
fn a_turned_rig_turns_the_tip_about_the_hard_stop() {
    let kinematics = nominal::gold().arm().unwrap().kinematics;
    let stop = kinematics.forward(&pose(0.0, 2.399827721492203_f64.to_degrees(), 0.562));
    // A turn by v in the left camera's frame is one by R v in frame 0, and the observed tip turns the other way.
    let turn = nalgebra::Rotation3::from_scaled_axis(-Vector3::new(0.0, 0.0, -0.025));
    for (miss, _, tip) in tip_misses(&["camera-rotation=0.025,0,0"], Motion::Sinusoid) {
        assert!((miss - (turn * (tip - stop) - (tip - stop))).norm() < 2e-5);
    }
    for (miss, _, _) in tip_misses(&["camera-translation=0.001,0.002,0.003"], Motion::Sinusoid) {
        // x0 = -y, y0 = z, z0 = -x; the rig moves one way and the tip, in its eyes, the other.
        assert_relative_eq!(miss, -Vector3::new(-0.002, 0.003, -0.001), epsilon = 2e-5);
    }
    for (miss, _, _) in tip_misses(&["camera-rotation=0.025,0,0"], Motion::Hardstop) {
        assert!(miss.norm() < 1e-5);
    }
}

/// What a robot file corrects is so in its simulation, and what is hidden is once it has been put into the file.
#[test]
fn what_the_file_corrects_is_in_the_images() {
    let mut robot = nominal::gold();
    robot.observation = Observation { latency: 0.03, rotation: [0.02, -0.01, 0.03], translation: [1e-3, -2e-3, 3e-3], covariance: None };
    let turn = [0.025, -0.01, 0.015];
    let cameras = Session::new(&robot, options(&[])).unwrap().cameras().cloned();
    let turned = Sited::at(&robot, "camera-rotation", None).unwrap().added_to(&robot, cameras.as_ref(), &turn).unwrap();
    for (hides, effect, corrects) in
        [(&robot, vec![], &robot), (&robot, vec!["camera-rotation=0.025,-0.01,0.015"], &turned), (&turned, vec![], &turned)]
    {
        let (session, log) = recorded(hides, Options { noise_px: 1e-4, ..options(&effect) }, Motion::Sinusoid, 10.0);
        let (_, trace) = session.run(Motion::Sinusoid, 10.0, || {}).unwrap();
        let kinematics = robot.arm().unwrap().kinematics;
        let tips = log.tips(corrects).unwrap();
        assert!(tips.len() > 100);
        for tip in tips {
            let miss = tip.position - kinematics.forward(&trace.joint_at(tip.time_s));
            assert!(miss.norm() < 2e-5, "{effect:?}: {miss}");
        }
    }
}

#[test]
fn a_longer_baseline_brings_the_tip_nearer() {
    // Depth is f b / disparity: believing b where b (1 + s) is, everything is at 1 / (1 + s) of its distance.
    for (miss, _, tip) in tip_misses(&["stereo-scale=0.02"], Motion::Sinusoid) {
        let depth = tip.y + 0.43;
        assert_relative_eq!(miss.y, depth * (1.0 / 1.02 - 1.0), max_relative = 0.03);
    }
}

#[test]
fn a_late_right_image_shifts_depth_with_lateral_speed() {
    for (miss, rate, tip) in tip_misses(&["stereo-desync=0.01"], Motion::Sinusoid) {
        // u grows with -z0; the right pixel lags by f (-vz) dt / Z, and disparity grows by as much.
        let depth = tip.y + 0.43;
        let predicted = -depth * (-rate.z) * 0.01 / 0.048;
        assert!((miss.y - predicted).abs() < 0.1 * predicted.abs() + 5e-4, "{} {predicted}", miss.y);
    }
}

#[test]
fn rows_of_a_rolling_shutter_are_late_by_their_place() {
    let delays = Delays::of(&Observation::default(), &effects(&["rolling-shutter=0.04"]));
    assert_relative_eq!(delays.of_row(239.5, 480), 0.0);
    assert_relative_eq!(delays.of_row(479.5, 480), 0.02);
    let (bent, straight) = (tip_misses(&["rolling-shutter=0.04"], Motion::Sinusoid), tip_misses(&[], Motion::Sinusoid));
    let worst = |misses: &[(Vector3<f64>, Vector3<f64>, Vector3<f64>)]| misses.iter().map(|m| m.0.norm()).fold(0.0, f64::max);
    assert!(worst(&bent) > 5e-4 && worst(&straight) < 1e-4);
}

#[test]
fn a_lens_that_bends_more_moves_what_is_far_from_the_middle() {
    let misses = tip_misses(&["lens-distortion=-0.1"], Motion::Sinusoid);
    assert!(misses.iter().map(|m| m.0.norm()).fold(0.0, f64::max) > 5e-4);
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, seed: u64| {
        let path = folder.path().join(name);
        let session = Session::new(&nominal::gold(), Options { seed, hidden: Hidden::Lab, ..Options::default() }).unwrap();
        session.record(Motion::Rich, 2.0, &path, |_| {}).unwrap();
        (std::fs::read(&path).unwrap(), session.truth_json().to_string())
    };
    let (first, again, other) = (write("a.mcap", 7), write("b.mcap", 7), write("c.mcap", 8));
    assert!(first == again);
    assert!(first.0 != other.0 && first.1 != other.1);
}

#[test]
fn the_truth_is_the_sessions_not_the_motions() {
    let robot = nominal::gold();
    let lab = Options { hidden: Hidden::Lab, ..Options::default() };
    let session = Session::new(&robot, lab).unwrap();
    let truth = session.truth_json();
    let radius = truth["link_pulley_radius_m"]["shoulder"].as_f64().unwrap();
    assert!((0.93..0.97).contains(&(radius / 0.063095)), "{radius}");
    assert!((0.010..0.020).contains(&truth["latency_s"].as_f64().unwrap()));
    assert_eq!(truth["effects"][0]["id"], "pulley-radius");
    assert_relative_eq!(truth["effects"][0]["magnitude"].as_f64().unwrap(), radius / 0.063095 - 1.0, epsilon = 1e-12);
}

#[test]
fn hard_stop_and_working_range_are_well_in_view() {
    for arm in [ArmSide::Gold, ArmSide::Green] {
        let mut robot = nominal::gold();
        if let KinematicsKind::Raven(kinematics) = &mut robot.kinematics {
            kinematics.arm = arm;
        }
        let kinematics = robot.arm().unwrap().kinematics;
        let limits = robot.arm().unwrap().limits;
        for seed in 0..10 {
            let session = Session::new(&robot, Options { seed, ..Options::default() }).unwrap();
            let cameras = &session.truth().rig.as_ref().unwrap().actual;
            let mut joints = vec![robot.arm().unwrap().hard_stop];
            for motion in [Motion::Sinusoid, Motion::Fls(seed as u32), Motion::Rich] {
                let path = Trajectory::of(motion, 60.0, &limits, Vector3::zeros(), &mut rng(seed));
                joints.extend((0..600).map(|k| path.at(f64::from(k) * 0.1).joint));
            }
            for joint in joints {
                let pixels = cameras.project_base(&kinematics.forward(&joint)).unwrap();
                let inside = cameras.left.contains(&pixels[0], 12.0) && cameras.right.contains(&pixels[1], 12.0);
                assert!(inside, "{arm:?} seed {seed}: {joint} is at {} and {}", pixels[0], pixels[1]);
            }
        }
    }
}

#[test]
fn a_bench_writes_motor_and_joint() {
    let text = nominal::GOLD_YAML;
    let bench = "format: raven-robot/1\nname: bench\nkinematics: {kind: bench}\nsource: {topic: /motor/joint_states, format: joint_state}\n\
                 joints:\n  - {name: carriage, type: prismatic, gear_ratio: 1.0, motor_capstan_radius: 1.0, link_pulley_radius: 1.0,\n     \
                 motor: {inertia: 95.0, coulomb_friction: 20.0, viscous_friction: 203.5}}\n";
    let tolerances = &text[text.find("tolerances:").unwrap()..];
    let robot = Robot::parse(std::path::Path::new("bench.yaml"), &format!("{bench}{tolerances}")).unwrap();
    let (session, log) = recorded(&robot, options(&["hysteresis:carriage=0.001"]), Motion::Bench, 10.0);
    assert!(session.cameras().is_none() && log.tip.is_empty());
    let (motor, joint) = (log.require_motor().unwrap(), log.require_joint_encoders().unwrap());
    assert_eq!(motor.names, ["carriage"]);
    let gap = motor.position[0].iter().zip(&joint.position[0]).map(|(m, q)| (m - q).abs()).fold(0.0, f64::max);
    assert!((0.00095..0.0013).contains(&gap), "{gap}");
    assert!(motor.effort.as_ref().unwrap()[0].iter().any(|force| force.abs() > 20.0));
    assert!(Session::new(&robot, Options::default()).unwrap().run(Motion::Fls(0), 1.0, || {}).is_err());
    for nowhere in ["payload=0.3", "time-offset=0.05", "camera-rotation=0.02,0,0", "tool-length=0.002", "link-angle:12=0.02"] {
        let refused = Session::new(&robot, options(&[nowhere])).unwrap_err().to_string();
        assert!(refused.contains(nowhere) && refused.contains("on one of its joints (carriage)"), "{refused}");
    }
}

/// A fine encoder behind a gear turns farther than a message's 32 bits count.
#[test]
fn counts_wrap_as_a_counter_does() {
    let mut robot = nominal::gold();
    robot.encoder.as_mut().unwrap().counts_per_revolution = 1e9;
    let (counts, angles) = counts_and_angles(&robot);
    let per_rad = 1e9 / std::f64::consts::TAU;
    let turned: f64 = counts.windows(2).map(|pair| f64::from((pair[1] as i32).wrapping_sub(pair[0] as i32))).sum();
    assert_relative_eq!(turned, -(angles[2999] - angles[0]) * per_rad, max_relative = 1e-4);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let robot = nominal::gold();
    let session = Session::new(&robot, Options::default()).unwrap();
    for (motion, duration_s) in [(Motion::Bench, 1.0), (Motion::Rich, 0.0), (Motion::Rich, f64::NAN)] {
        assert!(matches!(session.run(motion, duration_s, || {}), Err(crate::Error::Argument(_))));
    }
    let board = session.record(Motion::Board, 1.0, std::path::Path::new("/nowhere/board.mcap"), |_| {});
    assert!(board.unwrap_err().to_string().contains("--images"));
    assert!(Session::new(&robot, Options { rate_hz: 0.0, ..Options::default() }).is_err());
    assert!("laboratory".parse::<Hidden>().is_err());
}
