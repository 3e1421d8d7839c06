//! The claimed standard deviations against many simulated calibrations, with noise that the corners of a picture share.

use nalgebra::{SVector, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::simulated::{Lab, Noise};
use crate::linear::{CAMERA, PAIR, Rig, SHARED};
use crate::uncertainty::{cameras_of, point_covariance, point_slope};

const NOISE: Noise = Noise { corner_px: 0.1, picture_px: 0.1, between_m: 1e-5 };
const RUNS: u64 = 200;
const BOARDS: usize = 12;

/// Of each number the error over its claimed standard deviation, and over half of its 95 % interval.
fn errors(lab: &Lab, boards: usize, seed: u64) -> [[f64; 2]; 7] {
    let shots = lab.shots(boards, NOISE, &mut ChaCha8Rng::seed_from_u64(seed));
    let found = lab.calibrate(&shots);
    let known = found.deviations.as_ref().unwrap();
    let over = |direction: SVector<f64, SHARED>, error: f64| {
        let std = (direction.transpose() * known.covariance * direction)[0].sqrt();
        [error / std, error / (std * known.t95(&direction))]
    };
    let axis = |index: usize| SVector::from_fn(|i, _| if i == index { 1.0 } else { 0.0 });
    let pose = &found.rig.right_from_left;
    let mut along = SVector::<f64, SHARED>::zeros();
    along.fixed_rows_mut::<3>(PAIR + 3).copy_from(&pose.translation.vector.normalize());
    let turn = (pose.rotation * lab.right_from_left.rotation.inverse()).scaled_axis();
    let point = Vector3::new(0.02, -0.03, 0.4);
    let truth = cameras_of(&Rig { cameras: lab.cameras, right_from_left: lab.right_from_left, ..found.rig.clone() });
    let seen = cameras_of(&found.rig).triangulate(&truth.project(&point).unwrap(), &[nalgebra::Matrix2::identity(); 2]).unwrap();
    let depth = point_slope(&found.rig, &known.covariance, &point).unwrap().row(2).transpose();
    [
        over(axis(0), found.rig.cameras[0].fx - lab.cameras[0].fx),
        over(axis(CAMERA), found.rig.cameras[1].fx - lab.cameras[1].fx),
        over(along, pose.translation.vector.norm() - lab.right_from_left.translation.vector.norm()),
        over(axis(PAIR), turn.x),
        over(axis(PAIR + 1), turn.y),
        over(axis(PAIR + 2), turn.z),
        over(depth, seen.point_left.z - point.z),
    ]
}

/// Deviations and intervals of calibrations from this many boards.
fn intervals_hold(boards: usize) {
    let lab = Lab::new(7, 6);
    let errors: Vec<[[f64; 2]; 7]> = (0..RUNS).into_par_iter().map(|seed| errors(&lab, boards, seed)).collect();
    for (i, name) in ["left fx", "right fx", "baseline", "rotation x", "rotation y", "rotation z", "depth"].into_iter().enumerate() {
        let inside = errors.iter().filter(|e| e[i][1].abs() < 1.0).count();
        let sizes: Vec<f64> = errors.iter().map(|e| e[i][0].abs()).collect();
        let rms = (sizes.iter().map(|z| z * z).sum::<f64>() / RUNS as f64).sqrt();
        let robust = raven::stats::median(&sizes).unwrap() / 0.6745;
        println!(
            "{boards} boards, {name}: {inside} of {RUNS} inside, errors of {rms:.2} standard deviations rms, {robust:.2} by their median"
        );
        // Binomial with p = 0.95 and n = 200: fewer than 180 has a probability of 0.1 %, more than 198 of 0.04 %.
        assert!((180..=198).contains(&inside), "{boards} boards, {name}: {inside} of {RUNS} inside the 95 % interval");
        assert!((0.7..1.5).contains(&robust), "{boards} boards, {name}: errors are {robust:.2} standard deviations");
    }
}

#[test]
fn intervals_of_95_percent_hold_in_95_of_100_calibrations() {
    intervals_hold(BOARDS);
}

#[test]
fn intervals_hold_with_six_boards_too() {
    intervals_hold(6);
}

#[test]
fn a_points_covariance_is_that_of_calibrations_drawn_from_theirs() {
    let lab = Lab::new(9, 6);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let found = lab.calibrate(&lab.shots(BOARDS, NOISE, &mut rng));
    let covariance = found.deviations.as_ref().unwrap().covariance;
    let point = Vector3::new(-0.03, 0.02, 0.35);
    let claimed = point_covariance(&found.rig, &covariance, &point).unwrap();
    let pixels = cameras_of(&found.rig).project(&point).unwrap();
    let eigen = covariance.symmetric_eigen();
    let samples = 2000;
    let mut scatter = nalgebra::Matrix3::zeros();
    for _ in 0..samples {
        let draw = SVector::<f64, SHARED>::from_fn(|i, _| {
            eigen.eigenvalues[i].max(0.0).sqrt() * Distribution::<f64>::sample(&StandardNormal, &mut rng)
        });
        let drawn = cameras_of(&found.rig.moved(&(eigen.eigenvectors * draw), &[]));
        let error = drawn.triangulate(&pixels, &[nalgebra::Matrix2::identity(); 2]).unwrap().point_left - point;
        scatter += error * error.transpose() / f64::from(samples);
    }
    for axis in 0..3 {
        let ratio = scatter[(axis, axis)] / claimed[(axis, axis)];
        assert!((0.85..1.15).contains(&ratio), "axis {axis}: {ratio}");
    }
}
