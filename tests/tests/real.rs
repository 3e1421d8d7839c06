//! Recordings of real robots.

use raven_tests::{json, number, shared, typed};

fn diagnose(log: &str, robot: &str) -> Option<serde_json::Value> {
    let (log, robot) = (shared(&format!("data/real/{log}"))?, shared(&format!("robot/{robot}"))?);
    let folder = tempfile::tempdir().unwrap();
    let arguments = [&log.display().to_string(), "--robot", &robot.display().to_string(), "--gap-only", "--json", "{report.json}"];
    typed(folder.path(), raven_diagnose::run, &arguments).unwrap();
    Some(json(folder.path(), "report.json"))
}

/// The gap that a computation of its own in Python found between the PhaseSpace tips and the motors.
#[test]
fn the_gap_of_a_raven_tracked_with_phasespace() {
    let Some(report) = diagnose("raven2_phasespace.mcap", "raven2-berkeley-gold.yaml") else { return };
    for (channel, expected) in [(0, 0.96), (1, 0.74), (2, 2.34)] {
        let gap = number(&report, &format!("/model_gap/{channel}/transmission"));
        assert!((gap - expected).abs() < 0.01, "channel {channel}: {gap} instead of {expected}");
    }
}

/// The controller's transmission kinematics, repeated to the rounding of its 32-bit message.
#[test]
fn the_joint_angles_that_a_raven_logged_itself() {
    let Some(report) = diagnose("raven2_uiuc_run.mcap", "raven2-gold.yaml") else { return };
    for (joint, limit) in [(0, 1e-4), (1, 1e-4), (2, 1e-3)] {
        let largest = number(&report, &format!("/controller/{joint}/largest"));
        assert!(largest < limit, "joint {joint}: {largest}");
    }
}
