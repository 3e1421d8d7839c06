//! Sightings of a board by two cameras whose numbers are known.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use raven::camera::Pinhole;

use crate::board::{Board, BoardSize};
use crate::calibration::{Calibration, Options, Shot, calibrate};
use crate::corners::Sighting;
use crate::grid::{Grid, Label, Relabel};

pub const IDENTITY: Relabel = Relabel { turns: 0, shift: (0, 0) };

/// Two webcams 48 mm apart.
pub struct Lab {
    pub cameras: [Pinhole; 2],
    pub right_from_left: Isometry3<f64>,
    pub board: Board,
    /// How far the board's middle stands behind its edges [m].
    pub bow_m: Vector2<f64>,
}

/// What goes wrong with corners.
#[derive(Debug, Clone, Copy, Default)]
pub struct Noise {
    /// Of each corner by itself [px].
    pub corner_px: f64,
    /// Of each picture as a whole: shift, turn and stretch of the board in it, as of a bent board or a lamp's shadow [px at its edge].
    pub picture_px: f64,
    /// How far the board moves between the exposures of a pair [m].
    pub between_m: f64,
}

impl Lab {
    pub fn new(columns: usize, rows: usize) -> Self {
        let left =
            Pinhole { width: 640, height: 480, fx: 600.0, fy: 601.0, cx: 322.0, cy: 236.0, distortion: [-0.1, 0.03, 2e-4, -1e-4, 0.0] };
        Self {
            cameras: [left, Pinhole { fx: 608.0, fy: 607.0, cx: 312.0, cy: 247.0, distortion: [-0.04, 0.01, -1e-4, 2e-4, 0.0], ..left }],
            right_from_left: Isometry3::new(Vector3::new(-0.0481, 2e-4, -3e-4), Vector3::new(0.003, -0.004, 0.008)),
            board: Board { size: BoardSize { columns, rows }, square_m: 0.012 },
            bow_m: Vector2::zeros(),
        }
    }

    pub fn sizes(&self) -> [(u32, u32); 2] {
        self.cameras.map(|c| (c.width, c.height))
    }

    pub fn labels(&self) -> impl Iterator<Item = Label> + Clone + use<> {
        let (columns, rows) = (self.board.size.columns as i32, self.board.size.rows as i32);
        (0..columns).flat_map(move |c| (0..rows).map(move |r| (c, r)))
    }

    /// A pose before both cameras with all corners in both images.
    pub fn pose(&self, rng: &mut impl Rng) -> Isometry3<f64> {
        loop {
            let z = rng.random_range(0.22..0.45);
            let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(rng.random_range(-0.8..0.8), rng.random_range(-0.8..0.8), 0.0));
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * rng.random_range(-0.5..0.5));
            let centre = Vector3::new(rng.random_range(-0.35..0.45) * z, rng.random_range(-0.27..0.27) * z, z);
            let pose = Isometry3::from_parts((centre - tilt * turn * self.board.middle()).into(), tilt * turn);
            let inside =
                |camera: usize| self.labels().all(|l| self.seen(camera, &pose, l).is_some_and(|p| self.cameras[camera].contains(&p, 8.0)));
            if inside(0) && inside(1) {
                return pose;
            }
        }
    }

    pub fn seen(&self, camera: usize, left_from_board: &Isometry3<f64>, label: Label) -> Option<Vector2<f64>> {
        let pose = if camera == 0 { *left_from_board } else { self.right_from_left * left_from_board };
        let point = self.board.point(label) + Vector3::z() * self.board.bow(label).dot(&self.bow_m);
        self.cameras[camera].project(&(pose * Point3::from(point)).coords)
    }

    pub fn sighting(&self, camera: usize, pose: &Isometry3<f64>, noise: Noise, rng: &mut impl Rng) -> Sighting {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let common: [f64; 6] = std::array::from_fn(|_| noise.picture_px * normal());
        let (columns, rows) = (self.board.size.columns as f64, self.board.size.rows as f64);
        let corner = |label: Label, own: Vector2<f64>| {
            let (x, y) = (f64::from(label.0) / columns - 0.5, f64::from(label.1) / rows - 0.5);
            let shared = Vector2::new(
                common[0] + common[1] * 2.0 * y + common[2] * 4.0 * x * x,
                common[3] + common[4] * 2.0 * x + common[5] * 4.0 * y * y,
            );
            self.seen(camera, pose, label).unwrap() + shared + own
        };
        let corners = self.labels().map(|l| (l, corner(l, Vector2::new(normal(), normal()) * noise.corner_px))).collect();
        Sighting { grid: Grid { corners }, placements: vec![IDENTITY] }
    }

    pub fn shots(&self, count: usize, noise: Noise, rng: &mut impl Rng) -> Vec<Shot> {
        let shot = |index: usize| {
            let pose = self.pose(rng);
            let mut step = || -> f64 { StandardNormal.sample(rng) };
            let later = Isometry3::translation(step() * noise.between_m, step() * noise.between_m, 0.0) * pose;
            let sightings = [Some(self.sighting(0, &pose, noise, rng)), Some(self.sighting(1, &later, noise, rng))];
            Shot { name: format!("pair {index}"), sightings }
        };
        (0..count).map(shot).collect()
    }

    pub fn calibrate(&self, shots: &[Shot]) -> Calibration {
        calibrate(shots, self.sizes(), &self.board, Options::default()).unwrap()
    }

    /// Largest error of focal lengths, principal points, baseline and rotation, each relative to what it is.
    pub fn largest_error(&self, found: &Calibration) -> f64 {
        let cameras = found.rig.cameras.iter().zip(&self.cameras);
        let intrinsic = cameras.flat_map(|(a, b)| [a.fx / b.fx - 1.0, a.fy / b.fy - 1.0, a.cx / b.cx - 1.0, a.cy / b.cy - 1.0]);
        let distortion = found.rig.cameras.iter().zip(&self.cameras).flat_map(|(a, b)| {
            let pairs = a.distortion.iter().zip(b.distortion);
            pairs.map(|(x, y)| x - y).collect::<Vec<_>>()
        });
        let between = found.rig.right_from_left * self.right_from_left.inverse();
        let pose = [between.translation.vector.norm() / self.right_from_left.translation.vector.norm(), between.rotation.angle()];
        intrinsic.chain(distortion).chain(pose).map(f64::abs).fold(0.0, f64::max)
    }
}
