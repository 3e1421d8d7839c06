//! Registration of cameras that are turned any way, from motion alone and with the hard stop: simulated with images, and another virtual lab.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use raven::Error;
use raven::camera::Cameras;
use raven::robot::nominal;
use raven::simulation::{Motion, Options, Session};
use raven_tests::shared;
use serde_json::Value;

use super::real::calibrate;

/// The simulation's cameras, turned by 70 deg about an axis askew through the middle of the workspace.
fn turned(options: &Options) -> Cameras {
    let mut cameras = Session::new(&nominal::gold(), options.clone()).unwrap().cameras().unwrap().clone();
    let usual = cameras.base_from_left.unwrap();
    let middle = (usual * Point3::new(0.0, 0.0, 0.4)).coords;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, -0.7, 0.6).normalize() * 70.0_f64.to_radians());
    let about = Isometry3::from_parts(Translation3::from(middle - turn * middle), turn);
    cameras.base_from_left = Some(about * usual);
    cameras
}

/// The pose in a result.
fn pose(json: &Value) -> Isometry3<f64> {
    let numbers =
        |pointer: &str| -> Vec<f64> { json.pointer(pointer).unwrap().as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&numbers("/base_from_left/rotation")));
    let shift = Vector3::from_column_slice(&numbers("/base_from_left/translation"));
    Isometry3::from_parts(Translation3::from(shift), UnitQuaternion::from_rotation_matrix(&turn))
}

fn three(json: &Value, pointer: &str) -> Vector3<f64> {
    Vector3::from_fn(|i, _| {
        json.pointer(&format!("{pointer}/{i}")).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {json}"))
    })
}

/// Errors over stated deviations: rotation, tip at the hard stop; and the error of a tip in the middle of the view [m].
fn errors(json: &Value, actual: &Isometry3<f64>) -> ([f64; 6], f64) {
    let found = pose(json);
    let turn = (found.rotation * actual.rotation.inverse()).scaled_axis();
    let arm = nominal::gold().arm().unwrap();
    let tip = Point3::from(arm.kinematics.forward(&arm.hard_stop));
    let at_stop = found * actual.inverse_transform_point(&tip) - tip;
    let middle = Point3::new(0.0, 0.0, 0.4);
    let of_turn = turn.component_div(&three(json, "/rotation_std_rad"));
    let of_stop = at_stop.component_div(&three(json, "/translation_std_m"));
    let all = [of_turn.x, of_turn.y, of_turn.z, of_stop.x, of_stop.y, of_stop.z];
    (all, (found * middle - actual * middle).norm())
}

/// A folder with the robot, cameras that know nothing of the robot, and recordings of motions.
pub fn session(options: Options, motions: &[(Motion, f64)]) -> (tempfile::TempDir, Session) {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let session = Session::new(&nominal::gold(), options).unwrap();
    std::fs::write(at("robot.yaml"), nominal::GOLD_YAML).unwrap();
    Cameras { base_from_left: None, ..session.cameras().unwrap().clone() }.write(&at("cameras.yaml")).unwrap();
    for (k, (motion, seconds)) in motions.iter().enumerate() {
        session.record(*motion, *seconds, &at(&format!("{k}.mcap")), |_| ()).unwrap();
    }
    (folder, session)
}

fn register(folder: &Path, log: &str, more: &[&str]) -> raven::Result<(String, Value)> {
    let at = |name: &str| folder.join(name).display().to_string();
    let [log, robot, cameras] = [at(log), at("robot.yaml"), at("cameras.yaml")];
    let fixed = ["register", &log, "--robot", &robot, "--cameras", &cameras, "--rotation", "estimate"];
    calibrate(&[&fixed, more].concat())
}

#[test]
fn cameras_turned_any_way_are_registered_from_motion_alone() {
    let effects = ["pulley-radius:shoulder=-0.03", "time-offset=0.02"].map(|text| text.parse().unwrap()).to_vec();
    let options = Options { seed: 5, effects, images: true, off_nominal: 1.0, ..Options::default() };
    let cameras = Some(turned(&options));
    let (folder, session) = session(Options { cameras, ..options }, &[(Motion::Sinusoid, 20.0), (Motion::Hardstop, 3.0)]);
    let actual = session.truth().rig.as_ref().unwrap().actual.base_from_left.unwrap();

    let (said, json) = register(folder.path(), "0.mcap", &[]).unwrap();
    let (errors_alone, in_view_m) = errors(&json, &actual);
    assert!(errors_alone.iter().all(|e| e.abs() < 4.0) && in_view_m < 0.01, "{errors_alone:?}, {in_view_m} m\n{said}");
    assert!((json["latency_s"].as_f64().unwrap() - 0.02).abs() < 4.0 * json["latency_std_s"].as_f64().unwrap().max(1e-3), "{said}");
    assert!(json["marker_left_m"].is_null() && said.contains("x0=(") && !said.contains("NaN"), "{said}");

    let motion = folder.path().join("0.mcap").display().to_string();
    let (said, json) = register(folder.path(), "1.mcap", &["--motion", &motion]).unwrap();
    let (errors_with_stop, in_view_m) = errors(&json, &actual);
    assert!(errors_with_stop.iter().all(|e| e.abs() < 4.0) && in_view_m < 0.01, "{errors_with_stop:?}, {in_view_m} m\n{said}");
    assert!(json["frames_seen"].as_u64().unwrap() > 5, "{json}");

    // A robot that stands still tells nothing of a rotation.
    let still = register(folder.path(), "1.mcap", &[]).unwrap_err();
    assert!(matches!(&still, Error::File { .. }) && still.to_string().contains("Move all three joints"), "{still}");
}

#[test]
fn the_virtual_labs_cameras_are_registered_without_their_mount() {
    let lab = ["board.mcap", "hardstop.mcap", "sinusoid.mcap", "truth.json"].map(|name| shared(&format!("data/lab/{name}")));
    let ([Some(board), Some(stop), Some(motion), Some(truth)], Some(robot)) = (lab, shared("robot/raven2-gold.yaml")) else { return };
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(truth).unwrap()).unwrap();
    let turn = Matrix3::from_fn(|r, c| truth.pointer(&format!("/camera/R/{r}/{c}")).unwrap().as_f64().unwrap());
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    let actual = Isometry3::from_parts(Translation3::from(three(&truth, "/camera/t")), turn);
    let folder = tempfile::tempdir().unwrap();
    let cameras = folder.path().join("cameras.yaml").display().to_string();
    let path = |path: &PathBuf| path.display().to_string();
    calibrate(&["cameras", &path(&board), "--board", "9x6", "--square", "0.012", "-o", &cameras]).unwrap();
    let (robot, motion, stop) = (path(&robot), path(&motion), path(&stop));
    for log in [&["register", &motion] as &[&str], &["register", &stop, "--motion", &motion]] {
        let (said, json) = calibrate(&[log, &["--robot", &robot, "--cameras", &cameras, "--rotation", "estimate"]].concat()).unwrap();
        let (errors, in_view_m) = errors(&json, &actual);
        println!("{said}{errors:?} {:.2} mm in view", 1e3 * in_view_m);
        assert!(errors.iter().all(|e| e.abs() < 4.0) && in_view_m < 5e-3, "{errors:?}, {in_view_m} m");
        assert!((json["latency_s"].as_f64().unwrap() - truth["latency_s"].as_f64().unwrap()).abs() < 2e-3, "{said}");
    }
}
