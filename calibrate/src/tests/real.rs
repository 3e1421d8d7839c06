//! Real pictures and an independent virtual lab, where they are at hand: `shared/data` beside the repository.

use std::path::PathBuf;

use clap::Parser;
use raven_tests::shared;
use serde_json::Value;

use crate::{Args, run};

/// Runs a command with `--json` added; what it printed, and the JSON.
pub fn calibrate(args: &[&str]) -> raven::Result<(String, Value)> {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("result.json");
    let all = ["raven-calibrate"].iter().chain(args).copied().chain(["--json", json.to_str().unwrap()]);
    let mut out = Vec::new();
    run(Args::try_parse_from(all).unwrap(), &mut out)?;
    Ok((String::from_utf8(out).unwrap(), serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap()))
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

fn near(value: &Value, pointer: &str, expected: f64, tolerance: f64) {
    let found = number(value, pointer);
    assert!((found - expected).abs() <= tolerance, "{pointer} is {found}, expected {expected} +- {tolerance}");
}

#[test]
fn bouguets_pictures_give_his_published_answer() {
    let Some(folder) = shared("data/checkerboard/opencv") else { return };
    let pattern = |name: &str| folder.join(name).display().to_string();
    let (text, json) =
        calibrate(&["cameras", "--left", &pattern("left*.jpg"), "--right", &pattern("right*.jpg"), "--board", "9x6", "--square", "0.03"])
            .unwrap();
    near(&json, "/left/boards_used", 13.0, 0.0);
    near(&json, "/right/boards_used", 13.0, 0.0);
    // What OpenCV reaches on its own corners; Bouguet's answer with his three standard deviations.
    assert!(number(&json, "/left/rms_px") <= 0.190 && number(&json, "/right/rms_px") <= 0.175);
    assert!(number(&json, "/stereo/rms_px") <= 0.2153 && number(&json, "/stereo/gradient") < 1e-6);
    // Boards that played no part are met nearly as well.
    assert!(number(&json, "/cross_validation/left_out_rms_px") < 1.3 * number(&json, "/stereo/rms_px"));
    for (i, (expected, tolerance)) in [(-0.099_802, 0.000_142), (0.001_124, 0.000_114), (0.000_050, 0.000_498)].into_iter().enumerate() {
        near(&json, &format!("/stereo/translation_m/{i}"), expected, tolerance);
    }
    for (i, (expected, tolerance)) in [(0.00669, 0.0027), (0.00452, 0.0031), (-0.00350, 0.0003)].into_iter().enumerate() {
        near(&json, &format!("/stereo/rotation_vector_rad/{i}"), expected, tolerance);
    }
    near(&json, "/left/fx", 533.523, 1.0);
    near(&json, "/right/fx", 536.814, 1.0);
    assert!(text.contains("as of pairs taken at one instant"), "{text}");
}

#[test]
fn unsynchronised_webcams_are_called_out() {
    let Some(folder) = shared("data/checkerboard/webcam") else { return };
    let pattern = |name: &str| folder.join(name).display().to_string();
    let (text, json) =
        calibrate(&["cameras", "--left", &pattern("left*.png"), "--right", &pattern("right*.png"), "--board", "9x6", "--square", "1"])
            .unwrap();
    near(&json, "/left/boards_used", 27.0, 0.0);
    near(&json, "/right/boards_used", 27.0, 0.0);
    assert!(number(&json, "/left/rms_px") <= 0.075 && number(&json, "/right/rms_px") <= 0.080);
    assert!(text.contains("the pairs were probably not taken at one instant"), "{text}");
}

#[test]
fn the_virtual_labs_cameras_and_their_place_are_found() {
    let lab = ["board.mcap", "hardstop.mcap", "truth.json"].map(|name| shared(&format!("data/lab/{name}")));
    let ([Some(log), Some(stop), Some(truth)], Some(robot)) = (lab, shared("robot/raven2-gold.yaml")) else { return };
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(truth).unwrap()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let cameras = folder.path().join("cameras.yaml");
    let path = |path: &PathBuf| path.display().to_string();
    let (_, json) = calibrate(&["cameras", &path(&log), "--board", "9x6", "--square", "0.012", "-o", &path(&cameras)]).unwrap();
    near(&json, "/left/fx", number(&truth, "/camera/fl"), 0.5);
    near(&json, "/right/fx", number(&truth, "/camera/fr"), 0.5);
    near(&json, "/stereo/baseline_m", number(&truth, "/camera/base"), 0.04e-3);
    let (_, json) =
        calibrate(&["register", &path(&stop), "--robot", &path(&robot), "--cameras", &path(&cameras), "-o", &path(&cameras)]).unwrap();
    for i in 0..3 {
        near(&json, &format!("/base_from_left/translation/{i}"), number(&truth, &format!("/camera/t/{i}")), 5e-3);
        assert!(number(&json, &format!("/translation_std_m/{i}")) < 3e-3);
    }
    for i in 0..9 {
        near(&json, &format!("/base_from_left/rotation/{i}"), number(&truth, &format!("/camera/R/{}/{}", i / 3, i % 3)), 1e-12);
    }
    assert!(json["latency_s"].is_null() && json["latency_std_s"].is_null());
    let registered = raven::camera::Cameras::read(&cameras).unwrap();
    assert!(registered.base_from_left.is_some() && registered.quality.registration_translation_std_m.is_some());
}
