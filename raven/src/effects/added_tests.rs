//! Effects in a robot file do what they do in the model.

use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use super::*;
use crate::camera::Cameras;
use crate::robot::{ListedEffect, MotorTrack, Observation, nominal};
use crate::simulation::{Options, Session};

fn cameras() -> Cameras {
    Session::new(&nominal::gold(), Options::default()).unwrap().cameras().unwrap().clone()
}

/// A robot that was calibrated before: a corrected registration, which turns about a tip that some effects move.
fn calibrated() -> Robot {
    let observation = Observation { latency: 0.02, rotation: [0.02, -0.01, 0.03], translation: [1e-3, -2e-3, 3e-3], covariance: None };
    let mut robot = nominal::gold();
    robot.observation = observation;
    robot
}

/// All joints to and fro for four seconds.
fn motors() -> MotorTrack {
    let transmission = nominal::gold().arm().unwrap().transmission;
    let time_s: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
    let joint = |t: f64| Vector3::new(0.8 + 0.4 * (1.3 * t).sin(), 1.6 + 0.4 * (1.7 * t).cos(), 0.35 + 0.05 * (2.1 * t).sin());
    MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&joint(t))).collect(), time_s }
}

/// Where the tip is seen [m], and what the drives deliver and need [N m].
fn predicted(model: &Model) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let motors = motors();
    let sight = |k: usize| Sight {
        stamp_s: 0.5 + 0.07 * k as f64,
        position_m: Vector3::zeros(),
        covariance_m2: Matrix3::identity(),
        rows: [0.1, -0.2],
    };
    let sights: Vec<Sight> = (0..45).map(sight).collect();
    let tips = TipModel::new(model, &motors).unwrap().rolled_out(&sights, &[]).0;
    let torque = TorqueModel::new(model).unwrap();
    let torques = (10..390).step_by(10).flat_map(|k| {
        let rate = (motors.angle[k + 1] - motors.angle[k - 1]) / 0.02;
        let acceleration = (motors.angle[k + 1] - motors.angle[k] * 2.0 + motors.angle[k - 1]) / 1e-4;
        let commanded = Command::steady(Vector3::new(0.9, -0.4, 0.5) * (0.3 * k as f64).sin());
        let shaft = Shaft { time_s: motors.time_s[k], angle: motors.angle[k], rate, acceleration, commanded, window_s: 0.0 };
        [torque.needed(&shaft, &torque.rigid_n(&shaft)), torque.delivered(&commanded)]
    });
    (tips.into_iter().map(Option::unwrap).collect(), torques.collect())
}

fn apart(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max)
}

/// Well within the priors; forces, lengths and times short enough to show in this motion.
fn values(sited: &Sited) -> Vec<f64> {
    let value = |(p, u): (&Parameter, f64)| p.value(if p.scale.is_shape() { -1.5 } else { u }, sited.measure);
    sited.effect.parameters.iter().zip([0.7, 0.4, -0.5, 0.3]).map(value).collect()
}

/// What the motion before a recording left is an unknown of every recording, also of an effect that the file has.
#[test]
fn what_the_file_has_begins_as_a_recording_says() {
    let old = nominal::gold();
    for id in ["hysteresis", "creep", "cable-slip"] {
        let sited = Sited::at(&old, id, Some("elbow")).unwrap();
        let state = sited.effect.parameters.iter().position(|parameter| parameter.scale.is_state()).unwrap();
        let tolerance_u = |robot: &Robot| sited.effect.parameters[state].tolerance_u(robot, sited.place, sited.measure).unwrap();
        let mut begun = values(&sited);
        if id == "hysteresis" {
            // So rounded a loop that it has not run through its lag when the tip is first seen.
            begun[1] = 30.0;
        }
        let mut settled = begun.clone();
        settled[state] = 0.0;
        let [without, with] = [settled, begun.clone()].map(|values| sited.added_to(&old, None, &values).unwrap());
        assert_eq!([tolerance_u(&old), tolerance_u(&without)], [0.0, 1.0], "{id}");

        let mut left = vec![0.0; begun.len()];
        left[state] = begun[state] / sited.effect.parameters[state].value(1.0, sited.measure);
        let listed = predicted(&Model::new(&with, None).unwrap()).0;
        let beside = predicted(&Model::with_effects(&without, None, &[(sited, left)]).unwrap()).0;
        assert!(apart(&listed, &beside) < 1e-9, "{id}: {:e}", apart(&listed, &beside));
        let as_filed = predicted(&Model::new(&without, None).unwrap()).0;
        assert!(apart(&listed, &as_filed) > 1e-5, "{id}: {:e}", apart(&listed, &as_filed));
    }
}

