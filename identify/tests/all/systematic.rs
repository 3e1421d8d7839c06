//! Cameras that have the disparity and the scale wrong alike in all images, before robots whose other numbers are within their tolerances.

use std::cell::RefCell;

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::camera::{Cameras, Pinhole, Quality, SYSTEMATIC};
use raven::observation::{covariance_by_pose_m2, moved_by_pose};
use raven::robot::Robot;
use raven_identify::batch::Estimate;
use raven_identify::problem::{Flaw, Problem};
use raven_identify::recursive::{self, Horizon, Sharing};
use raven_identify::registration::Registration;
use raven_identify::session::Session;
use raven_identify::systematic::Systematic;

use super::virtual_robot::{Case, MIDDLE, WIDE, assert_covered, motion, session};

/// Two webcams before the robot, calibrated badly: a disparity that is half a pixel off puts the tip 3 mm too near.
fn cameras() -> Cameras {
    let camera = Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, distortion: [0.0; 5] };
    let turn = Rotation3::from_matrix_unchecked(Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0));
    let base_from_left = Isometry3::from_parts(Vector3::new(-0.056, -0.423, 0.008).into(), UnitQuaternion::from_rotation_matrix(&turn));
    Cameras {
        left: camera,
        right: camera,
        right_from_left: Isometry3::translation(-0.048, 0.0, 0.0),
        base_from_left: Some(base_from_left),
        latency_s: 0.0,
        right_minus_left_s: 0.0,
        quality: Quality { disparity_std_px: Some(0.5), baseline_std_m: Some(1e-4), ..Quality::default() },
    }
}

/// What they see of a robot, with their flaws by so many prior deviations.
fn seen(truth: &Robot, random: &mut ChaCha8Rng) -> (Vec<Session>, [f64; SYSTEMATIC]) {
    let mut sessions = vec![session(truth, &motion(40.0, MIDDLE, WIDE), random, 0.0)];
    let flaws = flaws(&sessions);
    let off = [(); SYSTEMATIC].map(|()| StandardNormal.sample(random));
    for (i, sighting) in sessions[0].sightings.iter_mut().enumerate() {
        sighting.position_m += flaws.iter().zip(off).map(|(flaw, off)| flaw[i] * off).sum::<Vector3<f64>>();
    }
    (sessions, off)
}

/// What the cameras have wrong of where the tips were seen.
fn flaws(sessions: &[Session]) -> Vec<Flaw> {
    let tips_m: Vec<Vec<Vector3<f64>>> = sessions.iter().map(|session| session.sightings.iter().map(|s| s.position_m).collect()).collect();
    Systematic::of(vec![Some(cameras()); sessions.len()]).flaws(&tips_m)
}

fn problem<'a>(case: &'a Case, sessions: &'a [Session]) -> Problem<'a> {
    Problem::new(&case.robot, &case.unknowns, sessions)
        .unwrap()
        .with_systematic(Systematic::of(vec![Some(cameras()); sessions.len()]))
        .unwrap()
        .with_tolerances()
        .unwrap()
}

#[test]
fn claimed_deviations_hold_where_all_images_err_alike() {
    const SAMPLES: u64 = 40;
    let case = Case::new(&[]);
    let squares = RefCell::new(Vec::new());
    assert_covered(&case, &["r_l1", "latency", "rotation_x", "translation_y"], SAMPLES, |truth, random| {
        let truth = &case.within_tolerances(truth, random);
        let (sessions, off) = seen(truth, random);
        let estimate = problem(&case, &sessions).estimate().unwrap();
        squares.borrow_mut().push(tips_off(&case, truth, &sessions, &off, &estimate));
        estimate
    });
    // Where tips are, corrected: three standard deviations of the mean of as many chi-squares.
    let squares = squares.into_inner();
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((mean - 3.0).abs() < 3.0 * (6.0 / SAMPLES as f64).sqrt(), "{mean}: {squares:?}");
}

