//! What the pixels of a patch say of a ball, one by one: the whole of a frame that was not compressed, and a start for one that was.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x16};

use crate::centre::{Errors, Evidence, RESPONSE_STD_PX, Settled, Vector};
use crate::correlated::{Influence, centre_covariance_px2};
use crate::model::{Model, Shade};
use crate::normal::{Normal, Sums};
use crate::patch::{CHROMA, LANES, LUMA, Patch};
use crate::refine::{Residual, refined};
use crate::response::Response;
use crate::sieve::LEVEL;

/// Blur of chroma, usually at half the resolution, and of luma [px].
const BLUR_PX: [f64; 2] = [1.3, 1.0];
/// Standard deviation of the coefficients of first and of second order over the mean brightness: how a matt sphere attenuates them.
const BRIGHTNESS_STD: [f64; 2] = [0.7, 0.15];
/// Noise of a webcam, grey levels.
const NOISE: f64 = 3.0;
/// What the model misses: share of the contrast at the edge, share of the brightness inside.
const MODEL_ERROR: [f64; 2] = [0.03, 0.03];

/// What becomes of residuals that are larger than expected: the shaft before the ball, a highlight, an edge in the background.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outlier {
    /// They pull as much as one of 1.5 standard deviations, however large (Huber 1964, Robust estimation of a location parameter): a fit finds
    /// its place from where the model is far off.
    Pulls,
    /// They pull less and, beyond 6, not at all (the biweight of Beaton and Tukey 1974, The fitting of power series, meaning polynomials,
    /// illustrated on band-spectroscopic data): from a place that is right but for them.
    IsLeftOut,
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
    /// What becomes of a residual far beyond that.
    pub outlier: Outlier,
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
        let expected = Expected { noise: NOISE, edge: MODEL_ERROR[0], inside: MODEL_ERROR[1], outlier: Outlier::Pulls };
        Self { expected: [expected; 2], shade: BRIGHTNESS_STD }
    }
}

/// Pixels of a patch, weighed.
pub(crate) struct Pixels {
    pub(crate) patch: Patch,
    pub(crate) weights: Weights,
}

impl Pixels {
    /// Every other pixel of a patch, weighed as a webcam's usually are.
    pub(crate) fn usual(patch: &Patch) -> Self {
        Self { patch: patch.chessboard(), weights: Weights::default() }
    }

    /// With the weights that a fit gives.
    pub(crate) fn weighed(patch: &Patch, fit: &Settled) -> Self {
        let (patch, weights) = refined(patch, fit);
        Self { patch, weights }
    }
}

impl Evidence for Pixels {
    const ENOUGH_PX: [f64; 2] = [2e-3; 2];

    fn normal(&self, x: &Vector, shade: Shade) -> Normal {
        dispatch!(*LEVEL, simd => normal_of(simd, x, shade, &self.patch, &self.weights))
    }

    fn shade(&self) -> [f64; 2] {
        self.weights.shade
    }

    fn blur_px(&self) -> [f64; 2] {
        BLUR_PX
    }

    fn errors(&self, fit: &Settled) -> Errors {
        let mut influences = vec![Vec::new(), Vec::new()];
        dispatch!(*LEVEL, simd => add_influences(simd, &mut influences, fit, &self.patch, &self.weights));
        let noise_px2 = centre_covariance_px2(&influences, fit.determined);
        Errors { noise_px2, response: Response::untold(RESPONSE_STD_PX) }
    }
}

/// Residuals of all pixels that tell something of the ball in chroma and in luma.
pub(crate) fn residuals(patch: &Patch, fit: &Settled) -> Vec<Residual> {
    let mut residuals = Vec::with_capacity(LANES * patch.blocks.len());
    dispatch!(*LEVEL, simd => add_residuals(simd, &mut residuals, patch, fit));
    residuals
}

#[inline(always)]
fn add_residuals<S: Simd>(simd: S, residuals: &mut Vec<Residual>, patch: &Patch, fit: &Settled) {
    let model = Model::new(simd, &fit.x, fit.shade, patch.corner);
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
fn add_influences<S: Simd>(simd: S, influences: &mut [Vec<Influence>], fit: &Settled, patch: &Patch, weights: &Weights) {
    let centre_by = fit.centre_by();
    let model = Model::new(simd, &fit.x, fit.shade, patch.corner);
    for block in &patch.blocks {
        let place = model.place(block.u, block.v);
        for (k, influences) in influences.iter_mut().enumerate() {
            let told = model.tell(&block.planes[k], &place, patch.channel(k));
            let root_weights = told.weights(simd, &block.planes[k], &weights.expected[k]).sqrt();
            let mut moves_px = [f32x16::splat(simd, 0.0); 2];
            for (j, row) in told.rows.iter().enumerate() {
                for (axis, moves_px) in moves_px.iter_mut().enumerate() {
                    *moves_px += *row * root_weights * centre_by[(axis, j)] as f32;
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
