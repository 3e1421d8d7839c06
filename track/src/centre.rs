//! Centre of a ball under smooth light, from all pixels of a blob and its edge by weighted least squares.
//!
//! A pixel's colour is a mixture of marker and background, in chroma and in luma:
//!
//! ```text
//! c = b + a (f - b),   a = 1 / (1 + exp(1.5976 t + 0.0706 t^3)),   t = d / w
//! ```
//!
//! `b` is the background nearby, `d` the distance from the outline, an ellipse about `(u, v)`, and `w` the blur of its edge:
//! `a` is the normal distribution to 0.0002. The marker's brightness `f` over the ball is that of a matt sphere: nine coefficients of the surface normal, as light of any direction
//! needs no more (Ramamoorthi and Hanrahan 2001). A centroid, of the mask or weighted, drifts towards the light by tenths of a pixel.
//! What fits badly weighs less (Huber), so a shaft before the ball, a highlight or an edge in the background do little harm.
//!
//! How much a pixel weighs in the first fit is set for a webcam's frames. The next sees from the residuals of the first how much noise there
//! is, how it is shared between chroma and luma, how well the edge is described and how much shade there is, and weighs by that: see
//! `refine`.

use fearless_simd::{Simd, dispatch};
use nalgebra::{SMatrix, SVector, Vector2};

use crate::correlated::{Influence, centre_variance_px2};
use crate::patch::{CHROMA, LUMA, Patch, Sample};
use crate::refine::{Residual, refined};
use crate::sieve::LEVEL;

/// `u, v`, radius, two elongations, blur of chroma and of luma, nine coefficients of brightness.
const SIZE: usize = 16;
const BLUR: usize = 5;
/// Where the coefficients of brightness begin: one of order 0, three of order 1, five of order 2.
pub const BRIGHTNESS: usize = 7;
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
const MODEL_ERROR: [f64; 2] = [0.03, 0.03];
/// Where a residual ceases to count by its square, in standard deviations.
const HUBER: f64 = 1.5;
/// What the camera's unknown response does to a ball that is lit from one side, per axis [px]: rendered balls lie where they are by a
/// linear response, and with grey levels of gamma 2.2, which most webcams send, they shift towards the light by 0.07 to 0.11 px, whatever
/// their size. All cameras that see the ball from one side err alike.
pub const RESPONSE_STD_PX: f64 = 0.07;
const ITERATIONS: usize = 15;
/// Steps smaller than this end a fit [px]: one that only gives weights, and one that gives the centre.
const ROUGH_PX: f64 = 0.02;
const FINE_PX: f64 = 2e-3;
/// Beyond so many blurs outside the outline a pixel tells nothing of the ball.
const OUTSIDE: f64 = 4.0;
/// The normal distribution by a logistic function of an odd polynomial (Page 1977).
const NORMAL: [f64; 2] = [1.5976, 0.070_565_992];
/// Height of the normal density.
const DENSITY: f64 = 0.398_942_280_401_432_7;

pub(crate) type Vector = SVector<f64, SIZE>;
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

/// What a residual is expected to be, in chroma and in luma.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Standard deviation of the noise, grey levels.
    pub noise: [f64; 2],
    /// What the model misses at the edge, share of the contrast.
    pub edge: [f64; 2],
    /// What it misses inside, share of the brightness.
    pub inside: [f64; 2],
    /// Where a residual ceases to count by its square, in standard deviations.
    pub huber: f64,
    /// Standard deviation of the coefficients of brightness of order 1 and 2, over the mean brightness.
    pub shade: [f64; 2],
}

impl Default for Weights {
    fn default() -> Self {
        Self { noise: [NOISE; 2], edge: [MODEL_ERROR[0]; 2], inside: [MODEL_ERROR[1]; 2], huber: HUBER, shade: BRIGHTNESS_STD }
    }
}

/// A fit that has settled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settled {
    pub(crate) x: Vector,
    covariance: Matrix,
    /// How many of the unknowns the pixels determined, not the prior.
    determined: f64,
}

impl Settled {
    /// Variances of the unknowns, neighbours taken to err independently.
    pub(crate) fn variance(&self) -> Vector {
        self.covariance.diagonal()
    }

    /// Standard deviation of the centre per axis [px], from a fit to `patch` with `weights`.
    fn noise_px(&self, patch: &Patch, weights: &Weights) -> f64 {
        let planes = [(CHROMA, 1.0), (LUMA, patch.luma_per_chroma)].map(|(k, gain)| {
            let influence = |sample: &Sample| {
                let place = Place::of(&self.x, sample);
                let told = place.tell(&self.x, sample, k, gain)?;
                let root_weight = told.weight(sample, weights, k).sqrt();
                let moves = self.covariance.fixed_rows::<2>(0) * Vector::from(told.row(&self.x, &place, k, gain)) * root_weight;
                Some(Influence { pixel: [sample.u as i32, sample.v as i32], whitened: root_weight * told.miss, moves_px: moves })
            };
            patch.samples[k].iter().filter_map(influence).collect()
        });
        centre_variance_px2(&planes, self.determined).sqrt()
    }
}

