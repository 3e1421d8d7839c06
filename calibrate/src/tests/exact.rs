//! Corners without noise, or with noise whose influence is known.

use nalgebra::Vector2;
use proptest::prelude::*;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::Error;

use super::simulated::{Lab, Noise};
use crate::bundle::Free;
use crate::calibration::{Options, Shot, calibrate};
use crate::corners::Sighting;
use crate::folds::Unvalidated;
use crate::grid::{Grid, Relabel};
use crate::linear::{Corner, Huber, Rig, SHARED, View};
use crate::verdict;

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// The same corners with other labels.
fn relabelled(sighting: &Sighting, relabel: Relabel, keep: impl Fn((i32, i32)) -> bool) -> Grid {
    let kept = sighting.grid.corners.iter().filter(|(l, _)| keep(**l));
    Grid { corners: kept.map(|(&l, &p)| (relabel.apply(l), p)).collect() }
}

#[test]
fn exact_corners_give_the_cameras_back() {
    let lab = Lab::new(9, 6);
    let found = lab.calibrate(&lab.shots(8, Noise::default(), &mut rng(1)));
    assert!(lab.largest_error(&found) < 1e-6, "{}", lab.largest_error(&found));
    assert!(found.rms_px < 1e-6 && found.mono.iter().all(|m| m.rms_px < 1e-6));
}

#[test]
fn boards_seen_by_one_camera_count_too() {
    let lab = Lab::new(9, 6);
    let mut shots = lab.shots(12, Noise { corner_px: 0.05, ..Noise::default() }, &mut rng(2));
    for (i, shot) in shots.iter_mut().enumerate().take(8) {
        shot.sightings[i % 2] = None;
    }
    let found = lab.calibrate(&shots);
    assert_eq!((found.pairs.len(), found.rig.boards.len()), (4, 12));
    assert!(lab.largest_error(&found) < 0.01, "{}", lab.largest_error(&found));
}

#[test]
fn neither_the_order_nor_which_camera_is_first_matters() {
    let lab = Lab::new(9, 6);
    let shots = lab.shots(10, Noise { corner_px: 0.1, picture_px: 0.1, between_m: 2e-5 }, &mut rng(3));
    let found = lab.calibrate(&shots);
    assert!(found.gradient < 1e-6, "{}", found.gradient);
    let mut shuffled = shots.clone();
    shuffled.shuffle(&mut rng(4));
    let again = lab.calibrate(&shuffled);
    let swapped: Vec<Shot> =
        shots.iter().map(|s| Shot { name: s.name.clone(), sightings: [s.sightings[1].clone(), s.sightings[0].clone()] }).collect();
    let mirrored = lab.calibrate(&swapped);
    for camera in 0..2 {
        let (a, b, c) = (&found.rig.cameras[camera], &again.rig.cameras[camera], &mirrored.rig.cameras[1 - camera]);
        assert!((a.fx - b.fx).abs() < 1e-5 && (a.cx - b.cx).abs() < 1e-5, "{a:?} {b:?}");
        assert!((a.fx - c.fx).abs() < 1e-5 && (a.cx - c.cx).abs() < 1e-5, "{a:?} {c:?}");
    }
    for other in [again.rig.right_from_left, mirrored.rig.right_from_left.inverse()] {
        let between = other * found.rig.right_from_left.inverse();
        assert!(between.translation.vector.norm() < 1e-9 && between.rotation.angle() < 1e-8, "{between}");
    }
}

#[test]
fn boards_that_look_the_same_from_both_ends_are_matched() {
    let lab = Lab::new(8, 6);
    let half_turn = Relabel { turns: 2, shift: (7, 5) };
    let mut shots = lab.shots(8, Noise::default(), &mut rng(5));
    for (i, sighting) in shots.iter_mut().flat_map(|s| &mut s.sightings).flatten().enumerate() {
        if i % 3 == 0 {
            sighting.grid = relabelled(sighting, half_turn, |_| true);
        }
        sighting.placements = sighting.grid.placements(lab.board.size, Some(true));
        assert_eq!(sighting.placements.len(), 2);
    }
    let found = lab.calibrate(&shots);
    assert!(found.unmatched.is_empty());
    assert!(lab.largest_error(&found) < 1e-6, "{}", lab.largest_error(&found));
}