/// Mean normalised square of how far the sighted tips are off, placed with the estimated registration by cameras with their flaws.
fn tips_off(case: &Case, truth: &Robot, sessions: &[Session], off: &[f64; SYSTEMATIC], estimate: &Estimate) -> f64 {
    let arm = case.robot.arm().unwrap();
    let flaws = flaws(sessions);
    let n = case.unknowns.len();
    let placed: Vec<(usize, &Flaw)> = flaws.iter().enumerate().map(|(k, flaw)| (n + k, flaw)).collect();
    let registered = Registration::of(&arm, &case.unknowns, &placed, sessions, estimate).unwrap();
    let pose = registered.covariance;
    let pivot_m = arm.kinematics.forward(&arm.hard_stop);
    let registration = |robot: &Robot| Vector6::from_row_slice(&[robot.observation.rotation, robot.observation.translation].concat());
    let estimated = case.truth(&estimate.z.rows(0, n).into_owned());
    let registration_off = registration(&estimated) + registered.taken_on - registration(truth);
    let squares = sessions[0].sightings.iter().enumerate().map(|(i, sighting)| {
        let by_pose = moved_by_pose(&(sighting.position_m - pivot_m));
        let by_flaws: Vector3<f64> = flaws.iter().zip(off).map(|(flaw, &off)| flaw[i] * off).sum();
        let error = by_pose * registration_off + by_flaws;
        error.dot(&covariance_by_pose_m2(&pose, &(sighting.position_m - pivot_m)).cholesky().unwrap().solve(&error))
    });
    squares.sum::<f64>() / sessions[0].sightings.len() as f64
}

/// Of an insertion whose travel is looked for, cameras tell the scale from what is seen of arcs alone: to 1 %. Noise of a sighting in its own flaw would
/// count as that much scale again.
#[test]
fn noise_is_no_scale() {
    const SAMPLES: u32 = 6;
    let case = Case::new(&["r_l3", "latency"]);
    let scale = |seed: u32| {
        let sessions = [session(&case.robot, &motion(40.0, MIDDLE, WIDE), &mut ChaCha8Rng::seed_from_u64(u64::from(seed)), 0.0)];
        let mut problem = problem(&case, &sessions);
        let estimate = problem.estimate().unwrap();
        let [scale, _, std] = problem.cameras_found(&estimate).unwrap().scale;
        scale / std
    };
    let mean = (0..SAMPLES).map(scale).sum::<f64>() / f64::from(SAMPLES);
    assert!(mean.abs() < 0.5, "{mean} prior deviations");
}

#[test]
fn every_method_finds_what_the_cameras_have_wrong() {
    let case = Case::new(&[]);
    let truth = case.truth(&case.at(&[("r_l1", 0.0598), ("latency", 0.015)]));
    let (sessions, off) = seen(&truth, &mut ChaCha8Rng::seed_from_u64(3));
    let n = case.unknowns.len();
    let mut by_batch = problem(&case, &sessions);
    let batch = by_batch.estimate().unwrap();
    let found = by_batch.cameras_found(&batch).unwrap();
    let [px, std_px, prior_px] = found.disparity_px;
    assert!((px - off[0] * prior_px).abs() < 3.0 * std_px && std_px < 0.2, "{found:?} of {off:?}");
    for sharing in [Sharing::Dual(Horizon::Frame), Sharing::Joint] {
        let (filtered, _) = recursive::estimate(&mut problem(&case, &sessions), sharing).unwrap();
        for k in [case.index("r_l1"), n, n + 1] {
            let apart = (filtered.z[k] - batch.z[k]) / batch.std[k];
            assert!(apart.abs() < 1.0, "{sharing:?}: unknown {k} is {apart:.2} deviations from the batch's");
        }
    }
}

#[test]
fn tips_of_no_cameras_have_nothing_in_common() {
    assert!(Systematic::of(vec![None]).flaws(&[vec![Vector3::zeros()]]).is_empty());
}
