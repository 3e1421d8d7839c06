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
//! `refine`. A refined fit tries the light of one lamp besides, which nine coefficients only follow.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x16};
use nalgebra::{SMatrix, SVector, Vector2};

use crate::correlated::{Influence, centre_variance_px2};
use crate::model::{Model, Shade};
use crate::normal::{Normal, Sums};
use crate::patch::{CHROMA, LANES, LUMA, Patch};
use crate::refine::{Residual, refined};
use crate::sieve::LEVEL;

/// `u, v`, radius, two elongations, blur of chroma and of luma, nine coefficients of brightness.
pub(crate) const SIZE: usize = 16;
/// Where the blurs are; before them the outline.
pub(crate) const BLUR: usize = 5;
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
/// How often a refined fit takes new weights: they settle after two or three times. Before which of them it looks for a lamp.
const REFINED: usize = 5;
const LAMP_AT: usize = 3;
/// Standard deviation of a lamp's light over the mean brightness; what else harmonics follow is not there.
const LAMP_STD: [f64; 2] = [2.0, 1e-6];
const ITERATIONS: usize = 15;
/// Steps smaller than this end a fit that only gives weights [px].
const ROUGH_PX: f64 = 0.02;
/// Steps that end one that gives the centre: smaller than this [px], or than this part of its standard deviation.
const FINE_PX: f64 = 2e-3;
const FINE: f64 = 0.1;

pub(crate) type Vector = SVector<f64, SIZE>;
pub(crate) type Matrix = SMatrix<f64, SIZE, SIZE>;

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

/// What a residual of one coordinate of colour is expected to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Standard deviation of the noise, grey levels.
    pub noise: f64,
    /// What the model misses at the edge, share of the contrast.
    pub edge: f64,
    /// What it misses inside, share of the brightness.
    pub inside: f64,
    /// Where a residual ceases to count by its square, in standard deviations.
    pub huber: f64,
}

/// What weighs in a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// In chroma and in luma.
    pub expected: [Expected; 2],
    /// Standard deviation of the coefficients of brightness of order 1 and 2, over the mean brightness.
    pub shade: [f64; 2],
}

impl Default for Weights {
    fn default() -> Self {
        let expected = Expected { noise: NOISE, edge: MODEL_ERROR[0], inside: MODEL_ERROR[1], huber: HUBER };
        Self { expected: [expected; 2], shade: BRIGHTNESS_STD }
    }
}

/// A fit that has settled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settled {
    pub(crate) x: Vector,
    pub(crate) shade: Shade,
    /// Weighted squares of the residuals.
    square: f64,
    covariance: Matrix,
    /// How many of the unknowns the pixels determined, not the prior.
    determined: f64,
}

impl Settled {
    /// Whether it says as much of a patch as another fit with the same weights, but for what each unknown more explains by chance, and has
    /// fewer unknowns: compression makes what looks like a little light from somewhere.
    fn is_simpler_than(&self, other: &Self) -> bool {
        let fewer = other.determined - self.determined;
        fewer > 0.0 && self.square - other.square < fewer
    }

    /// Variances of the unknowns, neighbours taken to err independently.
    pub(crate) fn variance(&self) -> Vector {
        self.covariance.diagonal()
    }

    /// Standard deviation of the centre per axis [px], from a fit to `patch` with `weights`.
    fn noise_px(&self, patch: &Patch, weights: &Weights) -> f64 {
        let mut planes = [Vec::new(), Vec::new()];
        dispatch!(*LEVEL, simd => add_influences(simd, &mut planes, self, patch, weights));
        centre_variance_px2(&planes, self.determined).sqrt()
    }
}

/// Fits a ball to a patch, from a centre and radius that are right to about a third of the radius, and once more with the weights that the
/// fit gives; `refine` until these settle, and under the light of one lamp where that says as much with fewer unknowns.
///
/// `None` where the fit does not settle near its start: what is there is no ball.
#[must_use]
pub fn fit(patch: &Patch, start_px: Vector2<f64>, radius_px: f64, refine: bool) -> Option<Ball> {
    let start = Start { centre_px: start_px, radius_px, chroma: patch.chroma };
    // The first only gives weights and a place to go on from: every other pixel, as on a chessboard, tells enough.
    let mut weights = Weights::default();
    let mut weighed = patch.chessboard();
    let mut fitted = start.settle(&weighed, &weights, Shade::Harmonics, None)?;
    for pass in 1..=if refine { REFINED } else { 1 } {
        if pass == LAMP_AT {
            let lit = start.settle(&weighed, &weights, Shade::Lamp, Some(under_lamp(&fitted.x)));
            fitted = lit.filter(|lit| lit.is_simpler_than(&fitted)).unwrap_or(fitted);
        }
        let (patch, refined) = refined(patch, &fitted);
        if let Some(better) = start.settle(&patch, &refined, fitted.shade, Some(fitted.x)) {
            (fitted, weighed, weights) = (better, patch, refined);
        }
    }
    let std_px = fitted.noise_px(&weighed, &weights).hypot(RESPONSE_STD_PX);
    Some(Ball { centre_px: fitted.x.fixed_rows::<2>(0).into(), std_px, radius_px: fitted.x[2] })
}

