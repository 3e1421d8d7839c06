//! Corners of rendered boards against where they are.

use image::GrayImage;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::camera::Pinhole;
use rayon::prelude::*;

use super::find;
use super::scene::Scene;
use crate::board::{Board, BoardSize};
use crate::{junction, saddle};

fn camera() -> Pinhole {
    Pinhole { width: 400, height: 300, fx: 380.0, fy: 380.0, cx: 200.0, cy: 150.0, distortion: [-0.2, 0.07, 1e-3, -5e-4, 0.0] }
}

fn scene(tilt: Vector3<f64>, turn: f64, centre: Vector3<f64>, blur_px: f64, noise: f64) -> Scene {
    let board = Board { size: BoardSize { columns: 9, rows: 6 }, square_m: 0.012 };
    let rotation = UnitQuaternion::from_scaled_axis(tilt) * UnitQuaternion::from_scaled_axis(Vector3::z() * turn);
    let camera_from_board = Isometry3::from_parts((centre - rotation * board.middle()).into(), rotation);
    Scene { camera: camera(), board, camera_from_board, blur_px, noise }
}

/// Errors of all corners [px]; labels on the board, if there is only one way to put them there.
fn errors(scene: &Scene, image: &GrayImage) -> Option<Vec<f64>> {
    let found = find(image, scene.board.size)?;
    assert_eq!(found.placements.len(), 1);
    Some(found.grid.corners.iter().map(|(&l, p)| (p - scene.corner(found.placements[0].apply(l)).unwrap()).norm()).collect())
}

#[test]
fn rendered_boards_are_found_to_a_few_hundredths_of_a_pixel() {
    let results: Vec<Vec<f64>> = (0..12_u64)
        .into_par_iter()
        .map(|seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let tilt = Vector3::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6), 0.0);
            let centre = Vector3::new(rng.random_range(-0.01..0.01), rng.random_range(-0.01..0.01), rng.random_range(0.22..0.3));
            let scene = scene(tilt, rng.random_range(-3.1..3.1), centre, rng.random_range(0.4..1.2), rng.random_range(1.0..4.0));
            errors(&scene, &scene.render(&mut rng)).unwrap_or_default()
        })
        .collect();
    assert!(results.iter().all(|r| r.len() == 54), "{:?}", results.iter().map(Vec::len).collect::<Vec<_>>());
    let all: Vec<f64> = results.concat();
    let rms = (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
    let largest = all.iter().copied().fold(0.0, f64::max);
    println!("rms {rms:.4} px, largest {largest:.3} px");
    assert!(rms < 0.03 && largest < 0.15, "rms {rms} px, largest {largest} px");
}

#[test]
fn a_board_that_leaves_the_picture_is_used_as_far_as_it_is_in_it() {
    let scene = scene(Vector3::new(0.2, 0.3, 0.0), 0.1, Vector3::new(0.075, 0.0, 0.22), 0.7, 2.0);
    let image = scene.render(&mut ChaCha8Rng::seed_from_u64(1));
    let found = find(&image, scene.board.size).unwrap();
    let (columns, rows) = found.grid.span();
    assert!(rows == 6 && (4..9).contains(&columns), "{columns} x {rows}");
    let errors = |relabel: &crate::grid::Relabel| {
        let error = |(&l, p): (&(i32, i32), &nalgebra::Vector2<f64>)| (p - scene.corner(relabel.apply(l)).unwrap()).norm();
        found.grid.corners.iter().map(error).fold(0.0, f64::max)
    };
    // One of the placements is the right one.
    assert!(found.placements.iter().map(errors).fold(f64::INFINITY, f64::min) < 0.15);
}

#[test]
fn a_board_of_another_size_is_cropped_or_refused() {
    let scene = scene(Vector3::new(0.3, -0.2, 0.0), 0.2, Vector3::new(0.0, 0.0, 0.26), 0.7, 2.0);
    let image = scene.render(&mut ChaCha8Rng::seed_from_u64(2));
    let small = find(&image, BoardSize { columns: 7, rows: 5 }).unwrap();
    assert_eq!((small.grid.corners.len(), small.grid.span()), (35, (7, 5)));
    // Part of a larger board: many placements.
    assert!(find(&image, BoardSize { columns: 12, rows: 9 }).unwrap().placements.len() > 4);
}

#[test]
fn pictures_without_a_board_have_none() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let size = BoardSize { columns: 9, rows: 6 };
    assert!(find(&GrayImage::from_pixel(320, 240, image::Luma([90])), size).is_none());
    assert!(find(&GrayImage::from_fn(320, 240, |_, _| image::Luma([rng.random()])), size).is_none());
    assert!(find(&GrayImage::new(1, 1), size).is_none());
    let stripes = GrayImage::from_fn(320, 240, |x, _| image::Luma([if x / 15 % 2 == 0 { 30 } else { 220 }]));
    assert!(find(&stripes, size).is_none());
}

#[test]
fn saddle_and_junction_agree_with_a_rendered_corner() {
    let scene = scene(Vector3::new(0.3, 0.4, 0.0), 0.3, Vector3::new(0.0, 0.0, 0.22), 0.8, 0.0);
    let image = scene.render(&mut ChaCha8Rng::seed_from_u64(4));
    for label in [(2, 2), (5, 3), (8, 5)] {
        let truth = scene.corner(label).unwrap();
        let sides = [(1, 0), (0, 1)].map(|(c, r)| scene.corner((label.0 + c, label.1 + r)).unwrap() - truth);
        let start = truth + nalgebra::Vector2::new(0.6, -0.4);
        let coarse = saddle::refine(&image, start, 2, 2.0).unwrap();
        assert!((coarse.pixel - truth).norm() < 0.05 && coarse.strength() > 0.0, "{label:?}: {}", coarse.pixel - truth);
        let fine = junction::fit(&image, coarse.pixel, sides, 7.0).unwrap();
        assert!((fine - truth).norm() < 0.015, "{label:?}: {}", fine - truth);
    }
    // Nothing there: no junction.
    let flat = GrayImage::from_pixel(60, 60, image::Luma([120]));
    assert!(saddle::refine(&flat, nalgebra::Vector2::new(30.0, 30.0), 2, 2.0).is_none());
    assert!(junction::fit(&flat, nalgebra::Vector2::new(30.0, 30.0), [nalgebra::Vector2::x(), nalgebra::Vector2::y()], 5.0).is_none());
}
