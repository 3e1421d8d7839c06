//! Centre of a ball under smooth light, from all pixels of a blob and its edge by weighted least squares.
//!
//! A pixel's colour is a mixture of marker and background, in chroma and in luma:
//!
//! ```text
//! c = b + a (f - b),   a = 1 / (1 + exp(d / 0.55 w))
//! ```
//!
//! `b` is the background nearby, `d` the distance from the outline, an ellipse about `(u, v)`, and `w` the blur of its edge. The
//! marker's brightness `f` over the ball is that of a matt sphere: nine coefficients of the surface normal, as light of any direction
//! needs no more (Ramamoorthi and Hanrahan 2001). A centroid, of the mask or weighted, drifts towards the light by tenths of a pixel.
//! What fits badly weighs less (Huber), so a shaft before the ball, a highlight or an edge in the background do little harm.

use nalgebra::{SMatrix, SVector, Vector2};

use crate::patch::{Patch, Sample};

/// `u, v`, radius, two elongations, blur of chroma and of luma, nine coefficients of brightness.
const SIZE: usize = 16;
const BLUR: usize = 5;
const BRIGHTNESS: usize = 7;
/// Blur of chroma, usually at half the resolution, and of luma [px].
const BLUR_PX: [f64; 2] = [1.3, 1.0];
const BLUR_STD_PX: f64 = 0.3;
/// Elongation of the outline: perspective and motion within the exposure.
const ELONGATION_STD: f64 = 0.1;
/// Standard deviation of the coefficients of first and of second order over the mean brightness: how a matt sphere attenuates them.
const BRIGHTNESS_STD: [f64; 2] = [0.7, 0.15];
/// Noise of a webcam, grey levels.
const NOISE: f64 = 3.0;
/// What the model misses: share of the contrast at the edge, share of the brightness inside.
const MODEL_ERROR: [f64; 2] = [0.1, 0.05];
/// Where a residual ceases to count by its square, in standard deviations.
const HUBER: f64 = 1.0;
/// Neighbouring pixels err together, by compression and by texture behind the edge, so that the fit's own standard deviation is too small.
const CORRELATION: f64 = 2.5;
/// What the camera's unknown response does: rendered balls shift by -0.03 px along the light for a linear one, by 0.09 px for gamma 2.2.
/// With both figures the squared error is 0.5 to 1.5 of the stated variance on rendered balls, from raw and linear to JPEG and gamma 2.2.
const RESPONSE_STD_PX: f64 = 0.05;
const ITERATIONS: usize = 15;

type Vector = SVector<f64, SIZE>;
type Matrix = SMatrix<f64, SIZE, SIZE>;

/// A centre with its standard deviation per axis, and the radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Centre of the outline `(u, v)` [px].
    pub centre_px: Vector2<f64>,
    /// Per axis [px].
    pub std_px: f64,
    /// Mean radius of the outline [px].
    pub radius_px: f64,
}