/// Fits a ball to a patch, from a centre and radius that are right to about a third of the radius, and again with the weights that each fit
/// gives to the next, so many times.
///
/// `None` where the fit does not settle near its start: what is there is no ball.
#[must_use]
pub fn fit(patch: &Patch, start_px: Vector2<f64>, radius_px: f64, again: usize) -> Option<Ball> {
    let start = Start { centre_px: start_px, radius_px, chroma: patch.chroma };
    // The first only gives weights and a place to go on from: every other pixel, as on a chessboard, tells enough.
    let mut weights = Weights::default();
    let mut weighed = patch.chessboard();
    let mut fitted = start.settle(&weighed, &weights, None, ROUGH_PX)?;
    for _ in 0..again {
        let (patch, refined) = refined(patch, &fitted);
        if let Some(better) = start.settle(&patch, &refined, Some(fitted.x), FINE_PX) {
            (fitted, weighed, weights) = (better, patch, refined);
        }
    }
    let std_px = fitted.noise_px(&weighed, &weights).hypot(RESPONSE_STD_PX);
    Some(Ball { centre_px: fitted.x.fixed_rows::<2>(0).into(), std_px, radius_px: fitted.x[2] })
}

/// Where a fit begins, and what it may not leave far.
struct Start {
    centre_px: Vector2<f64>,
    radius_px: f64,
    chroma: f64,
}

impl Start {
    fn settle(&self, patch: &Patch, weights: &Weights, from: Option<Vector>, smallest_px: f64) -> Option<Settled> {
        let mut prior = Vector::zeros();
        prior.fixed_rows_mut::<3>(0).copy_from_slice(&[self.centre_px.x, self.centre_px.y, self.radius_px]);
        prior.fixed_rows_mut::<2>(BLUR).copy_from_slice(&BLUR_PX);
        prior[BRIGHTNESS] = self.chroma;
        let [first, second] = weights.shade.map(|share| (share * self.chroma).powi(-2));
        let e = ELONGATION_STD.powi(-2);
        let w = BLUR_STD_PX.powi(-2);
        let stiffness = Vector::from([0.0, 0.0, 0.0, e, e, w, w, 0.0, first, first, first, second, second, second, second, second]);

        let mut x = from.unwrap_or(prior);
        for _ in 0..ITERATIONS {
            let mut normal = Normal { matrix: [[0.0; SIZE]; SIZE], vector: [0.0; SIZE] };
            dispatch!(*LEVEL, simd => add_all(simd, &mut normal, &x, patch, weights));
            let (step, covariance) = normal.solve(&stiffness, &(prior - x))?;
            let largest = step.fixed_rows::<3>(0).amax();
            x += step * (2.0 / largest).min(1.0);
            for blur in x.fixed_rows_mut::<2>(BLUR).iter_mut() {
                *blur = blur.clamp(0.4, 3.0);
            }
            let moved = (Vector2::new(x[0], x[1]) - self.centre_px).norm();
            if !(moved < 0.5 * self.radius_px + 1.0 && (0.6..1.6).contains(&(x[2] / self.radius_px))) {
                return None;
            }
            if largest < smallest_px {
                let determined = SIZE as f64 - stiffness.dot(&covariance.diagonal());
                return Some(Settled { x, covariance, determined });
            }
        }
        None
    }
}

/// What the model says of a pixel, in one coordinate of colour.
pub(crate) struct Told {
    /// Colour seen minus colour told.
    pub(crate) miss: f64,
    /// Share of the marker in the pixel.
    pub(crate) share: f64,
    /// Marker minus background.
    pub(crate) contrast: f64,
    /// The marker's own colour there.
    pub(crate) bright: f64,
    slope: f64,
    t: f64,
    harmonics: [f64; 9],
}

impl Told {
    /// Weight of the squared miss: the inverse of its expected square, less for outliers.
    #[inline(always)]
    fn weight(&self, sample: &Sample, weights: &Weights, k: usize) -> f64 {
        let &Self { miss, share, contrast, bright, .. } = self;
        let variance = weights.noise[k].powi(2)
            + (1.0 - share).powi(2) * sample.texture
            + (weights.edge[k] * 4.0 * share * (1.0 - share) * contrast).powi(2)
            + (weights.inside[k] * share * bright).powi(2);
        (weights.huber * variance.sqrt() / miss.abs().max(1e-9)).min(1.0) / variance
    }

