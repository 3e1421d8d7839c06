//! Rendered images for the tests: a shaded sphere at the end of a shaft before patches of colour, with motion blur, lens blur, noise,
//! chroma subsampling and JPEG compression.

use image::codecs::jpeg::{JpegDecoder, JpegEncoder};
use image::{DynamicImage, Rgb, RgbImage};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::camera::Pinhole;

/// What stands before the camera and how the camera sees it.
#[derive(Debug, Clone)]
pub struct Scene {
    pub camera: Pinhole,
    /// Radius of the marker [m].
    pub radius_m: f64,
    /// Marker's colour under full light.
    pub colour: [f64; 3],
    /// Light that comes from everywhere; the rest comes from `light`.
    pub ambient: f64,
    /// Direction towards the light, camera frame.
    pub light: Vector3<f64>,
    /// Brightness of the highlight.
    pub specular: f64,
    /// Standard deviation of the lens blur [px].
    pub blur_px: f64,
    /// Standard deviation of the noise, grey levels.
    pub noise: f64,
    /// Exponent of the camera's response: 1 linear, 2.2 like a television camera. Colours are given as the camera sends them.
    pub gamma: f64,
    /// JPEG quality; chroma at half resolution. `None`: raw RGB.
    pub quality: Option<u8>,
    /// Where the shaft leaves the marker in the image [rad]; `None`: no shaft.
    pub shaft_angle: Option<f64>,
    /// Discs in front of everything: centre, radius [px], colour.
    pub covers: Vec<(Vector2<f64>, f64, [f64; 3])>,
    /// Discs behind the marker: centre, radius [px], colour.
    pub decoys: Vec<(Vector2<f64>, f64, [f64; 3])>,
    /// Mean colour of the background.
    pub base: [f64; 3],
    /// Seed of the background.
    pub background: u64,
    /// How much its patches differ, 0 to 1.
    pub texture: f64,
}

impl Scene {
    pub fn new(camera: Pinhole) -> Self {
        Self {
            camera,
            radius_m: 0.005,
            colour: [40.0, 190.0, 30.0],
            ambient: 0.4,
            light: Vector3::new(0.3, -0.8, -0.5).normalize(),
            specular: 60.0,
            blur_px: 0.8,
            noise: 3.0,
            gamma: 1.0,
            quality: Some(85),
            shaft_angle: Some(1.0),
            covers: Vec::new(),
            decoys: Vec::new(),
            base: [105.0; 3],
            background: 1,
            texture: 1.0,
        }
    }

    /// The image of a marker that is at each of `path` [m, camera frame] for an equal share of the exposure.
    pub fn render(&self, path: &[Vector3<f64>], seed: u64) -> RgbImage {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let mut rng = ChaCha8Rng::seed_from_u64(self.background);
        let patches: Vec<([f64; 4], [f64; 3])> = (0..40)
            .map(|_| {
                let grey = self.texture * rng.random_range(-45.0..45.0);
                let tint = self.base.map(|base| base + grey + self.texture * rng.random_range(-18.0..18.0));
                ([0; 4].map(|_| rng.random_range(-1.0..1.0)), tint)
            })
            .collect();
        let mut pixels = vec![Vector3::zeros(); width * height];
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let (x, y) = ((i % width) as f64, (i / width) as f64);
            *pixel = self.behind(&patches, x, y);
        }
        for centre in path {
            self.draw(&mut pixels, centre, 1.0 / path.len() as f64, &patches);
        }
        self.expose(pixels, seed)
    }

    /// The light of which the camera makes a colour.
    fn light_of(&self, colour: Vector3<f64>) -> Vector3<f64> {
        colour.map(|v| 255.0 * (v.max(0.0) / 255.0).powf(self.gamma))
    }

    /// Straight-edged patches of muted colour, and the decoys.
    fn behind(&self, patches: &[([f64; 4], [f64; 3])], x: f64, y: f64) -> Vector3<f64> {
        let (w, h) = (f64::from(self.camera.width), f64::from(self.camera.height));
        let mut colour = Vector3::new(100.0, 95.0, 105.0);
        for (edge, tint) in patches {
            let (u, v) = (2.0 * x / w - 1.0, 2.0 * y / h - 1.0);
            if edge[0] * (u - edge[1]) + edge[2] * (v - edge[3]) > 0.6 {
                colour = Vector3::from(*tint);
            }
        }
        for (centre, radius, tint) in &self.decoys {
            if (Vector2::new(x, y) - centre).norm() < *radius {
                colour = Vector3::from(*tint);
            }
        }
        self.light_of(colour)
    }

    fn draw(&self, pixels: &mut [Vector3<f64>], centre: &Vector3<f64>, share: f64, patches: &[([f64; 4], [f64; 3])]) {
        const GRID: usize = 5;
        let (width, height) = (self.camera.width as i32, self.camera.height as i32);
        let middle = self.camera.project(centre).unwrap();
        let radius_px = self.camera.fx * self.radius_m / centre.z;
        let reach = (radius_px * 6.0) as i32 + 3;
        let shaft = self.shaft_angle.map(|a| Vector2::new(a.cos(), a.sin()));
        for y in (middle.y as i32 - reach).max(0)..(middle.y as i32 + reach).min(height) {
            for x in (middle.x as i32 - reach).max(0)..(middle.x as i32 + reach).min(width) {
                let under = self.behind(patches, f64::from(x), f64::from(y));
                let mut sum = Vector3::zeros();
                for k in 0..GRID * GRID {
                    let at = |i: usize| (i as f64 + 0.5) / GRID as f64 - 0.5;
                    let pixel = Vector2::new(f64::from(x) + at(k % GRID), f64::from(y) + at(k / GRID));
                    let along = shaft.map_or((0.0, 1e9), |s| ((pixel - middle).dot(&s), (pixel - middle).perp(&s)));
                    let behind = if along.0 > 0.0 && along.1.abs() < 0.5 * radius_px {
                        let shade = 1.0 - (along.1 / radius_px).powi(2) * 2.0;
                        self.light_of(Vector3::new(150.0, 140.0, 140.0)) * shade
                    } else {
                        under
                    };
                    sum += self.sphere(&pixel, centre).unwrap_or(behind);
                }
                let i = (y * width + x) as usize;
                pixels[i] += share * (sum / (GRID * GRID) as f64 - under);
            }
        }
    }

    /// Colour of the sphere where the ray through a pixel meets it.
    fn sphere(&self, pixel: &Vector2<f64>, centre: &Vector3<f64>) -> Option<Vector3<f64>> {
        let ray = self.camera.undistort(pixel)?.push(1.0).normalize();
        let nearest = ray.dot(centre);
        let under_root = nearest * nearest - centre.norm_squared() + self.radius_m * self.radius_m;
        (under_root > 0.0).then(|| {
            let normal = (ray * (nearest - under_root.sqrt()) - centre) / self.radius_m;
            let diffuse = normal.dot(&self.light).max(0.0);
            let half = (self.light - ray).normalize();
            let shine = normal.dot(&half).max(0.0).powi(30) * self.specular;
            self.light_of(Vector3::from(self.colour)) * (self.ambient + (1.0 - self.ambient) * diffuse) + Vector3::repeat(shine)
        })
    }

    /// Covers, lens, noise, compression.
    fn expose(&self, mut pixels: Vec<Vector3<f64>>, seed: u64) -> RgbImage {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        for (i, pixel) in pixels.iter_mut().enumerate() {
            let at = Vector2::new((i % width) as f64, (i / width) as f64);
            for (centre, radius, tint) in &self.covers {
                if (at - centre).norm() < *radius {
                    *pixel = self.light_of(Vector3::from(*tint));
                }
            }
        }
        let pixels = blur(&blur(&pixels, width, height, self.blur_px, true), width, height, self.blur_px, false);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let raw = RgbImage::from_fn(self.camera.width, self.camera.height, |x, y| {
            let noise = Vector3::from_fn(|_, _| normal()) * self.noise;
            let coded = pixels[y as usize * width + x as usize].map(|light| 255.0 * (light.max(0.0) / 255.0).powf(1.0 / self.gamma));
            Rgb((coded + noise).map(|v| v.round().clamp(0.0, 255.0) as u8).into())
        });
        self.quality.map_or(raw.clone(), |quality| decode(&encode(&halve_chroma(&raw), quality)))
    }
}

