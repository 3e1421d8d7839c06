//! A lab session recorded by another virtual robot, from its images to the joint angles.

use raven_tests::{json, number, shared, typed};

#[test]
fn from_images_to_joint_angles() {
    let Some(lab) = shared("data/lab") else { return };
    let Some(robot) = shared("robot/raven2-gold.yaml") else { return };
    let log = |name: &str| lab.join(name).display().to_string();
    let robot = robot.display().to_string();
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let truth = json(&lab, "truth.json");

    let cameras =
        ["cameras", &log("board.mcap"), "--board", "9x6", "--square", "0.012", "-o", "{cameras.yaml}", "--json", "{cameras.json}"];
    typed(at, raven_calibrate::run, &cameras).unwrap();
    let cameras = json(at, "cameras.json");
    for (side, key) in [("left", "/camera/fl"), ("right", "/camera/fr")] {
        let error_px = number(&cameras, &format!("/{side}/fx")) - number(&truth, key);
        assert!(error_px.abs() < 1.0, "fx of the {side} camera is off by {error_px} px");
    }
    let baseline_error_m = number(&cameras, "/stereo/baseline_m") - number(&truth, "/camera/base");
    assert!(baseline_error_m.abs() < 1e-4, "baseline off by {baseline_error_m} m");

    let register = ["register", &log("hardstop.mcap"), "--robot", &robot, "--cameras", "{cameras.yaml}", "-o", "{cameras.yaml}"];
    typed(at, raven_calibrate::run, &register).unwrap();
    for motion in ["sinusoid", "fls1"] {
        let (input, output) = (log(&format!("{motion}.mcap")), format!("{{{motion}-tracked.mcap}}"));
        typed(at, raven_track::run, &[&input, "--robot", &robot, "--cameras", "{cameras.yaml}", "-o", &output]).unwrap();
    }
    let identify = ["{sinusoid-tracked.mcap}", "--robot", &robot, "--cameras", "{cameras.yaml}", "-o", "{identified.yaml}"];
    typed(at, raven_identify::run, &identify).unwrap();
    let identified = raven::robot::Robot::read(&at.join("identified.yaml")).unwrap();
    let hidden_m = number(&truth, "/r_l1_m");
    let error = identified.joints[0].link_pulley_radius / hidden_m - 1.0;
    assert!(error.abs() < 0.006, "r_l1 is off by {:.2} %", 100.0 * error);

    // The motion that the parameters come from, and one that they have not seen.
    for motion in ["sinusoid", "fls1"] {
        let log = format!("{{{motion}-tracked.mcap}}");
        typed(at, raven_replay::run, &[&log, "--robot", "{identified.yaml}", "--cameras", "{cameras.yaml}", "--json", "{replay.json}"])
            .unwrap();
        let improvement = number(&json(at, "replay.json"), "/joints/0/improvement_percent");
        assert!(improvement >= 43.0, "{motion}: the shoulder is only {improvement:.1} % better than transmission kinematics");
    }
}