#[test]
fn a_file_with_an_effect_predicts_what_the_model_with_it_does() {
    let (old, cameras) = (calibrated(), cameras());
    let nominal = predicted(&Model::new(&old, Some(&cameras)).unwrap());
    let (mut refused, mut idle) = (Vec::new(), Vec::new());
    for sited in Sited::all(&old) {
        let (values, what) = (values(&sited), format!("{} {:?}", sited.effect.id, sited.joint(&old)));
        let new = match sited.added_to(&old, Some(&cameras), &values) {
            Ok(new) => new,
            Err(error) => {
                assert!(error.to_string().contains("calibrate them anew"), "{what}: {error}");
                refused.push(sited.effect.id);
                continue;
            }
        };
        let read = Robot::parse(Path::new("new.yaml"), &new.to_yaml()).unwrap();
        assert_eq!(read, new, "{what}");
        let by_file = predicted(&Model::new(&read, Some(&cameras)).unwrap());
        let by_model = predicted(&Model::new(&old, Some(&cameras)).unwrap().with_values(&sited, &values));
        let finite = |p: &(Vec<Vector3<f64>>, Vec<Vector3<f64>>)| p.0.iter().chain(&p.1).all(|v| v.iter().all(|v| v.is_finite()));
        assert!(finite(&by_file) && finite(&by_model), "{what}: a prediction that is no number");
        let miss = [apart(&by_file.0, &by_model.0), apart(&by_file.1, &by_model.1)];
        assert!(miss.iter().all(|miss| *miss < 1e-9), "{what}: {miss:?}");
        let shown = [apart(&by_file.0, &nominal.0), apart(&by_file.1, &nominal.1)];
        let (miss, shown) = (miss[0].max(miss[1]), shown[0].max(shown[1]));
        if shown < 1e-11 || miss > 1e-2 * shown {
            idle.push(what);
        }
    }
    assert_eq!(refused, ["stereo-scale", "lens-distortion"]);
    // The insertion's motor is faster than that friction lasts.
    assert_eq!(idle, ["stribeck-friction Some(\"insertion\")"]);
}

/// Whoever follows recorded motors through the arm alone sees what the model sees.
#[test]
fn an_arm_drives_its_links_through_listed_laws() {
    let (old, track) = (nominal::gold(), motors());
    for id in ["creep", "cable-slip", "pulley-eccentricity", "missed-counts"] {
        let sited = Sited::at(&old, id, Some("elbow")).unwrap();
        let values = values(&sited);
        let arm = sited.added_to(&old, None, &values).unwrap().arm().unwrap();
        let model = Model::new(&old, None).unwrap().with_values(&sited, &values);
        assert_eq!(arm.driving(&track), model.motors(&old.arm().unwrap(), &track), "{id}");
        assert_ne!(*arm.driving(&track), track, "{id}");
    }
}

#[test]
fn every_effect_has_its_home() {
    let at = |home: Home| ALL.iter().filter(|effect| effect.home() == home).map(|effect| effect.id).collect::<Vec<_>>();
    let listed = [
        "creep",
        "cable-slip",
        "pulley-eccentricity",
        "stribeck-friction",
        "torque-constant",
        "torque-saturation",
        "torque-ripple",
        "clock-drift",
        "stereo-desync",
        "rolling-shutter",
        "missed-counts",
    ];
    assert_eq!(at(Home::List), listed);
    assert_eq!(at(Home::Cameras), ["stereo-scale", "lens-distortion"]);
    assert_eq!(at(Home::Numbers).len(), 21);
}