/// A JPEG file of an image.
pub fn encode(image: &RgbImage, quality: u8) -> Vec<u8> {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, quality).encode_image(image).unwrap();
    bytes
}

fn decode(bytes: &[u8]) -> RgbImage {
    DynamicImage::from_decoder(JpegDecoder::new(std::io::Cursor::new(bytes)).unwrap()).unwrap().to_rgb8()
}

fn blur(pixels: &[Vector3<f64>], width: usize, height: usize, sigma: f64, across: bool) -> Vec<Vector3<f64>> {
    let kernel: Vec<f64> = (-3..=3).map(|i| (-0.5 * f64::from(i * i) / (sigma * sigma)).exp()).collect();
    let total: f64 = kernel.iter().sum();
    (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as i32, (i / width) as i32);
            let at = |d: i32| if across { ((x + d).clamp(0, width as i32 - 1), y) } else { (x, (y + d).clamp(0, height as i32 - 1)) };
            let taps = (-3..=3).zip(&kernel).map(|(d, k)| (at(d), k));
            taps.map(|((u, v), k)| pixels[v as usize * width + u as usize] * *k).sum::<Vector3<f64>>() / total
        })
        .collect()
}

/// Colour at half the resolution in both directions, as most MJPEG has it: mean of 2x2, brought back by linear interpolation.
fn halve_chroma(image: &RgbImage) -> RgbImage {
    let (width, height) = image.dimensions();
    let ycc = |x: u32, y: u32| {
        let [r, g, b] = image.get_pixel(x.min(width - 1), y.min(height - 1)).0.map(f64::from);
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        Vector3::new(luma, (b - luma) / 1.772, (r - luma) / 1.402)
    };
    let half = |x: i32, y: i32| {
        let (x, y) = (x.clamp(0, width as i32 / 2 - 1) as u32, y.clamp(0, height as i32 / 2 - 1) as u32);
        (ycc(2 * x, 2 * y) + ycc(2 * x + 1, 2 * y) + ycc(2 * x, 2 * y + 1) + ycc(2 * x + 1, 2 * y + 1)) / 4.0
    };
    RgbImage::from_fn(width, height, |x, y| {
        let side = |v: u32| (v as i32 / 2, v as i32 / 2 + if v.is_multiple_of(2) { -1 } else { 1 });
        let ((x0, x1), (y0, y1)) = (side(x), side(y));
        let chroma = half(x0, y0) * 0.5625 + (half(x1, y0) + half(x0, y1)) * 0.1875 + half(x1, y1) * 0.0625;
        let luma = ycc(x, y).x;
        let (r, b) = (luma + 1.402 * chroma.z, luma + 1.772 * chroma.y);
        let g = (luma - 0.299 * r - 0.114 * b) / 0.587;
        Rgb([r, g, b].map(|v| v.round().clamp(0.0, 255.0) as u8))
    })
}