/// The light of one lamp that harmonics of the first order follow: of `a + max(0, n . l)` they are `a + |l| / 4 + n . l / 2`.
fn under_lamp(x: &Vector) -> Vector {
    let mut lit = *x;
    lit.fixed_rows_mut::<5>(BRIGHTNESS + 4).fill(0.0);
    let lamp = x.fixed_rows::<3>(BRIGHTNESS + 1) * 2.0;
    lit.fixed_rows_mut::<3>(BRIGHTNESS + 1).copy_from(&lamp);
    lit[BRIGHTNESS] -= 0.25 * lamp.norm();
    lit
}

/// Where a fit begins, and what it may not leave far.
struct Start {
    centre_px: Vector2<f64>,
    radius_px: f64,
    chroma: f64,
}

impl Start {
    /// From where another fit has settled, or roughly from the start.
    fn settle(&self, patch: &Patch, weights: &Weights, shade: Shade, from: Option<Vector>) -> Option<Settled> {
        let mut prior = Vector::zeros();
        prior.fixed_rows_mut::<3>(0).copy_from_slice(&[self.centre_px.x, self.centre_px.y, self.radius_px]);
        prior.fixed_rows_mut::<2>(BLUR).copy_from_slice(&BLUR_PX);
        prior[BRIGHTNESS] = self.chroma;
        let [first, second] = if shade == Shade::Lamp { LAMP_STD } else { weights.shade }.map(|share| (share * self.chroma).powi(-2));
        let e = ELONGATION_STD.powi(-2);
        let w = BLUR_STD_PX.powi(-2);
        let stiffness = Vector::from([0.0, 0.0, 0.0, e, e, w, w, 0.0, first, first, first, second, second, second, second, second]);

        let mut x = from.unwrap_or(prior);
        for _ in 0..ITERATIONS {
            let normal = dispatch!(*LEVEL, simd => normal_of(simd, &x, shade, patch, weights));
            let (step, factors) = normal.solve(&stiffness, &(prior - x))?;
            let largest = step.fixed_rows::<3>(0).amax();
            x += step * (2.0 / largest).min(1.0);
            for blur in x.fixed_rows_mut::<2>(BLUR).iter_mut() {
                *blur = blur.clamp(0.4, 3.0);
            }
            let moved = (Vector2::new(x[0], x[1]) - self.centre_px).norm();
            if !(moved < 0.5 * self.radius_px + 1.0 && (0.6..1.6).contains(&(x[2] / self.radius_px))) {
                return None;
            }
            if largest < ROUGH_PX {
                let covariance = factors.inverse();
                let std_px = (0.5 * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt();
                if from.is_none() || largest < FINE_PX.max(FINE * std_px) {
                    let determined = SIZE as f64 - stiffness.dot(&covariance.diagonal());
                    return Some(Settled { x, shade, square: normal.square, covariance, determined });
                }
            }
        }
        None
    }
}

/// Residuals of all pixels that tell something of the ball in chroma and in luma.
pub(crate) fn residuals(patch: &Patch, settled: &Settled) -> Vec<Residual> {
    let mut residuals = Vec::with_capacity(LANES * patch.blocks.len());
    dispatch!(*LEVEL, simd => add_residuals(simd, &mut residuals, patch, settled));
    residuals
}

#[inline(always)]
fn add_residuals<S: Simd>(simd: S, residuals: &mut Vec<Residual>, patch: &Patch, settled: &Settled) {
    let model = Model::new(simd, &settled.x, settled.shade, patch.corner);
    for block in &patch.blocks {
        let place = model.place(block.u, block.v);
        let told = [CHROMA, LUMA].map(|k| model.tell(&block.planes[k], &place, patch.channel(k)));
        residuals.extend((0..LANES).filter(|&i| told.iter().all(|told| told.tells.test(i))).map(|i| Residual::of(&told, i)));
    }
}

#[inline(always)]
fn normal_of<S: Simd>(simd: S, x: &Vector, shade: Shade, patch: &Patch, weights: &Weights) -> Normal {
    let model = Model::new(simd, x, shade, patch.corner);
    let mut sums = Sums::zero(simd);
    for block in &patch.blocks {
        let place = model.place(block.u, block.v);
        for k in [CHROMA, LUMA] {
            let told = model.tell(&block.planes[k], &place, patch.channel(k));
            sums.add(&told, told.weights(simd, &block.planes[k], &weights.expected[k]));
        }
    }
    sums.over_lanes()
}

#[inline(always)]
fn add_influences<S: Simd>(simd: S, influences: &mut [Vec<Influence>; 2], settled: &Settled, patch: &Patch, weights: &Weights) {
    let model = Model::new(simd, &settled.x, settled.shade, patch.corner);
    for block in &patch.blocks {
        let place = model.place(block.u, block.v);
        for (k, influences) in influences.iter_mut().enumerate() {
            let told = model.tell(&block.planes[k], &place, patch.channel(k));
            let root_weights = told.weights(simd, &block.planes[k], &weights.expected[k]).sqrt();
            let mut moves_px = [f32x16::splat(simd, 0.0); 2];
            for (j, row) in told.rows.iter().enumerate() {
                for (axis, moves_px) in moves_px.iter_mut().enumerate() {
                    *moves_px += *row * root_weights * settled.covariance[(axis, j)] as f32;
                }
            }
            let whitened = root_weights * told.miss;
            let of = |i: usize| Influence {
                pixel: [block.u[i] as i32, block.v[i] as i32],
                whitened: whitened[i],
                moves_px: moves_px.map(|moves| moves[i]),
            };
            influences.extend((0..LANES).filter(|&i| told.tells.test(i)).map(of));
        }
    }
}