#[test]
fn two_listed_effects_are_two_effects() {
    let old = nominal::gold();
    let [slip, drift] = [("cable-slip", Some("elbow")), ("clock-drift", None)].map(|(id, joint)| Sited::at(&old, id, joint).unwrap());
    let first = slip.added_to(&old, None, &[5.0, 0.02, 0.1, 0.05]).unwrap();
    let both = drift.added_to(&first, None, &[3e-4]).unwrap();
    let by_model = Model::new(&old, None).unwrap().with_values(&slip, &[5.0, 0.02, 0.1, 0.05]).with_values(&drift, &[3e-4]);
    assert!(apart(&predicted(&Model::new(&both, None).unwrap()).0, &predicted(&by_model).0) < 1e-9);
    let again = slip.added_to(&both, None, &[5.0, 0.02, 0.1, 0.05]).unwrap_err().to_string();
    assert!(again.contains("already"), "{again}");
}

#[test]
fn encoders_stay_as_the_old_file_set_them() {
    let old = nominal::gold();
    let sited = Sited::at(&old, "pulley-radius", Some("shoulder")).unwrap();
    let new = sited.added_to(&old, None, &[-0.05]).unwrap();
    assert_eq!(new.arm().unwrap().transmission.motor_at_hard_stop, old.arm().unwrap().transmission.motor_at_hard_stop);
    // The shoulder's hard stop is at zero, so that the elbow's motor does not hear of the shoulder's pulley.
    let coupling = Sited::at(&old, "cable-coupling", Some("elbow->insertion")).unwrap().added_to(&old, None, &[0.005]).unwrap();
    assert!(coupling.joints[2].motor_at_hard_stop.is_some() && coupling.joints[0].motor_at_hard_stop.is_none());
}

#[test]
fn a_camera_rotation_asks_for_the_cameras() {
    let robot = nominal::gold();
    let sited = Sited::at(&robot, "camera-rotation", None).unwrap();
    let error = sited.added_to(&robot, None, &[0.01, 0.0, 0.0]).unwrap_err().to_string();
    assert!(error.contains("--cameras"), "{error}");
}

#[test]
fn a_list_that_makes_no_sense_is_a_sentence() {
    let entry = |id: &str, joint: Option<&str>, values: &[(&str, f64)]| ListedEffect {
        id: id.to_owned(),
        joint: joint.map(str::to_owned),
        values: values.iter().map(|&(name, value)| (name.to_owned(), value)).collect(),
    };
    let slip = entry("cable-slip", Some("elbow"), &[("force", 9.0), ("fraction", 0.01)]);
    let cases = [
        (vec![entry("cable-slop", Some("elbow"), &[])], "`cable-slop` is no effect"),
        (vec![entry("cable-slip", Some("wrist"), &[])], "`wrist` is given"),
        (vec![entry("cable-slip", None, &[])], "nothing is given"),
        (vec![entry("clock-drift", Some("elbow"), &[("rate", 1e-4)])], "to no joint"),
        (vec![entry("cable-slip", Some("elbow"), &[("force", 9.0)])], "lacks the value `fraction`"),
        (vec![entry("clock-drift", None, &[("rate", 1e-4), ("phase", 0.0)])], "no value `phase`"),
        (vec![entry("clock-drift", None, &[("rate", 400.0)])], "`rate` is 400"),
        (vec![entry("pulley-radius", Some("elbow"), &[("relative_error", 0.01)])], "is a number of this file"),
        (vec![entry("lens-distortion", None, &[("k1", 0.01)])], "camera file"),
        (vec![slip.clone(), slip], "stands there twice"),
    ];
    for (effects, about) in cases {
        let mut robot = nominal::gold();
        robot.effects = effects;
        let error = Robot::parse(Path::new("robot.yaml"), &robot.to_yaml()).unwrap_err().to_string();
        assert!(error.starts_with("robot.yaml: effects[") && error.contains(about), "{error}");
    }
}
