//! Corners of rendered boards that are hard to see: blurred, noisy, small, tilted, at the picture's edge and beyond it.

use nalgebra::{Isometry3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::camera::Pinhole;
use rayon::prelude::*;

use super::find;
use super::scene::Scene;
use crate::board::{Board, BoardSize};

/// Boards of each kind.
const EACH: u64 = 3;
const SIZE: BoardSize = BoardSize { columns: 9, rows: 6 };

/// What a kind of board is like.
struct Kind {
    name: &'static str,
    /// Distance from the camera [m].
    away_m: [f64; 2],
    /// Largest tilt about either axis [rad].
    tilt_rad: f64,
    /// Where its middle is, in halves of the picture: on a circle of this radius.
    aside: [f64; 2],
    blur_px: [f64; 2],
    noise: [f64; 2],
}

/// What was found of one board.
struct Found {
    /// Corners, and how many the picture holds with a margin that a corner needs.
    corners: usize,
    visible: usize,
    errors_px: Vec<f64>,
}

fn scene(kind: &Kind, rng: &mut ChaCha8Rng) -> Scene {
    let camera =
        Pinhole { width: 480, height: 360, fx: 420.0, fy: 420.0, cx: 242.0, cy: 176.0, distortion: [-0.28, 0.09, 1e-3, -5e-4, 0.0] };
    let board = Board { size: SIZE, square_m: 0.012 };
    let mut between = |[low, high]: [f64; 2]| if high > low { rng.random_range(low..high) } else { low };
    let tilt = [-kind.tilt_rad, kind.tilt_rad];
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(between(tilt), between(tilt), 0.0))
        * UnitQuaternion::from_scaled_axis(Vector3::z() * between([-3.1, 3.1]));
    let (aside, angle, z) = (between(kind.aside), between([0.0, std::f64::consts::TAU]), between(kind.away_m));
    let centre = Vector3::new(aside * angle.cos() * 240.0 / 420.0, aside * angle.sin() * 180.0 / 420.0, 1.0) * z;
    let camera_from_board = Isometry3::from_parts((centre - rotation * board.middle()).into(), rotation);
    Scene { camera, board, camera_from_board, blur_px: between(kind.blur_px), noise: between(kind.noise) }
}

fn look(scene: &Scene, rng: &mut ChaCha8Rng) -> Found {
    let labels = (0..SIZE.columns as i32).flat_map(|c| (0..SIZE.rows as i32).map(move |r| (c, r)));
    let inside = |p: &Vector2<f64>| scene.camera.contains(p, 4.0);
    let visible = labels.clone().filter(|&l| scene.corner(l).is_some_and(|p| inside(&p))).count();
    let Some(found) = find(&scene.render(rng), SIZE) else { return Found { corners: 0, visible, errors_px: Vec::new() } };
    let errors = |place: &crate::grid::Relabel| -> Vec<f64> {
        found.grid.corners.iter().map(|(&l, p)| scene.corner(place.apply(l)).map_or(f64::INFINITY, |truth| (p - truth).norm())).collect()
    };
    // A cut-off board may sit at several places, of which one is the right one.
    let largest = |e: &Vec<f64>| e.iter().copied().fold(0.0, f64::max);
    let errors_px = found.placements.iter().map(errors).min_by(|a, b| largest(a).total_cmp(&largest(b))).unwrap_or_default();
    Found { corners: found.grid.corners.len(), visible, errors_px }
}

#[test]
fn hard_boards_are_found_too() {
    let plain = Kind { name: "plain", away_m: [0.16, 0.25], tilt_rad: 0.6, aside: [0.0, 0.2], blur_px: [0.6, 1.1], noise: [2.0, 5.0] };
    let kinds = [
        Kind { name: "small and blurred", away_m: [0.4, 0.55], aside: [0.0, 0.6], blur_px: [1.2, 1.6], ..plain },
        Kind { name: "very blurred", blur_px: [2.4, 3.2], ..plain },
        Kind { name: "noisy", noise: [10.0, 16.0], ..plain },
        Kind { name: "tilted", tilt_rad: 1.0, away_m: [0.2, 0.25], ..plain },
        Kind { name: "small, blurred, at the edge", away_m: [0.35, 0.42], aside: [0.75, 0.9], blur_px: [1.2, 1.6], ..plain },
        Kind { name: "cut off", aside: [0.8, 0.95], ..plain },
    ];
    for (k, kind) in kinds.iter().enumerate() {
        let one = |i: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(1000 * k as u64 + i);
            look(&scene(kind, &mut rng), &mut rng)
        };
        let found: Vec<Found> = (0..EACH).into_par_iter().map(one).collect();
        let boards = found.iter().filter(|f| f.corners > 0).count();
        let errors: Vec<f64> = found.iter().flat_map(|f| f.errors_px.clone()).collect();
        let per_axis = (errors.iter().map(|e| e * e).sum::<f64>() / (2 * errors.len()) as f64).sqrt();
        let largest = errors.iter().copied().fold(0.0, f64::max);
        let (corners, visible): (usize, usize) = found.iter().fold((0, 0), |(c, v), f| (c + f.corners, v + f.visible));
        println!(
            "{}: {boards} of {EACH} boards, {corners} of {visible} corners, {per_axis:.4} px per axis, largest {largest:.3} px",
            kind.name
        );
        assert!(boards as u64 == EACH && 100 * corners >= 98 * visible, "{}: {boards} boards, {corners} of {visible} corners", kind.name);
        assert!(per_axis < 0.04 && largest < 0.3, "{}: {per_axis} px per axis, largest {largest} px", kind.name);
    }
}
