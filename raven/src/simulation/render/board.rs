//! A checkerboard on a white plate. A pixel's ray meets its plane at `(X, Y)`; the pattern is the product of two soft square waves.

use nalgebra::{Isometry3, Matrix3, Point3, Vector2, Vector3};

use super::optics::{Optics, soft};
use super::{Area, Colour};

const WHITE: f32 = 222.0;
const BLACK: f32 = 24.0;

/// Size of a checkerboard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Inner corners per row and per column.
    pub corners: [u32; 2],
    /// Side of a square [m].
    pub square_m: f64,
}

/// A board in a camera's frame.
pub(crate) struct Plane {
    board: Board,
    /// From a ray to `(X, Y, 1)` times a number.
    plane_from_ray: Matrix3<f64>,
    /// Light on it.
    light: f32,
}

impl Board {
    /// Inner corners in the board's frame, row by row [m].
    pub fn corner_points(&self) -> impl Iterator<Item = Point3<f64>> {
        let Self { corners: [columns, rows], square_m } = *self;
        (0..rows).flat_map(move |y| (0..columns).map(move |x| Point3::new(f64::from(x) * square_m, f64::from(y) * square_m, 0.0)))
    }

    /// Corners of the white plate in the board's frame [m].
    #[must_use]
    pub fn plate(&self) -> [Point3<f64>; 4] {
        let [low, [right, bottom]] = self.edges(2.0);
        [
            Point3::new(low[0], low[1], 0.0),
            Point3::new(right, low[1], 0.0),
            Point3::new(right, bottom, 0.0),
            Point3::new(low[0], bottom, 0.0),
        ]
    }

    /// Left and top, right and bottom, `squares` beyond the inner corners [m].
    fn edges(&self, squares: f64) -> [[f64; 2]; 2] {
        let last = self.corners.map(|n| (f64::from(n) - 1.0 + squares) * self.square_m);
        [[-squares * self.square_m; 2], last]
    }

    /// The board in a camera's frame and the pixels it may touch; `None` where a part of it is behind the camera or it is seen from behind.
    pub(crate) fn place(&self, optics: &Optics, camera_from_board: &Isometry3<f64>) -> Option<(Plane, Area)> {
        let rotation = camera_from_board.rotation.to_rotation_matrix().into_inner();
        let origin = camera_from_board.translation.vector;
        let ray_from_plane = Matrix3::from_columns(&[rotation.column(0).into(), rotation.column(1).into(), origin]);
        let plane_from_ray = ray_from_plane.try_inverse()?;
        let normal: Vector3<f64> = rotation.column(2).into();
        let facing = normal.dot(&origin.normalize());
        if facing <= 0.0 {
            return None;
        }
        let mut low = Vector2::repeat(f64::INFINITY);
        let mut high = -low;
        for corner in self.plate() {
            let pixel = optics.camera().project(&(camera_from_board * corner).coords)?;
            (low, high) = (low.inf(&pixel), high.sup(&pixel));
        }
        let area = Area::about(optics.camera(), [low.x - 4.0, low.y - 4.0], [high.x + 4.0, high.y + 4.0]);
        let plane = Plane { board: *self, plane_from_ray, light: (0.62 + 0.38 * facing) as f32 };
        Some((plane, area))
    }
}

impl Plane {
    /// Cover and colour at a pixel.
    pub(crate) fn at(&self, optics: &Optics, index: usize) -> Option<(f32, Colour)> {
        let m = &self.plane_from_ray;
        let hit = m * optics.ray(index);
        let [x, y] = [hit.x / hit.z, hit.y / hit.z];
        // How fast X and Y change from pixel to pixel.
        let per_px = |row: usize, value: f64| {
            let slope = |column: usize| (m[(row, column)] - value * m[(2, column)]) / (hit.z * optics.focal_px());
            slope(0).hypot(slope(1))
        };
        let (step_x, step_y) = (per_px(0, x), per_px(1, y));
        let within = |squares: f64| {
            let [[left, top], [right, bottom]] = self.board.edges(squares);
            soft((x - left) / step_x) * soft((right - x) / step_x) * soft((y - top) / step_y) * soft((bottom - y) / step_y)
        };
        let cover = within(2.0);
        if cover <= 0.0 {
            return None;
        }
        let wave = |value: f64, step: f64, count: u32| {
            let place = (value / self.board.square_m).round().clamp(0.0, f64::from(count) - 1.0);
            let side = 2.0 * soft((value - place * self.board.square_m) / step) - 1.0;
            // Every line turns the sign.
            if (place as u32).is_multiple_of(2) { side } else { -side }
        };
        let [columns, rows] = self.board.corners;
        let dark = 0.5 * (1.0 + wave(x, step_x, columns) * wave(y, step_y, rows)) * within(1.0);
        let grey = self.light * (WHITE + dark * (BLACK - WHITE));
        Some((cover, [grey, grey, grey * 0.98]))
    }
}
