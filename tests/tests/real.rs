//! Recordings of real robots.

use raven_tests::{json, number, shared, typed};

fn diagnose(log: &str, robot: &str, options: &[&str]) -> Option<serde_json::Value> {
    let (log, robot) = (shared(&format!("data/real/{log}"))?, shared(&format!("robot/{robot}"))?);
    let folder = tempfile::tempdir().unwrap();
    let (log, robot) = (log.display().to_string(), robot.display().to_string());
    let arguments = [&[log.as_str(), "--robot", &robot, "--json", "{report.json}"], options].concat();
    typed(folder.path(), raven_diagnose::run, &arguments).unwrap();
    Some(json(folder.path(), "report.json"))
}

/// The gap that a computation of its own in Python found between the PhaseSpace tips and the motors.
#[test]
fn the_gap_of_a_raven_tracked_with_phasespace() {
    let Some(report) = diagnose("raven2_phasespace.mcap", "raven2-berkeley-gold.yaml", &["--gap-only"]) else { return };
    for (channel, expected) in [(0, 0.96), (1, 0.74), (2, 2.34)] {
        let gap = number(&report, &format!("/model_gap/{channel}/transmission"));
        assert!((gap - expected).abs() < 0.01, "channel {channel}: {gap} instead of {expected}");
    }
}

/// The controller's transmission kinematics, repeated to the rounding of its 32-bit message.
#[test]
fn the_joint_angles_that_a_raven_logged_itself() {
    let Some(report) = diagnose("raven2_uiuc_run.mcap", "raven2-gold.yaml", &["--gap-only"]) else { return };
    for (joint, limit) in [(0, 1e-4), (1, 1e-4), (2, 1e-3)] {
        let largest = number(&report, &format!("/controller/{joint}/largest"));
        assert!(largest < limit, "joint {joint}: {largest}");
    }
}

/// Dry friction of the shoulder's motor and link together [N m after the gear box]: by a regression of its own in Python on the sign of the
/// motion, its speed, acceleration and place, 0.051 are in the log, where the file has 0.094. As the file says of itself, that is too much.
#[test]
fn what_the_nominal_file_has_wrong_about_a_raven() {
    let Some(report) = diagnose("raven2_uiuc_run.mcap", "raven2-gold.yaml", &[]) else { return };
    let numbers = report["file_numbers"].as_array().unwrap();
    let factor =
        |id: &str, joint: &str| numbers.iter().find(|of| of["id"] == id && of["joint"] == joint).and_then(|of| of["value"].as_f64());
    let [motor, link] = ["motor-coulomb-friction", "link-coulomb-friction"].map(|id| factor(id, "shoulder").unwrap());
    let dry = motor * 0.0490 + link * 0.0454;
    assert!((dry / 0.051 - 1.0).abs() < 0.1, "motor {motor}, link {link}: {dry}");
    assert!(factor("motor-coulomb-friction", "insertion").is_none());
}