    /// Derivatives of the colour told by the unknowns.
    #[inline(always)]
    fn row(&self, x: &Vector, place: &Place, k: usize, gain: f64) -> [f64; SIZE] {
        let &Self { share, slope, t, ref harmonics, .. } = self;
        let [stretched_x, stretched_y] = place.stretched;
        let mut row = [0.0; SIZE];
        row[0] = -slope * (stretched_x * (1.0 + x[3]) + stretched_y * x[4]) / place.from_centre;
        row[1] = -slope * (stretched_x * x[4] + stretched_y * (1.0 - x[3])) / place.from_centre;
        row[2] = -slope;
        row[3] = slope * (stretched_x * place.dx - stretched_y * place.dy) / place.from_centre;
        row[4] = slope * (stretched_x * place.dy + stretched_y * place.dx) / place.from_centre;
        row[BLUR + k] = -slope * t;
        for (entry, harmonic) in row[BRIGHTNESS..].iter_mut().zip(harmonics) {
            *entry = gain * share * harmonic;
        }
        row
    }
}

/// A pixel's place on the outline's own scale.
struct Place {
    dx: f64,
    dy: f64,
    stretched: [f64; 2],
    from_centre: f64,
    distance: f64,
}

impl Place {
    #[inline(always)]
    fn of(x: &Vector, sample: &Sample) -> Self {
        let (dx, dy) = (sample.u - x[0], sample.v - x[1]);
        let stretched = [(1.0 + x[3]) * dx + x[4] * dy, x[4] * dx + (1.0 - x[3]) * dy];
        let from_centre = (stretched[0] * stretched[0] + stretched[1] * stretched[1]).sqrt().max(1e-6);
        Self { dx, dy, stretched, from_centre, distance: from_centre - x[2] }
    }

    /// `None` where the pixel is all background.
    #[inline(always)]
    fn tell(&self, x: &Vector, sample: &Sample, k: usize, gain: f64) -> Option<Told> {
        let blur = x[BLUR + k];
        let t = (self.distance / blur).max(-8.0);
        if t > OUTSIDE {
            return None;
        }
        let share = 1.0 / (1.0 + (t * (NORMAL[0] + NORMAL[1] * t * t)).exp());
        // Blur brings the marker's light to a pixel from within the outline: the mean of the distances below 0.
        let within = (t - DENSITY * (-0.5 * t * t).exp() / share) * blur;
        // The ball's surface normal there, and its products: spherical harmonics up to the second order.
        let inwards = (x[2] + within).max(0.0) / (self.from_centre * x[2]);
        let (nx, ny) = (self.dx * inwards, self.dy * inwards);
        let nz = (1.0 - nx * nx - ny * ny).max(0.0).sqrt();
        let harmonics = [1.0, nx, ny, nz, nx * ny, nx * nz, ny * nz, nx * nx - ny * ny, 3.0 * nz * nz - 1.0];
        let brightness: f64 = harmonics.iter().enumerate().map(|(i, h)| h * x[BRIGHTNESS + i]).sum();
        let bright = gain * brightness;
        let contrast = bright - sample.background;
        let miss = sample.colour - sample.background - share * contrast;
        let slope = -share * (1.0 - share) * (NORMAL[0] + 3.0 * NORMAL[1] * t * t) / blur * contrast;
        Some(Told { miss, share, contrast, bright, slope, t, harmonics })
    }
}

/// Residuals of all pixels that tell something of the ball.
pub(crate) fn residuals(patch: &Patch, x: &Vector) -> impl Iterator<Item = Residual> {
    let [chroma, luma] = &patch.samples;
    chroma.iter().zip(luma).filter_map(|(chroma, luma)| {
        let place = Place::of(x, chroma);
        Some(Residual { told: [place.tell(x, chroma, CHROMA, 1.0)?, place.tell(x, luma, LUMA, patch.luma_per_chroma)?] })
    })
}

/// Normal equations of one Gauss-Newton step.
struct Normal {
    matrix: [[f64; SIZE]; SIZE],
    vector: [f64; SIZE],
}

#[inline(always)]
fn add_all<S: Simd>(_: S, normal: &mut Normal, x: &Vector, patch: &Patch, weights: &Weights) {
    for (k, gain) in [(CHROMA, 1.0), (LUMA, patch.luma_per_chroma)] {
        for sample in &patch.samples[k] {
            let place = Place::of(x, sample);
            if let Some(told) = place.tell(x, sample, k, gain) {
                normal.add(&told.row(x, &place, k, gain), told.weight(sample, weights, k), told.miss);
            }
        }
    }
}

impl Normal {
    #[inline(always)]
    fn add(&mut self, row: &[f64; SIZE], weight: f64, miss: f64) {
        for i in 0..SIZE {
            let weighted = weight * row[i];
            self.vector[i] += weighted * miss;
            for (entry, value) in self.matrix[i].iter_mut().zip(row) {
                *entry += weighted * value;
            }
        }
    }

    /// The step and the covariance, where a prior of this stiffness is so far away.
    fn solve(&self, stiffness: &Vector, to_prior: &Vector) -> Option<(Vector, Matrix)> {
        let matrix = Matrix::from_fn(|i, j| self.matrix[i][j]) + Matrix::from_diagonal(stiffness);
        let covariance = matrix.cholesky()?.inverse();
        let step = covariance * (Vector::from(self.vector) + stiffness.component_mul(to_prior));
        step.iter().all(|v| v.is_finite()).then_some((step, covariance))
    }
}
