//! What is behind the scene: a mottled wall with paper cuttings, some of them greenish, and a green spot that is not the marker.

use nalgebra::{Isometry3, Vector2, Vector3};
use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::Colour;
use super::optics::{Optics, mix};
use crate::simulation::truth::stream;

/// Distance of the wall from the left camera [m], and half of what is visible of it.
const WALL_M: f64 = 0.85;
const HALF_M: [f64; 2] = [0.62, 0.46];
const CUTTINGS: usize = 16;
/// The green spot, on the wall: centre and radius [m], colour.
const SPOT_M: [f64; 3] = [0.30, 0.23, 0.013];
const SPOT: Colour = [62.0, 148.0, 70.0];

struct Cutting {
    corners: Vec<Vector2<f64>>,
    colour: Colour,
}

/// The wall with everything on it, as a camera sees it; four samples per pixel.
pub(crate) fn background(optics: &Optics, from_left: &Isometry3<f64>, seed: u64) -> Vec<Colour> {
    let mut rng = stream(seed, "background");
    let cuttings: Vec<Cutting> = (0..CUTTINGS).map(|_| cutting(&mut rng)).collect();
    let salt = rng.random();
    let left_from_here = from_left.inverse();
    let (origin, turn) = (left_from_here.translation.vector, left_from_here.rotation.to_rotation_matrix());
    let on_wall = |ray: Vector3<f64>| {
        let ray = turn * ray;
        (origin + ray * ((WALL_M - origin.z) / ray.z)).xy()
    };
    let quarter = 0.25 / optics.focal_px();
    (0..optics.len())
        .into_par_iter()
        .map(|index| {
            let ray = optics.ray(index);
            let mut sum = [0.0; 3];
            for (x, y) in [(-quarter, -quarter), (quarter, -quarter), (-quarter, quarter), (quarter, quarter)] {
                let sample = wall(&on_wall(ray + Vector3::new(x, y, 0.0)), &cuttings, salt);
                sum = std::array::from_fn(|c| sum[c] + 0.25 * sample[c]);
            }
            sum
        })
        .collect()
}

fn cutting(rng: &mut impl Rng) -> Cutting {
    let centre = Vector2::new(rng.random_range(-HALF_M[0]..HALF_M[0]), rng.random_range(-HALF_M[1]..HALF_M[1]));
    let count = rng.random_range(3..6);
    let first = rng.random_range(0.0..std::f64::consts::TAU);
    // Corners in order of angle: the outline does not cross itself.
    let corners = (0..count)
        .map(|k| {
            let angle = first + (f64::from(k) + rng.random_range(0.0..0.6)) / f64::from(count) * std::f64::consts::TAU;
            centre + Vector2::new(angle.cos(), angle.sin()) * rng.random_range(0.06..0.30)
        })
        .collect();
    let grey = rng.random_range(70.0..170.0);
    let mut tint = || rng.random_range(-18.0..18.0_f32);
    Cutting { corners, colour: [grey + tint(), grey + tint() + 6.0, grey + tint()] }
}

fn wall(point: &Vector2<f64>, cuttings: &[Cutting], salt: u64) -> Colour {
    let light = 22.0 * mottle(point * 9.0, salt);
    let mut colour = [96.0, 94.0, 102.0];
    for (channel, value) in colour.iter_mut().enumerate() {
        *value += light + 18.0 * mottle(point * 7.0, salt.wrapping_add(channel as u64 + 1));
    }
    if let Some(top) = cuttings.iter().rev().find(|cutting| inside(point, &cutting.corners)) {
        let grain = 5.0 * mottle(point * 60.0, salt ^ 17);
        colour = top.colour.map(|c| c + grain);
    }
    let [x, y, radius] = SPOT_M;
    let spot = f32::from(u8::from((point - Vector2::new(x, y)).norm() < radius));
    mix(colour, SPOT, spot)
}

/// Whether a point is inside a polygon, by counting the edges to its right.
fn inside(point: &Vector2<f64>, corners: &[Vector2<f64>]) -> bool {
    let mut odd = false;
    for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        if (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            odd = !odd;
        }
    }
    odd
}

/// Smooth noise of three octaves, about -1 to 1.
fn mottle(point: Vector2<f64>, salt: u64) -> f32 {
    let octave = |scale: f64, salt: u64| {
        let scaled = point * scale;
        let cell = scaled.map(f64::floor);
        let part = (scaled - cell).map(|t| t * t * (3.0 - 2.0 * t));
        let corner = |dx: f64, dy: f64| lattice(cell.x + dx, cell.y + dy, salt);
        let top = corner(0.0, 0.0) + part.x * (corner(1.0, 0.0) - corner(0.0, 0.0));
        let bottom = corner(0.0, 1.0) + part.x * (corner(1.0, 1.0) - corner(0.0, 1.0));
        top + part.y * (bottom - top)
    };
    (0.55 * octave(1.0, salt) + 0.3 * octave(2.7, salt.rotate_left(7)) + 0.15 * octave(7.1, salt.rotate_left(21))) as f32
}

/// A number from -1 to 1 that belongs to a point of the grid (SplitMix64).
fn lattice(x: f64, y: f64, salt: u64) -> f64 {
    let mut z = salt ^ (x as i64 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as i64 as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