#[test]
fn boards_that_are_cut_off_are_matched() {
    let lab = Lab::new(9, 6);
    let mut shots = lab.shots(9, Noise::default(), &mut rng(6));
    for (i, shot) in shots.iter_mut().enumerate().take(6) {
        let Some(sighting) = &mut shot.sightings[i % 2] else { continue };
        // The first columns are out of the picture, and the labels start where the corners do.
        let cut = 1 + (i as i32) % 3;
        sighting.grid = relabelled(sighting, Relabel { turns: 0, shift: (-cut, 0) }, |(c, _)| c >= cut);
        sighting.placements = sighting.grid.placements(lab.board.size, Some(cut % 2 == 0));
        assert!(sighting.placements.len() > 1);
    }
    let found = lab.calibrate(&shots);
    assert!(found.unmatched.is_empty());
    assert!(lab.largest_error(&found) < 1e-6, "{}", lab.largest_error(&found));
}

#[test]
fn a_wrong_corner_here_and_there_does_little_harm() {
    let lab = Lab::new(9, 6);
    let mut random = rng(7);
    let mut shots = lab.shots(10, Noise { corner_px: 0.05, ..Noise::default() }, &mut random);
    let clean = lab.largest_error(&lab.calibrate(&shots));
    for sighting in shots.iter_mut().flat_map(|s| &mut s.sightings).flatten() {
        let label = (random.random_range(0..9), random.random_range(0..6));
        *sighting.grid.corners.get_mut(&label).unwrap() += Vector2::new(8.0, -5.0);
    }
    let found = lab.calibrate(&shots);
    assert!(lab.largest_error(&found) < 2.0 * clean + 0.002, "{} {clean}", lab.largest_error(&found));
}

#[test]
fn boards_that_move_between_the_exposures_are_called_out() {
    let lab = Lab::new(9, 6);
    let says = |between_m: f64| {
        let shots = lab.shots(10, Noise { corner_px: 0.08, between_m, ..Noise::default() }, &mut rng(8));
        let found = lab.calibrate(&shots);
        let all = verdict::sentences(&found, Err(&Unvalidated::FewBoards), &shots, &lab.board);
        (verdict::synchronisation(&found), all.iter().any(|s| s.warning && s.text.contains("not taken at one instant")))
    };
    let (still, moving) = (says(0.0), says(0.001));
    assert!(still.0 < 1.15 && !still.1, "{still:?}");
    assert!(moving.0 > 1.3 && moving.1, "{moving:?}");
}

#[test]
fn too_few_boards_are_refused() {
    let lab = Lab::new(9, 6);
    let mut shots = lab.shots(2, Noise::default(), &mut rng(9));
    let fails = |shots: &[Shot]| match calibrate(shots, lab.sizes(), &lab.board, Options::default()) {
        Err(Error::Data(sentence)) => sentence,
        other => panic!("{other:?}"),
    };
    assert!(fails(&shots).contains("left camera saw 2 of 3 boards"), "{}", fails(&shots));
    shots.extend(lab.shots(4, Noise::default(), &mut rng(10)));
    shots.iter_mut().enumerate().for_each(|(i, s)| s.sightings[i % 2] = None);
    assert!(fails(&shots).contains("no board was seen by both"), "{}", fails(&shots));
}

