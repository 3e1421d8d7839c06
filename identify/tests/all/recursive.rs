//! The recursive methods on robots whose numbers are known.

use nalgebra::{DVector, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use raven_identify::batch::Estimate;
use raven_identify::problem::Problem;
use raven_identify::recursive::{self, Horizon, Sharing, Trace};

use super::virtual_robot::{self, Case, MIDDLE, WIDE, motion, session};

const DUAL: Sharing = Sharing::Dual(Horizon::Frame);

fn recursively(case: &Case, sharing: Sharing, sessions: &[raven_identify::session::Session]) -> (Estimate, Trace) {
    let mut problem = Problem::new(&case.robot, &case.unknowns, sessions).unwrap();
    recursive::estimate(&mut problem, sharing).unwrap()
}

fn papers_pulley(case: &Case) -> DVector<f64> {
    case.at(&[("r_l1", 0.059), ("latency", 0.060), ("rotation_x", 0.0175), ("translation_z", 0.004)])
}

#[test]
fn with_a_right_model_nobody_wins_by_algorithm() {
    let case = Case::new(&[]);
    let truth = case.truth(&papers_pulley(&case));
    let sessions = [session(&truth, &motion(30.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(1), 0.0)];
    let batch = case.estimate(&sessions);
    for sharing in [DUAL, Sharing::Joint] {
        let (estimate, _) = recursively(&case, sharing, &sessions);
        for name in ["r_l1", "latency", "rotation_x", "translation_z"] {
            let k = case.index(name);
            let apart = (estimate.z[k] - batch.z[k]) / batch.std[k];
            assert!(apart.abs() < 1.0, "{sharing:?}: {name} is {apart:.2} deviations from the batch's");
            assert!(estimate.identified[k]);
        }
    }
}

fn assert_covered(parameters: &[&str], names: &[&str], sharing: Sharing, samples: u64) {
    let (case, motion) = (Case::new(parameters), motion(15.0, MIDDLE, WIDE));
    virtual_robot::assert_covered(&case, names, samples, |truth, random| {
        recursively(&case, sharing, &[session(truth, &motion, random, 0.0)]).0
    });
}

#[test]
fn claimed_deviations_of_the_dual_filter_hold() {
    assert_covered(&[], &["r_l1", "latency", "rotation_x", "translation_y"], DUAL, 24);
}

#[test]
fn claimed_deviations_of_the_dual_filter_hold_for_cables() {
    assert_covered(&["r_l1", "k_e2", "k_e3", "latency"], &["r_l1", "k_e2", "k_e3", "latency"], DUAL, 16);
}

#[test]
fn claimed_deviations_of_the_joint_filter_hold() {
    assert_covered(&[], &["r_l1", "latency", "rotation_x", "translation_y"], Sharing::Joint, 24);
}

#[test]
fn a_horizon_of_one_step_is_what_makes_the_paper_wait() {
    let case = Case::new(&["r_l1"]);
    let truth = case.truth(&case.at(&[("r_l1", 0.059)]));
    let sessions = [session(&truth, &motion(60.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(2), 0.0)];
    let k = case.index("r_l1");
    // One percent of the radius is a tenth of its prior deviation.
    let settled = |horizon| {
        let (estimate, trace) = recursively(&case, Sharing::Dual(horizon), &sessions);
        (estimate.std[k], trace.settled_after_s(k, 0.1).unwrap())
    };
    let ((std, at_once), (std_by_steps, later)) = (settled(Horizon::Frame), settled(Horizon::Step));
    assert!(at_once < 8.0 && later > 2.0 * at_once, "{at_once:.1} s and {later:.1} s");
    assert!(std_by_steps > 5.0 * std, "{std:.4} and {std_by_steps:.4}");
}

#[test]
fn what_is_not_excited_keeps_its_prior_and_does_not_wind_up() {
    let case = Case::new(&["r_l1", "r_l3", "latency"]);
    let truth = case.truth(&case.at(&[("r_l1", 0.0598), ("r_l3", 1.003)]));
    let (centre, still) = (Vector3::new(0.02, 1.6, 0.33), Vector3::new(0.0, 0.4, 0.06));
    let sessions = [session(&truth, &motion(60.0, centre, still), &mut ChaCha8Rng::seed_from_u64(1), 0.0)];
    for sharing in [DUAL, Sharing::Joint] {
        let (estimate, trace) = recursively(&case, sharing, &sessions);
        let (first, third) = (case.index("r_l1"), case.index("r_l3"));
        assert!(!estimate.identified[first] && estimate.z[first] == 0.0 && estimate.std[first] > 0.5);
        assert!(estimate.identified[third]);
        assert!(trace.points.iter().all(|point| point.z[first].abs() < 1.0 && point.std[first] <= 1.0));
    }
}

#[test]
fn pauses_false_blobs_and_a_second_log_are_no_obstacle() {
    let case = Case::new(&[]);
    let z = papers_pulley(&case);
    let truth = case.truth(&z);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut sessions: Vec<_> = (0..2).map(|_| session(&truth, &motion(20.0, MIDDLE, WIDE), &mut random, 0.0)).collect();
    sessions[0].sightings.retain(|s| !(6.0..9.5).contains(&s.time_s));
    for sighting in sessions[1].sightings.iter_mut().skip(40).step_by(9) {
        sighting.position_m += Vector3::new(0.03, -0.05, 0.02);
    }
    for sharing in [DUAL, Sharing::Joint] {
        let (estimate, trace) = recursively(&case, sharing, &sessions);
        for name in ["r_l1", "latency", "rotation_x"] {
            let k = case.index(name);
            let off = (estimate.z[k] - z[k]) / estimate.std[k];
            assert!(estimate.identified[k] && off.abs() < 4.0, "{sharing:?}: {name} is {off:.1} deviations off");
        }
        assert!(trace.points.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
    }
}
