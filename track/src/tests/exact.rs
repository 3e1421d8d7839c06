//! An exact renderer of one ball before an even background, and the Cramer-Rao bound of its centre.
//!
//! Light is added up over 5 x 5 points of a pixel, blurred by a Gaussian before, in grey levels: no model of an edge is involved. The bound
//! is that of all the renderer's parameters together, its derivatives taken numerically.

use image::{Rgb, RgbImage};
use nalgebra::{DMatrix, Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Points per pixel and direction.
const FINE: usize = 5;
/// Side of the image [px].
pub const SIDE: usize = 64;

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Drawn {
    pub centre: Vector2<f64>,
    pub radius_px: f64,
    pub colour: Vector3<f64>,
    pub background: Vector3<f64>,
    /// Towards the light, its length the part of the light that comes from there: zero for a flat disc.
    pub light: Vector3<f64>,
    pub blur_px: f64,
}

impl Drawn {
    /// Green before grey, as in the accuracy tables: the contrast is 131 grey levels over the three channels.
    pub fn disc(radius_px: f64) -> Self {
        Self {
            centre: Vector2::repeat(SIDE as f64 / 2.0),
            radius_px,
            colour: Vector3::new(40.0, 190.0, 30.0),
            background: Vector3::repeat(105.0),
            light: Vector3::zeros(),
            blur_px: 0.8,
        }
    }

    /// Grey levels without noise, row by row.
    pub fn render(&self) -> Vec<Vector3<f64>> {
        let margin = FINE * (4.0 * self.blur_px).ceil() as usize;
        let fine = SIDE * FINE + 2 * margin;
        let at = |i: usize| (i as f64 - margin as f64 + 0.5) / FINE as f64 - 0.5;
        // Light over the background at the fine points, along the marker's contrast and shade: two numbers for three channels.
        let point = |x: f64, y: f64| {
            let (dx, dy) = (x - self.centre.x, y - self.centre.y);
            let distance = dx.hypot(dy);
            let cover = (0.5 + (self.radius_px - distance) * FINE as f64).clamp(0.0, 1.0);
            let nz = (1.0 - (distance / self.radius_px).powi(2)).max(0.0).sqrt();
            let normal = Vector3::new(dx / self.radius_px, dy / self.radius_px, -nz);
            let lit = 1.0 - self.light.norm() + normal.dot(&self.light).max(0.0);
            [cover, cover * lit]
        };
        // The mean over a pixel of the blurred light, as one sum over the fine points.
        let sigma = self.blur_px * FINE as f64;
        let taps = FINE + 2 * margin;
        let gauss = |d: f64| (-0.5 * (d / sigma).powi(2)).exp();
        let kernel: Vec<f64> = (0..taps).map(|i| (0..FINE).map(|j| gauss(i as f64 - margin as f64 - j as f64)).sum()).collect();
        let total: f64 = kernel.iter().sum();
        let rows: Vec<Vec<[f64; 2]>> = (0..fine)
            .map(|y| {
                let row: Vec<[f64; 2]> = (0..fine).map(|x| point(at(x), at(y))).collect();
                (0..SIDE).map(|x| weighted(&kernel, total, row.iter().skip(x * FINE))).collect()
            })
            .collect();
        let mut image = Vec::with_capacity(SIDE * SIDE);
        for y in 0..SIDE {
            for x in 0..SIDE {
                let [cover, lit] = weighted(&kernel, total, rows.iter().skip(y * FINE).map(|row| &row[x]));
                image.push(self.background * (1.0 - cover) + self.colour * lit);
            }
        }
        image
    }

    /// The image with noise, in 8 bits, by a camera whose grey levels follow the light to the power `1 / gamma`; colours are grey levels in
    /// full light.
    pub fn photograph(&self, gamma: f64, noise: f64, rng: &mut ChaCha8Rng) -> RgbImage {
        let response = |v: f64, power: f64| 255.0 * (v / 255.0).max(0.0).powf(power);
        let to_light = |colour: Vector3<f64>| colour.map(|v| response(v, gamma));
        let light = Self { colour: to_light(self.colour), background: to_light(self.background), ..*self }.render();
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        RgbImage::from_fn(SIDE as u32, SIDE as u32, |x, y| {
            let level = light[y as usize * SIDE + x as usize];
            Rgb(level.map(|v| (response(v, 1.0 / gamma) + noise * normal()).round().clamp(0.0, 255.0) as u8).into())
        })
    }

    fn parameters(&self) -> Vec<f64> {
        let [a, b, c] = [self.colour, self.background, self.light].map(|v| [v.x, v.y, v.z]);
        let shape = [self.centre.x, self.centre.y, self.radius_px, self.blur_px];
        // The light of a flat disc is not free: it has no direction.
        let light: &[f64] = if self.light == Vector3::zeros() { &[] } else { &c };
        [&shape[..], &a, &b, light].concat()
    }

    fn with(&self, p: &[f64]) -> Self {
        let vector = |i: usize| Vector3::new(p[i], p[i + 1], p[i + 2]);
        let light = if p.len() > 10 { vector(10) } else { Vector3::zeros() };
        Self { centre: Vector2::new(p[0], p[1]), radius_px: p[2], blur_px: p[3], colour: vector(4), background: vector(7), light }
    }

    /// Least standard deviation per axis [px] that an unbiased estimate of the centre can have, everything else being unknown as well.
    pub fn bound_px(&self, noise: f64) -> f64 {
        let p = self.parameters();
        let columns: Vec<Vec<f64>> = (0..p.len())
            .map(|i| {
                let step = if i < 4 {
                    0.02
                } else if i < 10 {
                    1.0
                } else {
                    0.02
                };
                let moved = |by: f64| {
                    let mut q = p.clone();
                    q[i] += by;
                    self.with(&q).render()
                };
                let both = moved(step).into_iter().zip(moved(-step));
                both.flat_map(|(a, b)| ((a - b) / (2.0 * step)).data.0[0]).collect()
            })
            .collect();
        let jacobian = DMatrix::from_fn(columns[0].len(), p.len(), |row, column| columns[column][row]);
        let information = jacobian.transpose() * &jacobian / (noise * noise + 1.0 / 12.0);
        let covariance = information.try_inverse().unwrap();
        (0.5 * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt()
    }
}

fn weighted<'a>(kernel: &[f64], total: f64, values: impl Iterator<Item = &'a [f64; 2]>) -> [f64; 2] {
    let sum = kernel.iter().zip(values).fold([0.0; 2], |s, (k, v)| [s[0] + k * v[0], s[1] + k * v[1]]);
    sum.map(|s| s / total)
}
