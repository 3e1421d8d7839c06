//! Maps and cross-validation against calibrations whose truth is known.

use nalgebra::{Point3, Vector2, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::simulated::{IDENTITY, Lab, Noise};
use crate::calibration::{Options, Shot, calibrate};
use crate::folds::cross_validate;
use crate::grid::Relabel;
use crate::map::{depth_m, projection_covariance, projection_px, responses};
use crate::verdict;

const DISTANCE_M: f64 = 0.35;

/// Squared error of where each camera sees points that stand still among the boards, over its claimed variance; mean over the image.
fn projection_errors(seed: u64) -> [f64; 2] {
    let lab = Lab::new(7, 6);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Noise { corner_px: 0.1, picture_px: 0.1, between_m: 0.0 };
    let poses: Vec<_> = (0..12).map(|_| lab.pose(&mut rng)).collect();
    let shot = |pose| Shot { name: String::new(), sightings: [0, 1].map(|c| Some(lab.sighting(c, pose, noise, &mut rng))) };
    let shots: Vec<Shot> = poses.iter().map(shot).collect();
    let found = lab.calibrate(&shots);
    [0, 1].map(|camera| {
        let responses = responses(&found, camera);
        let grid = (0..20).map(|k| Vector2::new(60.0 + 130.0 * f64::from(k % 5), 60.0 + 120.0 * f64::from(k / 5)));
        let error = |pixel: Vector2<f64>| {
            let ray = Point3::from(lab.cameras[camera].undistort(&pixel).unwrap().push(1.0) * DISTANCE_M);
            let point = if camera == 0 { ray } else { lab.right_from_left.inverse() * ray };
            // Where the point is in the found left frame, as the boards say on average.
            let moved = poses.iter().zip(&found.rig.boards).map(|(truth, board)| (board * truth.inverse() * point).coords);
            let moved = moved.sum::<Vector3<f64>>() / poses.len() as f64;
            let in_camera = if camera == 0 { moved } else { (found.rig.right_from_left * Point3::from(moved)).coords };
            let miss = found.rig.cameras[camera].project(&in_camera).unwrap() - pixel;
            miss.norm_squared() / projection_covariance(&found, &responses, camera, &pixel, DISTANCE_M).unwrap().trace()
        };
        grid.map(error).sum::<f64>() / 20.0
    })
}

#[test]
fn projections_err_by_what_the_map_says() {
    let errors: Vec<[f64; 2]> = (0..100).into_par_iter().map(projection_errors).collect();
    for camera in 0..2 {
        let squared: Vec<f64> = errors.iter().map(|e| e[camera]).collect();
        let (rms, robust) = ((squared.iter().sum::<f64>() / 100.0).sqrt(), raven::stats::median(&squared).unwrap().sqrt());
        println!("camera {camera}: projections err by {rms:.2} claimed deviations rms, {robust:.2} by the median calibration");
        assert!((0.75..1.35).contains(&rms) && (0.6..1.3).contains(&robust), "camera {camera}: {rms} rms, {robust} median");
    }
}

#[test]
fn maps_are_best_where_the_boards_were() {
    let lab = Lab::new(9, 6);
    let shots = lab.shots(12, Noise { corner_px: 0.1, ..Noise::default() }, &mut ChaCha8Rng::seed_from_u64(21));
    let found = lab.calibrate(&shots);
    for map in [projection_px(&found, 0, DISTANCE_M), projection_px(&found, 1, DISTANCE_M)] {
        let (across, down) = map.cells;
        let at = |x: usize, y: usize| map.values[y * across + x].unwrap();
        assert_eq!((across, down), (20, 15));
        assert!(at(0, 0) > 3.0 * at(10, 7) && at(19, 14) > 3.0 * at(10, 7), "{} {} {}", at(0, 0), at(10, 7), at(19, 14));
    }
    let depth = depth_m(&found, DISTANCE_M);
    // At the left edge of the left image the right camera sees nothing.
    assert!(depth.values[7 * 20].is_none() && depth.values[7 * 20 + 10].is_some_and(|std| std < 1e-3));
}

#[test]
fn boards_left_out_fit_nearly_as_well_and_their_scatter_agrees_with_the_deviations() {
    let lab = Lab::new(9, 6);
    let middle = Vector3::z() * DISTANCE_M;
    let one = |boards: usize, noise: Noise, seed: u64| {
        let found = lab.calibrate(&lab.shots(boards, noise, &mut ChaCha8Rng::seed_from_u64(seed)));
        let folds = cross_validate(&found, &middle).unwrap();
        let depth = crate::uncertainty::point_covariance(&found.rig, &found.deviations.as_ref().unwrap().covariance, &middle);
        (folds.left_out_rms_px / found.rms_px, folds.depth_std_m / depth.unwrap()[(2, 2)].sqrt())
    };
    let alone = Noise { corner_px: 0.1, ..Noise::default() };
    let shared = Noise { picture_px: 0.1, ..alone };
    let many = |boards: usize, noise: Noise| -> Vec<(f64, f64)> { (0..20).into_par_iter().map(|seed| one(boards, noise, seed)).collect() };
    let left_out = |outcomes: &[(f64, f64)]| {
        let ratios: Vec<f64> = outcomes.iter().map(|o| o.0).collect();
        raven::stats::quantiles(&ratios, [0.5, 0.95]).unwrap()
    };
    let sixteen = many(16, shared);
    let [ten, six, all] = [left_out(&many(10, alone)), left_out(&many(6, shared)), left_out(&sixteen)];
    println!(
        "left out over used, median and 95 %: ten boards, independent noise {ten:.3?}; shared noise, six {six:.3?}, sixteen {all:.3?}"
    );
    assert!(ten[1] < 1.1 && six[0] > 1.3 && all[1] < 1.3, "{ten:?} {six:?} {all:?}");
    let ratios: Vec<f64> = sixteen.iter().map(|o| o.1).collect();
    let median = raven::stats::median(&ratios).unwrap();
    println!("sixteen boards: scatter over the folds is {median:.2} times the printed deviation");
    assert!((0.7..1.5).contains(&median), "{median}");
}

#[test]
fn the_order_of_the_boards_does_not_change_the_cross_validation() {
    let lab = Lab::new(9, 6);
    let mut shots = lab.shots(11, Noise { corner_px: 0.1, ..Noise::default() }, &mut ChaCha8Rng::seed_from_u64(22));
    let validated = |shots: &[Shot]| cross_validate(&lab.calibrate(shots), &(Vector3::z() * DISTANCE_M)).unwrap();
    let forward = validated(&shots);
    shots.reverse();
    let backward = validated(&shots);
    assert!((forward.left_out_rms_px - backward.left_out_rms_px).abs() < 1e-7, "{forward:?} {backward:?}");
    shots.truncate(4);
    assert!(cross_validate(&lab.calibrate(&shots), &(Vector3::z() * DISTANCE_M)).is_err());
}

#[test]
fn a_bad_board_and_boards_at_one_distance_are_named() {
    let lab = Lab::new(9, 6);
    let mut rng = ChaCha8Rng::seed_from_u64(23);
    let noise = Noise { corner_px: 0.05, ..Noise::default() };
    let mut shots = lab.shots(10, noise, &mut rng);
    shots[6].sightings[1] = Some(lab.sighting(1, &lab.pose(&mut rng), Noise { corner_px: 0.4, ..noise }, &mut rng));
    let says = |shots: &[Shot]| {
        let found = lab.calibrate(shots);
        let all = verdict::sentences(&found, cross_validate(&found, &(Vector3::z() * DISTANCE_M)).as_ref(), shots, &lab.board);
        all.into_iter().filter(|s| s.warning).map(|s| s.text).collect::<Vec<_>>()
    };
    let warnings = says(&shots);
    assert!(warnings.iter().any(|w| w.contains("1 boards disagree") && w.contains("pair 6 right")), "{warnings:?}");
    let at_one_distance: Vec<Shot> = (0..10)
        .map(|k| {
            let pose = loop {
                let pose = lab.pose(&mut rng);
                let z = (pose * Point3::from(lab.board.middle())).z;
                if (0.3..0.34).contains(&z) {
                    break pose;
                }
            };
            Shot { name: format!("pair {k}"), sightings: [0, 1].map(|c| Some(lab.sighting(c, &pose, noise, &mut rng))) }
        })
        .collect();
    let warnings = says(&at_one_distance);
    assert!(warnings.iter().any(|w| w.contains("nearly the same")), "{warnings:?}");
}

#[test]
fn a_cross_validation_that_cannot_be_done_says_why() {
    let mut lab = Lab::new(9, 6);
    lab.bow_m = Vector2::new(1e-3, 0.5e-3);
    let mut shots = lab.shots(8, Noise { corner_px: 0.05, ..Noise::default() }, &mut ChaCha8Rng::seed_from_u64(24));
    // Of all boards but one it is not known where on the bowed board they are.
    let shifted = Relabel { shift: (1, 0), ..IDENTITY };
    shots.iter_mut().filter(|shot| shot.name != "pair 3").flat_map(|shot| shot.sightings.iter_mut().flatten()).for_each(|seen| {
        seen.placements = vec![IDENTITY, shifted];
    });
    let says = |shots: &[Shot]| {
        let found = calibrate(shots, lab.sizes(), &lab.board, Options { bow: true, ..Options::default() }).unwrap();
        let all = verdict::sentences(&found, cross_validate(&found, &(Vector3::z() * DISTANCE_M)).as_ref(), shots, &lab.board);
        all.into_iter().filter(|s| s.warning).map(|s| s.text).find(|text| text.contains("cross-validation")).unwrap()
    };
    let open = says(&shots);
    assert!(open.contains("without pair 3 ") && !open.contains("Too few"), "{open}");
    let few = says(&shots[..4]);
    assert!(few.contains("Too few boards"), "{few}");
}
