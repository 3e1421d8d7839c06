//! Recordings of real robots.

use raven::robot::Robot;
use raven_tests::{json, number, shared, typed};

fn diagnose(log: &str, robot: &str, options: &[&str]) -> Option<serde_json::Value> {
    diagnose_with(log, robot, options, |_| {})
}

/// A diagnosis by a robot file that was `changed`.
fn diagnose_with(log: &str, robot: &str, options: &[&str], changed: impl FnOnce(&mut Robot)) -> Option<serde_json::Value> {
    let (log, robot) = (shared(&format!("data/real/{log}"))?, shared(&format!("robot/{robot}"))?);
    let folder = tempfile::tempdir().unwrap();
    let mut robot = Robot::read(&robot).unwrap();
    changed(&mut robot);
    robot.write(&folder.path().join("robot.yaml")).unwrap();
    let log = log.display().to_string();
    let arguments = [&[log.as_str(), "--robot", "{robot.yaml}", "--json", "{report.json}"], options].concat();
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

/// Dry friction of motor and link together [N m after the gear box], as the command has it: by a regression of its own in Python on the sign of
/// the motion, its speed, acceleration and place, 0.051 of the shoulder and 0.078 of the insertion are in the log, where the file has 0.094 and
/// 0.075.
#[test]
fn what_the_nominal_file_has_wrong_about_a_raven() {
    let Some(report) = diagnose("raven2_uiuc_run.mcap", "raven2-gold.yaml", &[]) else { return };
    let numbers = report["file_numbers"].as_array().unwrap();
    // What is not among them is as the file has it, within its tolerance.
    let factor = |id: &str, joint: &str| {
        let reported = numbers.iter().find(|of| of["id"] == id && of["joint"] == joint);
        reported.map_or(1.0, |of| of["value"].as_f64().unwrap())
    };
    for (joint, motor, link, expected) in [("shoulder", 0.0490, 0.0454, 0.051), ("insertion", 0.0723, 0.0030, 0.078)] {
        let [of_motor, of_link, gain] = ["motor-coulomb-friction", "link-coulomb-friction", "torque-constant"].map(|id| factor(id, joint));
        let dry = (of_motor * motor + of_link * link) / gain;
        assert!((dry / expected - 1.0).abs() < 0.1, "{joint}: motor {of_motor}, link {of_link}, gain {gain}: {dry}");
    }
    for id in ["motor-coulomb-friction", "link-coulomb-friction"] {
        assert!(factor(id, "shoulder") < 0.7, "{id} of the shoulder is not reported, or {}", factor(id, "shoulder"));
    }
}

/// Of a file without any dry friction the log asks for it at every axis. Whether the motor or the joint rubs only a tip would tell: at the
/// shoulder, whose motor nothing else turns, the two are the same but for what a cable of 6 kN m/rad stretches.
#[test]
fn dry_friction_that_the_file_lacks_is_of_motor_or_link_and_a_tie_without_a_tip() {
    let without_dry_friction = |robot: &mut Robot| {
        for joint in &mut robot.joints {
            joint.motor.iter_mut().for_each(|motor| motor.coulomb_friction = 0.0);
            joint.link_friction.iter_mut().for_each(|friction| friction.coulomb = 0.0);
        }
    };
    let Some(report) = diagnose_with("raven2_uiuc_run.mcap", "raven2-gold.yaml", &[], without_dry_friction) else { return };
    const DRY: [&str; 2] = ["motor-coulomb-friction", "link-coulomb-friction"];
    let is_dry = |id: &serde_json::Value| DRY.iter().any(|dry| id == dry);
    let effects = report["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 3, "{effects:#?}");
    let probability = |id: &str, joint: &str| {
        let candidates = report["candidates"].as_array().unwrap();
        candidates.iter().find(|of| of["id"] == id && of["joint"] == joint).map_or(0.0, |of| number(of, "/probability"))
    };
    for joint in ["shoulder", "elbow", "insertion"] {
        let named = effects.iter().find(|effect| effect["joint"] == joint).unwrap();
        assert!(is_dry(&named["id"]), "{named:#}");
        let gap = report["gap"].as_array().unwrap().iter().find(|gap| gap["channel"] == format!("{joint} torque")).unwrap();
        assert!(number(gap, "/closed") > 0.3, "{gap:#}");
        if joint == "shoulder" {
            let ties = named["ties"].as_array().unwrap();
            assert!(ties.iter().any(|tie| tie["joint"] == joint && is_dry(&tie["id"]) && tie["id"] != named["id"]), "{named:#}");
            // What ties shares the probability: neither is as good as certain or as good as ruled out.
            for id in DRY {
                assert!((0.05..0.8).contains(&probability(id, joint)), "{id}: {}", probability(id, joint));
            }
        }
    }
}