#[test]
fn boards_all_face_on_end_in_a_sentence_or_a_wide_interval() {
    let lab = Lab::new(9, 6);
    let mut random = rng(11);
    let noise = Noise { corner_px: 0.1, ..Noise::default() };
    let poses = (0..6).map(|i| nalgebra::Isometry3::translation(-0.05, -0.03, 0.3 + 0.001 * f64::from(i)));
    let shots: Vec<Shot> = poses
        .map(|pose| Shot { name: String::new(), sightings: [0, 1].map(|c| Some(lab.sighting(c, &pose, noise, &mut random))) })
        .collect();
    if let Ok(found) = calibrate(&shots, lab.sizes(), &lab.board, Options::default()) {
        assert!(
            verdict::sentences(&found, Err(&Unvalidated::FewBoards), &shots, &lab.board)
                .iter()
                .any(|s| s.warning && s.text.contains("tilt"))
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn slopes_are_differences(seed: u64, right: bool, parameter in 0..32_usize) {
        let lab = Lab::new(9, 6);
        let mut random = rng(seed);
        let pose = lab.pose(&mut random);
        let noise = Noise { corner_px: 2.0, ..Noise::default() };
        let seen: Vec<Corner> = lab.sighting(usize::from(right), &pose, noise, &mut random).grid.corners.iter()
            .map(|(&l, &pixel)| Corner { point: lab.board.point(l), bow: lab.board.bow(l), pixel }).collect();
        let view: View = if right { [Vec::new(), seen] } else { [seen, Vec::new()] };
        let rig = Rig { cameras: lab.cameras, right_from_left: lab.right_from_left, bow_m: Vector2::new(3e-4, -2e-4), boards: vec![pose] };
        let huber = Huber { threshold_px: 2.5 };
        let block = rig.linearise(0, &view, huber).unwrap();
        let (slope, curvature) = if parameter < SHARED {
            (block.shared[parameter], block.shared_shared[(parameter, parameter)])
        } else {
            (block.pose[parameter - SHARED], block.pose_pose[(parameter - SHARED, parameter - SHARED)])
        };
        // A step that moves the corners by a thousandth of a pixel.
        let size = if curvature > 0.0 { 1e-3 * (54.0 / curvature).sqrt() } else { 1e-3 };
        let cost = |sign: f64| {
            let (mut shared, mut own) = (nalgebra::SVector::<f64, SHARED>::zeros(), nalgebra::Vector6::zeros());
            if parameter < SHARED { shared[parameter] = sign * size } else { own[parameter - SHARED] = sign * size }
            rig.moved(&shared, &[own]).cost(0, &view, huber)
        };
        let difference = 0.5 * (cost(1.0) - cost(-1.0)) / (2.0 * size);
        prop_assert!((slope - difference).abs() < 1e-4 * (curvature * 54.0).sqrt() + 1e-6, "{parameter}: {slope} {difference}");
    }
}

#[test]
fn k3_is_solved_for_only_if_asked() {
    let mut lab = Lab::new(9, 6);
    lab.cameras[0].distortion[4] = 0.05;
    let shots = lab.shots(10, Noise::default(), &mut rng(12));
    let without = lab.calibrate(&shots);
    assert_eq!(without.rig.cameras[0].distortion[4], 0.0);
    let with = calibrate(&shots, lab.sizes(), &lab.board, Options { k3: true, ..Options::default() }).unwrap();
    assert!(lab.largest_error(&with) < 1e-5, "{}", lab.largest_error(&with));
    assert!({
        let free = |k3| Free { shared: true, pair: false, k3, bow: false };
        !free(false).parameter(8) && free(true).parameter(8)
    });
}

#[test]
fn a_bowed_board_is_found_if_asked_for_even_where_it_is_cut_off() {
    let mut lab = Lab::new(9, 6);
    lab.bow_m = Vector2::new(4e-4, -3e-4);
    let mut shots = lab.shots(10, Noise::default(), &mut rng(13));
    let flat = lab.calibrate(&shots);
    assert!(lab.largest_error(&flat) > 1e-4, "{}", lab.largest_error(&flat));
    for shot in shots.iter_mut().take(3) {
        // Cut off on the left alone: the right picture says where on the board its corners are.
        let Some(sighting) = &mut shot.sightings[0] else { continue };
        sighting.grid = relabelled(sighting, Relabel { turns: 0, shift: (-2, 0) }, |(c, _)| c >= 2);
        sighting.placements = sighting.grid.placements(lab.board.size, Some(true));
        assert!(sighting.placements.len() > 1);
    }
    let bowed = calibrate(&shots, lab.sizes(), &lab.board, Options { bow: true, ..Options::default() }).unwrap();
    assert_eq!(bowed.unplaced, 0);
    assert!((bowed.rig.bow_m - lab.bow_m).amax() < 1e-6, "{}", bowed.rig.bow_m);
    assert!(lab.largest_error(&bowed) < 2e-5, "{}", lab.largest_error(&bowed));
}
