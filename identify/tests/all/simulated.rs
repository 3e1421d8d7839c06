//! Robots whose numbers are known: what is found, how well it claims to be known, and what is left alone.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use raven::camera::Quality;
use raven::robot::{Hysteresis, nominal};
use raven_identify::identified::{Finding, identified};
use raven_identify::parameters::Selection;
use raven_identify::prediction::Predictor;
use raven_identify::priors;
use raven_identify::problem::Problem;
use raven_identify::session::Session;

use super::virtual_robot::{self, Case, MIDDLE, WIDE, halting, motion, session};

#[test]
fn the_papers_pulley_is_found_beside_a_late_and_turned_camera() {
    let case = Case::new(&[]);
    let z = case.at(&[("r_l1", 0.059), ("latency", 0.060), ("rotation_x", 0.0175), ("translation_z", 0.004)]);
    let session = session(&case.truth(&z), &motion(60.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(1), 0.0);
    let estimate = case.estimate(&[session]);
    for name in ["r_l1", "latency", "rotation_x", "translation_z"] {
        let k = case.index(name);
        let off = (estimate.z[k] - z[k]) / estimate.std[k];
        assert!(estimate.identified[k] && off.abs() < 4.0, "{name} is {off:.1} deviations off");
    }
    let k = case.index("r_l1");
    let std_mm = case.unknowns[k].std(0.059, estimate.std[k]) * 1e3;
    assert!(std_mm < 0.06, "0.1 % of the pulley, not {std_mm} mm");
}

#[test]
fn a_joint_that_does_not_follow_the_model_does_not_speak_for_the_others() {
    let case = Case::new(&[]);
    let z = case.at(&[("r_l1", 0.0598), ("latency", 0.015)]);
    let (truth, motion) = (case.truth(&z), motion(60.0, MIDDLE, WIDE));
    let mut session = session(&truth, &motion, &mut ChaCha8Rng::seed_from_u64(6), 0.0);
    // A loop of 1 mm to either side at the insertion, ten times what the cameras see.
    let predictor = Predictor::new(&truth).unwrap();
    let motors = nominal::gold().arm().unwrap().transmission;
    for sighting in &mut session.sightings {
        let forward = motors.joint_rate_from_motor(&motion.rate_rad_s(sighting.time_s))[2].signum();
        sighting.position_m += predictor.seen_from_joints(&motion, sighting.time_s) * Vector3::new(0.0, 0.0, 1e-3 * forward);
    }
    let sessions = [session];
    let mut problem = Problem::new(&case.robot, &case.unknowns, &sessions).unwrap();
    let estimate = problem.estimate().unwrap();
    let k = case.index("r_l1");
    let (off, percent) = ((estimate.z[k] - z[k]) / estimate.std[k], 10.0 * estimate.std[k]);
    assert!(off.abs() < 4.0 && percent < 0.5, "{off:.1} deviations off, which are {percent:.2} % each");
    let misfit = problem.misfit();
    assert!((5e-4..1.2e-3).contains(&misfit[2]) && misfit[0] < 2e-3 && misfit[1] < 2e-3, "{misfit}");
}

#[test]
fn several_logs_add_up() {
    let case = Case::new(&[]);
    let truth = case.truth(&case.at(&[("r_l1", 0.0598)]));
    let sessions: Vec<Session> =
        (0..4).map(|s| session(&truth, &motion(30.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(s), 0.0)).collect();
    let k = case.index("latency");
    let one = sessions.chunks(1).map(|session| case.estimate(session).std[k]).sum::<f64>() / 4.0;
    let four = case.estimate(&sessions).std[k];
    assert!((1.5..2.7).contains(&(one / four)), "four logs are worth twice the precision, not {}", one / four);
}

fn assert_covered(alike: f64) {
    let (case, motion) = (Case::new(&[]), motion(40.0, MIDDLE, WIDE));
    let names = ["r_l1", "latency", "rotation_x", "translation_y"];
    virtual_robot::assert_covered(&case, &names, 40, |truth, random| case.estimate(&[session(truth, &motion, random, alike)]));
}

#[test]
fn claimed_deviations_hold_on_robots_drawn_from_the_prior() {
    assert_covered(0.0);
}

#[test]
fn claimed_deviations_hold_when_sightings_are_alike() {
    assert_covered(0.7);
}

#[test]
fn a_joint_that_did_not_move_keeps_its_numbers() {
    let case = Case::new(&["r_l1", "r_l3", "latency"]);
    let truth = case.truth(&case.at(&[("r_l1", 0.0598), ("r_l3", 1.003)]));
    // At its hard stop a radius does not show.
    let (centre, still) = (Vector3::new(0.02, 1.6, 0.33), Vector3::new(0.0, 0.4, 0.06));
    let sessions = [session(&truth, &motion(40.0, centre, still), &mut ChaCha8Rng::seed_from_u64(1), 0.0)];
    let estimate = case.estimate(&sessions);
    let findings = Finding::all(&case.unknowns, &estimate);
    let (first, third) = (&findings[case.index("r_l1")], &findings[case.index("r_l3")]);
    assert!(!first.identified && first.value == case.robot.joints[0].link_pulley_radius, "{first:?}");
    assert!(third.identified && (third.value - 1.003).abs() < 4.0 * third.std, "{third:?}");

    let file = identified(&case.robot, &findings, &[], "batch", &sessions).unwrap();
    assert_eq!(file.joints[0].motor_at_hard_stop, None);
    let nominal_motor = case.robot.arm().unwrap().transmission.motor_at_hard_stop[2];
    assert_eq!(file.joints[2].motor_at_hard_stop, Some(nominal_motor));
    let entry = file.calibration.iter().find(|c| c.parameter == "r_l1").unwrap();
    assert!(!entry.identified && entry.value == entry.prior && entry.sha256 == ["00"]);
    assert_eq!(file.before_calibration(), case.robot);
}

#[test]
fn identifying_again_keeps_the_way_back() {
    let case = Case::new(&[]);
    let truth = case.truth(&case.at(&[("r_l1", 0.0598)]));
    let sessions = [session(&truth, &motion(40.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(2), 0.0)];
    let mut robot = case.robot.clone();
    for _ in 0..2 {
        let unknowns = priors::unknowns(&robot, &Selection::default(), &Quality::default()).unwrap();
        let again = Case { robot: robot.clone(), unknowns };
        let findings = Finding::all(&again.unknowns, &again.estimate(&sessions));
        robot = identified(&robot, &findings, &[], "batch", &sessions).unwrap();
        let found = robot.joints[0].link_pulley_radius;
        assert!((found - 0.0598).abs() < 5e-5, "{found}");
    }
    assert_eq!(robot.before_calibration(), case.robot);
}

/// Behind cables soft enough for it, halts tell whether friction holds: at the joint that was asked about, and with a way back.
#[test]
fn friction_that_holds_is_written_where_it_was_found() {
    let mut case = Case::new(&["k_e2", "F_c2"]);
    case.robot.joints[1].cable.as_mut().unwrap().stiffness = 9000.0;
    case.robot.joints[2].link_friction.as_mut().unwrap().held_part = 0.6;
    case.unknowns =
        priors::unknowns(&case.robot, &Selection::named(&["k_e2".to_owned(), "F_c2".to_owned()]).unwrap(), &Quality::default()).unwrap();
    for held_part in [0.0, 1.0] {
        let mut truth = case.robot.clone();
        truth.joints[1].link_friction.as_mut().unwrap().held_part = held_part;
        let sessions = [session(&truth, &halting(40.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(3), 0.0)];
        let mut problem = Problem::new(&case.robot, &case.unknowns, &sessions).unwrap();
        let findings = Finding::all(&case.unknowns, &problem.estimate().unwrap());
        let file = identified(&case.robot, &findings, problem.held(), "batch", &sessions).unwrap();
        let held_parts = file.joints.iter().map(|joint| joint.link_friction.unwrap().held_part).collect::<Vec<_>>();
        assert_eq!(held_parts, [0.0, held_part, 0.6]);
        let line = file.calibration.iter().find(|line| line.key.ends_with("held_part"));
        assert_eq!(
            line.map(|line| (line.parameter.as_str(), line.value, line.prior)),
            (held_part > 0.0).then_some(("held_part_2", 1.0, 0.0))
        );
        assert!(line.is_none_or(|line| line.identified && line.std <= 0.5 * line.prior_std));
        assert_eq!(file.before_calibration(), case.robot);
    }
}

/// What holds by half is the same the other way round.
#[test]
fn friction_that_nobody_asked_about_or_that_holds_by_half_stays() {
    for names in [["latency"], ["F_c2"]] {
        let mut case = Case::new(&names);
        case.robot.joints[1].link_friction.as_mut().unwrap().held_part = 0.5;
        let sessions = [session(&case.robot, &motion(20.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(3), 0.0)];
        let mut problem = Problem::new(&case.robot, &case.unknowns, &sessions).unwrap();
        let findings = Finding::all(&case.unknowns, &problem.estimate().unwrap());
        let file = identified(&case.robot, &findings, problem.held(), "batch", &sessions).unwrap();
        let held_parts = file.joints.iter().map(|joint| joint.link_friction.unwrap().held_part).collect::<Vec<_>>();
        assert_eq!(held_parts, [0.0, 0.5, 0.0]);
    }
}

/// However a loop turns, from one that rounds off at once to a sharp play: it is as large as claimed.
#[test]
fn a_loop_is_written_as_it_turns() {
    let case = Case::new(&["hysteresis_3", "rounding_3", "latency"]);
    let half_loop = 1.2e-3;
    for straight_part in [-0.5, 0.0, 0.5, 1.0] {
        let mut truth = case.robot.clone();
        truth.joints[2].hysteresis = Hysteresis { half_loop, length: half_loop, straight_part, lag_at_start: 0.0 };
        let sessions = [session(&truth, &motion(40.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(3), 0.0)];
        let mut problem = Problem::new(&case.robot, &case.unknowns, &sessions).unwrap();
        let estimate = problem.estimate().unwrap();
        let findings = Finding::all(&case.unknowns, &estimate);
        for (finding, truth) in findings.iter().zip([half_loop, half_loop, straight_part]) {
            let off = (finding.value - truth) / finding.std;
            assert!(off.abs() < 3.0, "{straight_part}: {} is {off:.1} deviations off", finding.unknown.key);
        }
        assert!(findings[..2].iter().all(|finding| finding.identified), "{straight_part}");
        let squares = problem.normalized_squares(&estimate.z).unwrap();
        // Of 400 sightings; one deviation is 0.12.
        let nis = squares.iter().sum::<f64>() / squares.len() as f64;
        assert!(nis < 3.4, "{straight_part}: residuals are {nis}, and noise alone would be 3");
        let file = identified(&case.robot, &findings, problem.held(), "batch", &sessions).unwrap();
        assert_eq!(file.joints[2].hysteresis.straight_part, findings[2].value);
        let line = file.calibration.iter().find(|line| line.parameter == "straight_part_3").unwrap();
        assert_eq!((line.value, line.prior), (findings[2].value, 0.0));
        assert_eq!(file.before_calibration(), case.robot);
    }
}
