//! The claimed standard deviations against many simulated calibrations, with noise that the corners of a picture share.

use nalgebra::{SVector, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::simulated::{Lab, Noise};
use crate::linear::{CAMERA, PAIR, SHARED};
use crate::uncertainty::{cameras_of, point_covariance, t95};

const NOISE: Noise = Noise { corner_px: 0.1, picture_px: 0.1, between_m: 1e-5 };
const RUNS: u64 = 200;
const BOARDS: usize = 12;

#[test]
fn intervals_of_95_percent_hold_in_95_of_100_calibrations() {
    let lab = Lab::new(7, 6);
    // Errors over claimed standard deviations: left fx, right fx, baseline, rotation about three axes, depth of a point.
    let errors: Vec<[f64; 7]> = (0..RUNS)
        .into_par_iter()
        .map(|seed| {
            let shots = lab.shots(BOARDS, NOISE, &mut ChaCha8Rng::seed_from_u64(seed));
            let found = lab.calibrate(&shots);
            let covariance = found.covariance.unwrap();
            let std = |i: usize| covariance[(i, i)].sqrt();
            let pose = &found.rig.right_from_left;
            let direction = pose.translation.vector.normalize();
            let along = (direction.transpose() * covariance.fixed_view::<3, 3>(PAIR + 3, PAIR + 3) * direction)[0].sqrt();
            let turn = (pose.rotation * lab.right_from_left.rotation.inverse()).scaled_axis();
            let point = Vector3::new(0.02, -0.03, 0.4);
            let truth = cameras_of(&crate::linear::Rig {
                cameras: lab.cameras,
                right_from_left: lab.right_from_left,
                bow_m: nalgebra::Vector2::zeros(),
                boards: Vec::new(),
            });
            let pixels = truth.project(&point).unwrap();
            let seen = cameras_of(&found.rig).triangulate(&pixels, &[nalgebra::Matrix2::identity(); 2]).unwrap().point_left;
            let depth = point_covariance(&found.rig, &covariance, &point).unwrap()[(2, 2)].sqrt();
            [
                (found.rig.cameras[0].fx - lab.cameras[0].fx) / std(0),
                (found.rig.cameras[1].fx - lab.cameras[1].fx) / std(CAMERA),
                (pose.translation.vector.norm() - lab.right_from_left.translation.vector.norm()) / along,
                turn.x / std(PAIR),
                turn.y / std(PAIR + 1),
                turn.z / std(PAIR + 2),
                (seen.z - point.z) / depth,
            ]
        })
        .collect();
    for (i, name) in ["left fx", "right fx", "baseline", "rotation x", "rotation y", "rotation z", "depth"].into_iter().enumerate() {
        let inside = errors.iter().filter(|e| e[i].abs() < t95(BOARDS)).count();
        let rms = (errors.iter().map(|e| e[i] * e[i]).sum::<f64>() / RUNS as f64).sqrt();
        println!("{name}: {inside} of {RUNS} inside, rms {rms:.2} standard deviations");
        // Binomial with p = 0.95 and n = 200: fewer than 180 has a probability of 0.1 %.
        assert!(inside >= 180, "{name}: {inside} of {RUNS} inside the 95 % interval");
        // Nor are the intervals wide for safety's sake.
        assert!((0.65..1.35).contains(&rms), "{name}: errors are {rms:.2} standard deviations rms");
    }
}

#[test]
fn a_points_covariance_is_that_of_calibrations_drawn_from_theirs() {
    let lab = Lab::new(9, 6);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let found = lab.calibrate(&lab.shots(BOARDS, NOISE, &mut rng));
    let covariance = found.covariance.unwrap();
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

#[test]
fn t95_is_students() {
    // Abramowitz and Stegun, table 26.10.
    for (boards, quantile) in [(4, 3.182), (6, 2.571), (11, 2.228), (31, 2.042), (1001, 1.962)] {
        assert!((t95(boards) / quantile - 1.0).abs() < 0.01, "{boards}: {}", t95(boards));
    }
}
