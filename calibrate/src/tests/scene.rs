//! Pictures of a checkerboard whose corners are known exactly, for tests.
//!
//! Each pixel is the mean of 4x4 rays onto the board's plane, after a Gaussian blur of the lens, plus independent noise.

use image::GrayImage;
use nalgebra::{Isometry3, Point3, Vector2};
use rand::Rng;
use rand_distr::{Distribution, Normal};
use raven::camera::Pinhole;

use crate::board::Board;

/// A board before a camera.
pub struct Scene {
    /// Who looks.
    pub camera: Pinhole,
    /// At what.
    pub board: Board,
    /// `x_camera = camera_from_board x_board`.
    pub camera_from_board: Isometry3<f64>,
    /// Standard deviation of the lens's blur [px].
    pub blur_px: f64,
    /// Standard deviation of the noise [grey levels].
    pub noise: f64,
}

/// Rays per pixel and axis.
const RAYS: usize = 4;

impl Scene {
    /// The picture.
    pub fn render(&self, rng: &mut impl Rng) -> GrayImage {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let grey = blurred(&self.sharp(width, height), width * RAYS, self.blur_px * RAYS as f64);
        let noise = Normal::new(0.0, self.noise).unwrap();
        GrayImage::from_fn(self.camera.width, self.camera.height, |x, y| {
            let grey = grey[y as usize * width + x as usize] + noise.sample(rng);
            image::Luma([grey.round().clamp(0.0, 255.0) as u8])
        })
    }

    /// Where the corner of a label is in the picture [px].
    pub fn corner(&self, label: crate::grid::Label) -> Option<Vector2<f64>> {
        self.camera.project(&(self.camera_from_board * Point3::from(self.board.point(label))).coords)
    }

    fn sharp(&self, width: usize, height: usize) -> Vec<f64> {
        // The distortion hardly changes within a pixel: undo it at the pixels' corners, and go straight between them.
        let normal = |x: usize, y: usize| self.camera.undistort(&Vector2::new(x as f64 - 0.5, y as f64 - 0.5)).unwrap();
        let corners: Vec<Vector2<f64>> = (0..=height).flat_map(|y| (0..=width).map(move |x| normal(x, y))).collect();
        let board_from_camera = self.camera_from_board.inverse();
        let (rotation, origin) = (board_from_camera.rotation.to_rotation_matrix(), board_from_camera.translation.vector);
        let mut image = vec![0.0; width * height * RAYS * RAYS];
        for (index, grey) in image.iter_mut().enumerate() {
            let (x, y) = (index % (width * RAYS), index / (width * RAYS));
            let at = |x: usize, y: usize| corners[y * (width + 1) + x];
            let (px, py) = (x / RAYS, y / RAYS);
            let (fx, fy) = (((x % RAYS) as f64 + 0.5) / RAYS as f64, ((y % RAYS) as f64 + 0.5) / RAYS as f64);
            let upper = at(px, py).lerp(&at(px + 1, py), fx);
            let lower = at(px, py + 1).lerp(&at(px + 1, py + 1), fx);
            let ray = rotation * upper.lerp(&lower, fy).push(1.0);
            let hit = origin - ray * (origin.z / ray.z);
            *grey = self.paint(hit.x / self.board.square_m, hit.y / self.board.square_m);
        }
        image
    }

    /// Grey of the board's plane, in squares from the first inner corner; the square after it is dark.
    fn paint(&self, x: f64, y: f64) -> f64 {
        let (columns, rows) = (self.board.size.columns as f64, self.board.size.rows as f64);
        let within = |margin: f64| x > -margin && y > -margin && x < columns - 1.0 + margin && y < rows - 1.0 + margin;
        match (within(1.0), within(1.7)) {
            (true, _) if (x.floor() + y.floor()).rem_euclid(2.0) < 0.5 => 40.0,
            (true, _) | (_, true) => 200.0,
            _ => 110.0,
        }
    }
}

/// Pixels of the rays after a Gaussian blur, with the image's edge repeated.
fn blurred(rays: &[f64], width: usize, sigma: f64) -> Vec<f64> {
    let reach = (3.5 * sigma).ceil() as isize;
    let gauss = |k: isize| (-0.5 * (k as f64 / sigma.max(1e-9)).powi(2)).exp();
    // Blur and the mean over a pixel's rays in one; a blur ends at its reach.
    let of_ray = |k: isize, ray: isize| if (k - ray).abs() <= reach { gauss(k - ray) } else { 0.0 };
    let last = reach + RAYS as isize - 1;
    let weights: Vec<f64> = (-reach..=last).map(|k| (0..RAYS as isize).map(|ray| of_ray(k, ray)).sum()).collect();
    let total: f64 = weights.iter().sum();
    // Lines of `apart` values side by side, `length` rays long.
    let along = |image: &[f64], length: usize, apart: usize| -> Vec<f64> {
        let pixels = length / RAYS;
        let pixel = |index: usize| {
            let (beside, pixel, start) = (index % apart, index / apart % pixels, index / (apart * pixels) * length * apart);
            let at = |k: isize| image[start + ((pixel * RAYS) as isize + k).clamp(0, length as isize - 1) as usize * apart + beside];
            (-reach..=last).zip(&weights).map(|(k, w)| w * at(k)).sum::<f64>() / total
        };
        (0..image.len() / RAYS).map(pixel).collect()
    };
    let across = along(rays, width, 1);
    along(&across, rays.len() / width, width / RAYS)
}
