//! Recordings against simulations that lack what the robot has.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use raven::log::{Recording, Stamp};
use raven::robot::{Robot, nominal};
use raven::simulation::{Motion, Options, Session};
use serde_json::Value;

use crate::{Args, run};
use clap::Parser;

const SECONDS: f64 = 20.0;

/// Records an arm with something hidden; stamps begin at `start_s`.
fn record(folder: &Path, name: &str, motion: Motion, hidden: &[&str], start_s: f64) -> PathBuf {
    record_robot(&nominal::gold(), folder, name, motion, hidden, start_s)
}

fn record_robot(robot: &Robot, folder: &Path, name: &str, motion: Motion, hidden: &[&str], start_s: f64) -> PathBuf {
    let path = folder.join(format!("{name}.mcap"));
    let effects = hidden.iter().map(|text| text.parse().unwrap()).collect();
    let options = Options { effects, start: Stamp(0).plus_seconds(start_s), ..Options::default() };
    Session::new(robot, options).unwrap().record(motion, SECONDS, &path, |_| {}).unwrap();
    path
}

/// The report and what is printed, or the error.
fn diagnosed(folder: &Path, real: &Path, simulated: &[&Path], robot: &Robot, gap_only: bool) -> Result<(Value, String), String> {
    let path = |p: &Path| p.display().to_string();
    let [file, json, html] = ["robot.yaml", "report.json", "report.html"].map(|name| folder.join(name));
    std::fs::write(&file, robot.to_yaml()).unwrap();
    let mut line = vec!["raven-diagnose".to_owned(), path(real), "--robot".to_owned(), path(&file), "--json".to_owned(), path(&json)];
    line.extend(["--html".to_owned(), path(&html)]);
    simulated.iter().for_each(|p| line.extend(["--against".to_owned(), path(p)]));
    line.extend(gap_only.then(|| "--gap-only".to_owned()));
    let mut out = Vec::new();
    run(Args::try_parse_from(line).unwrap(), &mut out).map_err(|error| error.to_string())?;
    Ok((serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap(), String::from_utf8(out).unwrap()))
}

fn rms(report: &Value, channel: &str) -> f64 {
    let gap = report["against"]["gap"].as_array().unwrap();
    gap.iter().find(|gap| gap["channel"] == channel).unwrap_or_else(|| panic!("{channel} of {gap:?}"))["rms"].as_f64().unwrap()
}

#[test]
fn what_a_simulation_lacks_is_named_whatever_its_clock() {
    let folder = tempfile::tempdir().unwrap();
    let robot = nominal::gold();
    let real = record(folder.path(), "real", Motion::Fls(0), &["pulley-radius:elbow=-0.04"], 1_750_000_000.0);
    for start_s in [1_750_000_000.0, 12.25] {
        let simulated = record(folder.path(), "simulated", Motion::Fls(0), &[], start_s);
        let same_clock = start_s > 1e9;
        let (report, words) = diagnosed(folder.path(), &real, &[&simulated], &robot, same_clock).unwrap();
        let shift_s = report["against"]["simulations"][0]["shift_s"].as_f64().unwrap();
        assert!((shift_s - (1_750_000_000.0 - start_s)).abs() < 2e-3, "{shift_s}");
        // By transmission kinematics with the smaller pulley, the encoders set as they were.
        let recording = Recording::read(&real, &(&robot).into()).unwrap();
        let nominal = robot.arm().unwrap().transmission;
        let mut smaller = robot.clone();
        smaller.joints[1].link_pulley_radius *= 0.96;
        smaller.joints[1].motor_at_hard_stop = Some(nominal.motor_at_hard_stop[1]);
        let smaller = smaller.arm().unwrap().transmission;
        let motors = recording.motor_track().unwrap();
        let away = |q: &Vector3<f64>| (smaller.joint_from_motor(q) - nominal.joint_from_motor(q))[1].to_degrees();
        let expected = raven::stats::rms(&motors.angle.iter().map(away).collect::<Vec<_>>()).unwrap();
        let found = rms(&report, "elbow");
        assert!((found / expected - 1.0).abs() < 0.05, "{found} deg, expected {expected}");
        assert!(rms(&report, "shoulder") < 0.1 * found);
        if same_clock {
            continue;
        }
        assert_eq!(report["effects"][0]["id"], "pulley-radius", "{words}");
        assert_eq!(report["effects"][0]["joint"], "elbow");
        let size = report["effects"][0]["parameters"][0]["value"].as_f64().unwrap();
        assert!((size + 0.04).abs() < 0.004, "{size}");
        assert!(words.contains("pulley-radius at the elbow") && words.contains("which the robot has and the simulation lacks"), "{words}");
        // The page has before and after, says what it was held against, and stays small.
        let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
        for part in ["class=\"line-before\"", "class=\"line-after\"", "simulation of"] {
            assert!(page.contains(part), "{part}");
        }
        assert!(page.len() < 400_000, "{} bytes", page.len());
        let closed = report["gap"].as_array().unwrap().iter().find(|gap| gap["channel"] == "elbow").unwrap();
        assert!(closed["closed"].as_f64().unwrap() > 0.95, "{closed}");
    }
}