/// Fits a ball to a patch, from a centre and radius that are right to about a third of the radius.
///
/// `None` where the fit does not settle near its start: what is there is no ball.
#[must_use]
pub fn fit(patch: &Patch, start_px: Vector2<f64>, radius_px: f64) -> Option<Ball> {
    let mut prior = Vector::zeros();
    prior.fixed_rows_mut::<3>(0).copy_from_slice(&[start_px.x, start_px.y, radius_px]);
    prior.fixed_rows_mut::<2>(BLUR).copy_from_slice(&BLUR_PX);
    prior[BRIGHTNESS] = patch.chroma;
    let [first, second] = BRIGHTNESS_STD.map(|share| (share * patch.chroma).powi(-2));
    let e = ELONGATION_STD.powi(-2);
    let w = BLUR_STD_PX.powi(-2);
    let stiffness = Vector::from([0.0, 0.0, 0.0, e, e, w, w, 0.0, first, first, first, second, second, second, second, second]);

    let mut x = prior;
    for _ in 0..ITERATIONS {
        let mut normal =
            Normal { matrix: Matrix::from_diagonal(&stiffness), vector: stiffness.component_mul(&(prior - x)), ..Normal::default() };
        for sample in &patch.samples {
            normal.add(&x, sample, [1.0, patch.luma_per_chroma]);
        }
        let (step, covariance, misfit) = normal.solve()?;
        let largest = step.fixed_rows::<3>(0).amax();
        x += step * (2.0 / largest).min(1.0);
        for blur in x.fixed_rows_mut::<2>(BLUR).iter_mut() {
            *blur = blur.clamp(0.4, 3.0);
        }
        let moved = (Vector2::new(x[0], x[1]) - start_px).norm();
        if !(moved < 0.5 * radius_px + 1.0 && (0.6..1.6).contains(&(x[2] / radius_px))) {
            return None;
        }
        if largest < 2e-3 {
            let noise_px = CORRELATION * (0.5 * misfit.max(1.0) * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt();
            let std_px = noise_px.hypot(RESPONSE_STD_PX);
            return Some(Ball { centre_px: Vector2::new(x[0], x[1]), std_px, radius_px: x[2] });
        }
    }
    None
}

/// Normal equations of one Gauss-Newton step.
#[derive(Default)]
struct Normal {
    matrix: Matrix,
    vector: Vector,
    squares: f64,
    count: f64,
}

impl Normal {
    fn add(&mut self, x: &Vector, sample: &Sample, gain: [f64; 2]) {
        let (dx, dy) = (sample.u - x[0], sample.v - x[1]);
        let (stretched_x, stretched_y) = ((1.0 + x[3]) * dx + x[4] * dy, x[4] * dx + (1.0 - x[3]) * dy);
        let from_centre = stretched_x.hypot(stretched_y).max(1e-6);
        let distance = from_centre - x[2];
        for k in 0..2 {
            let softness = 0.55 * x[BLUR + k];
            let z = (distance / softness).clamp(-40.0, 40.0);
            let share = 1.0 / (1.0 + z.exp());
            let edge = share * (1.0 - share);
            // Blur brings the marker's light to a pixel from within the outline: the mean distance over the logistic kernel.
            let within = -softness * (-z).exp().ln_1p() / share;
            // The ball's surface normal there, and its products: spherical harmonics up to the second order.
            let inwards = (x[2] + within).max(0.0) / (from_centre * x[2]);
            let (nx, ny) = (dx * inwards, dy * inwards);
            let nz = (1.0 - nx * nx - ny * ny).max(0.0).sqrt();
            let harmonics = [1.0, nx, ny, nz, nx * ny, nx * nz, ny * nz, nx * nx - ny * ny, 3.0 * nz * nz - 1.0];
            let brightness: f64 = harmonics.iter().enumerate().map(|(i, h)| h * x[BRIGHTNESS + i]).sum();
            let contrast = gain[k] * brightness - sample.background[k];
            let miss = sample.colour[k] - sample.background[k] - share * contrast;
            let variance = NOISE * NOISE
                + (1.0 - share).powi(2) * sample.texture[k]
                + (MODEL_ERROR[0] * 4.0 * edge * contrast).powi(2)
                + (MODEL_ERROR[1] * share * gain[k] * brightness).powi(2);
            let slope = -edge / softness * contrast;
            let mut row = [0.0; SIZE];
            row[0] = -slope * (stretched_x * (1.0 + x[3]) + stretched_y * x[4]) / from_centre;
            row[1] = -slope * (stretched_x * x[4] + stretched_y * (1.0 - x[3])) / from_centre;
            row[2] = -slope;
            row[3] = slope * (stretched_x * dx - stretched_y * dy) / from_centre;
            row[4] = slope * (stretched_x * dy + stretched_y * dx) / from_centre;
            row[BLUR + k] = -slope * z * 0.55;
            for (entry, harmonic) in row[BRIGHTNESS..].iter_mut().zip(harmonics) {
                *entry = gain[k] * share * harmonic;
            }
            let weight = (HUBER * variance.sqrt() / miss.abs()).min(1.0) / variance;
            self.squares += weight * miss * miss;
            self.count += 1.0;
            for i in 0..SIZE {
                let weighted = weight * row[i];
                self.vector[i] += weighted * miss;
                for (entry, value) in self.matrix.column_mut(i).iter_mut().zip(&row) {
                    *entry += weighted * value;
                }
            }
        }
    }

    /// The step, the covariance and the mean squared residual.
    fn solve(&self) -> Option<(Vector, Matrix, f64)> {
        let covariance = self.matrix.cholesky()?.inverse();
        let step = covariance * self.vector;
        step.iter().all(|v| v.is_finite()).then_some((step, covariance, self.squares / self.count))
    }
}