#[test]
fn what_a_simulation_has_too_much_of_is_named_as_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let damped = ["cable-damping:elbow=5"];
    let [real, simulated] =
        [("real", &[][..]), ("simulated", &damped)].map(|(name, hidden)| record(folder.path(), name, Motion::Rich, hidden, 1e9));
    let (report, words) = diagnosed(folder.path(), &real, &[&simulated], &nominal::gold(), false).unwrap();
    assert_eq!(report["against"]["effects_of"], "simulation", "{words}");
    assert!(words.contains("which the simulation has and the robot lacks"), "{words}");
    let effects = report["effects"].as_array().unwrap();
    assert_eq!((effects.len(), &effects[0]["id"], &effects[0]["joint"]), (1, &"cable-damping".into(), &"elbow".into()), "{words}");
    let [value, std] = ["value", "std"].map(|key| effects[0]["parameters"][0][key].as_f64().unwrap());
    assert!((value / 5.0 - 1.0).abs() < 0.2 && (value - 5.0).abs() < 4.0 * std, "{words}");
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("Take cable-damping at the elbow out of the simulation"));
}

#[test]
fn a_simulation_that_is_right_leaves_no_gap() {
    let folder = tempfile::tempdir().unwrap();
    let hidden = ["pulley-radius:elbow=-0.04"];
    let [real, simulated] =
        [("real", 1e9), ("simulated", 0.5)].map(|(name, start)| record(folder.path(), name, Motion::Fls(0), &hidden, start));
    let (report, words) = diagnosed(folder.path(), &real, &[&simulated], &nominal::gold(), false).unwrap();
    assert_eq!(report["verdict"], "none", "{words}");
    for gap in report["against"]["gap"].as_array().unwrap() {
        let [rms, floor] = ["rms", "noise_floor"].map(|key| gap[key].as_f64().unwrap());
        assert!(rms <= 0.1 * floor.max(0.01), "{gap}");
    }
    // Against the model of the file the same recording has its gap.
    assert!(report["model_gap"][1]["model"].as_f64().unwrap() > 0.5, "{words}");
}

#[test]
fn another_motion_and_a_simulation_too_few_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let real = record(folder.path(), "real", Motion::Fls(0), &[], 1e9);
    let other = record(folder.path(), "other", Motion::Sinusoid, &[], 1e9);
    let refused = diagnosed(folder.path(), &real, &[&other], &nominal::gold(), true).unwrap_err();
    assert!(refused.contains("other.mcap: cannot be held against") && refused.contains("do not follow the same path"), "{refused}");
    let twice = diagnosed(folder.path(), &real, &[&real, &real], &nominal::gold(), true).unwrap_err();
    assert!(twice.contains("given 2 times for 1 recordings"), "{twice}");
}

#[test]
fn a_simulation_that_logs_joints_and_no_tip_serves_as_well() {
    let folder = tempfile::tempdir().unwrap();
    let robot = nominal::gold();
    let real = record(folder.path(), "real", Motion::Fls(0), &["pulley-radius:elbow=-0.04"], 1e9);
    let simulated = record(folder.path(), "simulated", Motion::Fls(0), &[], 5.0);
    let [real, with_tip] = [&real, &simulated].map(|path| Recording::read(path, &(&robot).into()).unwrap());
    let mut without_tip = with_tip.clone();
    without_tip.tip.clear();
    let elbow_rad = [&with_tip, &without_tip].map(|simulated| {
        let (put_right, _) = super::corrected(&robot, None, &real, simulated).unwrap();
        let residuals = crate::residual::channels(&robot, &[put_right], std::slice::from_ref(&robot)).unwrap();
        raven::stats::rms(&residuals[0].joints[1].error).unwrap()
    });
    assert!((elbow_rad[1] / elbow_rad[0] - 1.0).abs() < 0.01, "{elbow_rad:?}");
    (without_tip.joint_encoders, without_tip.motor.as_mut().unwrap().effort) = (None, None);
    let refused = super::corrected(&robot, None, &real, &without_tip).unwrap_err().to_string();
    assert!(refused.contains("no channel in common"), "{refused}");
}

#[test]
fn a_bench_is_held_against_its_simulation_too() {
    let folder = tempfile::tempdir().unwrap();
    let robot = Robot::parse(Path::new("slide.yaml"), include_str!("../../tests/slide.yaml")).unwrap();
    let bench = |name, hidden: &[&str], start_s| record_robot(&robot, folder.path(), name, Motion::Bench, hidden, start_s);
    let real = bench("real", &["motor-coulomb-friction:carriage=2.5"], 1e9);
    let (report, words) = diagnosed(folder.path(), &real, &[&bench("simulated", &[], 3.0)], &robot, false).unwrap();
    let shift_s = report["against"]["simulations"][0]["shift_s"].as_f64().unwrap();
    // The controller lags behind more where there is more friction.
    assert!((shift_s - (1e9 - 3.0)).abs() < 0.03, "{shift_s}");
    // 2.5 times 5 N instead of 5 N.
    assert!((rms(&report, "carriage force") - 7.5).abs() < 0.5, "{words}");
    assert!(report["verdict"].is_null() && report["no_diagnosis"].is_string() && words.contains("are not looked for"), "{words}");
}
