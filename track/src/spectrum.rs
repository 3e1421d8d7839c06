//! What the squares of a JPEG file say of a ball, by their spectrum.
//!
//! A square's 64 coefficients were rounded each to a multiple of its own step `q`, so that with noise of standard deviation `s` in the file's
//! samples a coefficient errs by
//!
//! ```text
//! variance = s^2 + q^2 / 12
//! ```
//!
//! and independently of the others. Over pixels these errors are neither white nor the same everywhere, and of the high frequencies, whose
//! steps are large, hardly anything is known. With `C` the cosine transform, `V` the variances and `t` what each sample can be trusted, 1
//! but for texture behind the ball and for what fits badly, the misses `r` of a square count as
//!
//! ```text
//! r' t C' V^-1 C t r
//! ```
//!
//! Samples that are not looked at have no trust, as if they were as the model has them.
//!
//! Rounding errs less than that where a coefficient and its model are rounded to nothing, and texture more, so that what the centre errs by is
//! told from the coefficients' misses: see `sandwich`.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x16};

use nalgebra::Vector2;

use crate::centre::{BLUR, BRIGHTNESS, Errors, Evidence, Matrix, SIZE, Settled, Vector};
use crate::cosines::{COUNT, to_cosines};
use crate::model::{Light, Model, Place, Shade, Told};
use crate::normal::Normal;
use crate::patch::{Block, CHROMA, LANES, LUMA};
use crate::pixels::{Expected, Outlier};
use crate::refine::{robust_mean, shade};
use crate::response::Response;
use crate::sandwich::Sandwich;
use crate::sieve::LEVEL;
use crate::squares::{BLOCKS, OF_RGB, PLANES, Square, Squares};

/// Where the miss is among the lanes that are transformed; before it are the derivatives, see [`unknown`].
const MISS: usize = LANES - 1;
const _: () = assert!(unknown(MISS - 1, LUMA) == SIZE - 1);
/// A sample with less of the marker than this, or of the background, is away from the edge.
const AWAY: f32 = 0.02;
/// Variance that rounding to whole grey levels leaves.
const ROUNDING2: f64 = 1.0 / 12.0;
/// How much of what rounding would leave in a sample near an edge, if no coefficient were rounded to nothing, is there. Rendered balls on an even
/// background are 4 % worse at 0.1 and 2 % better at 0.5, which keeps more of a shaft or of texture.
const ROUNDED: f64 = 0.2;
/// Standard deviation in a file's samples, grey levels: where the search for it begins, and the least, as no ball is quite as the model.
const NOISE: f32 = 2.0;
const LEAST_NOISE: f64 = 1.5;
/// A coefficient counts as no farther off than so many standard deviations in that search.
const FAR: f32 = 3.0;

/// What moves the centre alike in both cameras and no residual shows, per axis [px]: light that harmonics do not follow, the more as the edge at the
/// shaft does not tell. Judged from the mean offsets of centres in two sessions of two renderers, with the true cameras.
const UNSHOWN_PX: f64 = 0.05;

/// A file's squares with what is expected of them.
pub(crate) struct Spectrum<'s> {
    squares: &'s Squares,
    /// Standard deviation of samples away from the edge.
    away: [f64; PLANES],
    expected: [Expected; PLANES],
    /// Inverse variances of the coefficients.
    weights: [[f32; COUNT]; PLANES],
    shade: [f64; 2],
}

/// Derivatives and miss in the lanes of each coefficient, or of each sample.
type Transformed<S> = [f32x16<S>; COUNT];

/// Samples on a ball, and how it is lit there.
struct Lit<S: Simd> {
    place: Place<S>,
    light: Light<S>,
}

impl<'s> Spectrum<'s> {
    /// With the weights that a fit gives.
    pub(crate) fn weighed(squares: &'s Squares, fit: &Settled) -> Self {
        let away = dispatch!(*LEVEL, simd => away(simd, squares, fit)).map(|away2| robust_mean(away2.into_iter()).max(ROUNDING2).sqrt());
        let expected = std::array::from_fn(|plane| {
            let steps2: f64 = squares.steps[plane].iter().map(|step| f64::from(step * step)).sum();
            let noise = away[plane].hypot((ROUNDED * steps2 / (12.0 * COUNT as f64)).sqrt());
            Expected { noise, edge: 0.0, inside: 0.0, outlier: Outlier::IsLeftOut }
        });
        let mut spectrum = Self { squares, away, expected, weights: [[0.0; COUNT]; PLANES], shade: shade(fit) };
        let noise2 = dispatch!(*LEVEL, simd => spectrum.noise2(simd, fit));
        for (plane, weights) in spectrum.weights.iter_mut().enumerate() {
            for (weight, step) in weights.iter_mut().zip(&squares.steps[plane]) {
                *weight = 1.0 / (noise2[plane] as f32 + step * step / 12.0);
            }
        }
        spectrum
    }

    /// Variance of the noise in each plane's samples before the file was made: what the coefficients miss beyond their rounding, those of
    /// small steps weighing most.
    #[inline(always)]
    fn noise2<S: Simd>(&self, simd: S, fit: &Settled) -> [f64; PLANES] {
        let mut sums = [[0.0, 1e-12]; PLANES];
        let beyond = self.squares.steps.map(|steps| steps.map(Beyond::rounding_to));
        let model = Model::new(simd, &fit.x, fit.shade, self.squares.corner);
        for square in &self.squares.all {
            let lit = lit(&model, square, self.squares);
            for (plane, slot) in square.planes() {
                let mut misses = [0.0; COUNT];
                for ((block, lit), misses) in square.blocks.iter().zip(&lit).zip(misses.as_chunks_mut().0) {
                    let (told, trust) = self.tell(simd, lit, block, plane, slot);
                    *misses = (told.miss * trust).to_array();
                }
                to_cosines(&mut misses);
                for (miss, Beyond { rounding2, most2, weight }) in misses.into_iter().zip(&beyond[plane]) {
                    sums[plane][0] += ((miss * miss).min(*most2) - rounding2) * weight;
                    sums[plane][1] += weight;
                }
            }
        }
        sums.map(|[sum, weight]| f64::from(sum / weight).max(LEAST_NOISE * LEAST_NOISE))
    }

    /// What the model says of a block's samples in a plane, and how far they are trusted.
    #[inline(always)]
    fn tell<S: Simd>(&self, simd: S, lit: &Lit<S>, block: &Block, plane: usize, slot: usize) -> (Told<S>, f32x16<S>) {
        let expected = &self.expected[plane];
        let mut samples = block.planes[slot];
        samples.shrink(self.squares.mean[plane], self.squares.local[plane]);
        samples.subtract(self.away[plane] * self.away[plane]);
        let told = lit.light.tell(simd, &samples, &lit.place, self.squares.channels[plane].gain);
        let trust = (told.trust(simd, &samples, expected).sqrt() * expected.noise as f32).min(1.0);
        let trust = block.is_looked_at(simd).select(trust, f32x16::splat(simd, 0.0));
        (told, trust)
    }

    /// Of a square in one plane; `None` where nothing of the ball is in it.
    #[inline(always)]
    fn coefficients<S: Simd>(&self, simd: S, lit: &[Lit<S>; BLOCKS], square: &Square, plane: usize, slot: usize) -> Option<Transformed<S>> {
        let blur = self.squares.channels[plane].blur;
        let mut transformed = [f32x16::splat(simd, 0.0); COUNT];
        let mut tells = false;
        for ((block, lit), samples) in square.blocks.iter().zip(lit).zip(transformed.as_chunks_mut::<LANES>().0) {
            let (told, trust) = self.tell(simd, lit, block, plane, slot);
            tells |= told.share.simd_gt(AWAY).any_true();
            for (lane, values) in samples.iter_mut().enumerate() {
                *values = trust * if lane == MISS { told.miss } else { told.rows[unknown(lane, blur)] };
            }
            *samples = transposed(*samples);
        }
        if !tells {
            return None;
        }
        to_cosines(&mut transformed);
        Some(transformed)
    }

    #[inline(always)]
    fn normal_of<S: Simd>(&self, simd: S, x: &Vector, shade: Shade) -> Normal {
        let model = Model::new(simd, x, shade, self.squares.corner);
        // Luma has one blur, Cb and Cr the other.
        let mut sums = [[f32x16::splat(simd, 0.0); LANES]; 2];
        for square in &self.squares.all {
            let lit = lit(&model, square, self.squares);
            for (plane, slot) in square.planes() {
                let Some(lanes) = self.coefficients(simd, &lit, square, plane, slot) else { continue };
                let sums = &mut sums[self.squares.channels[plane].blur];
                for (coefficient, weight) in lanes.iter().zip(self.weights[plane]) {
                    let weighted = (*coefficient * weight).to_array();
                    for (sum, weighted) in sums.iter_mut().zip(weighted) {
                        *sum = coefficient.mul_add(f32x16::splat(simd, weighted), *sum);
                    }
                }
            }
        }
        let (mut matrix, mut vector, mut square) = (Matrix::zeros(), Vector::zeros(), 0.0);
        for (blur, sums) in sums.iter().enumerate() {
            for (i, row) in sums[..MISS].iter().enumerate() {
                (0..MISS).for_each(|j| matrix[(unknown(i, blur), unknown(j, blur))] += f64::from(row[j]));
                vector[unknown(i, blur)] += f64::from(row[MISS]);
            }
            square += f64::from(sums[MISS][MISS]);
        }
        Normal::new(matrix, vector, square)
    }

    /// Covariance of the centre, and what a bent response does to it, both as far as the residuals tell.
    #[inline(always)]
    fn told_by<S: Simd>(&self, simd: S, fit: &Settled) -> Errors {
        let (mut sandwich, mut pulls, mut along, mut squares) = (Sandwich::default(), Vector::zeros(), 0.0, 0.0);
        let covariances = [CHROMA, LUMA].map(|blur| in_lanes(&fit.covariance, blur));
        let model = Model::new(simd, &fit.x, fit.shade, self.squares.corner);
        for square in &self.squares.all {
            let lit = lit(&model, square, self.squares);
            for (plane, slot) in square.planes() {
                let Some(lanes) = self.coefficients(simd, &lit, square, plane, slot) else { continue };
                let blur = self.squares.channels[plane].blur;
                let bent = self.bent(simd, &lit, square, plane, slot);
                let mut pull = f32x16::splat(simd, 0.0);
                for ((coefficient, weight), bent) in lanes.iter().zip(self.weights[plane]).zip(bent) {
                    pull = coefficient.mul_add(f32x16::splat(simd, bent * weight), pull);
                    squares += f64::from(bent * weight * bent);
                    let derivatives = coefficient.to_array();
                    let mut moves = f32x16::splat(simd, 0.0);
                    for (row, derivative) in covariances[blur].iter().zip(derivatives) {
                        moves = f32x16::load_array(simd, *row).mul_add(f32x16::splat(simd, derivative), moves);
                    }
                    // Lanes 0 and 1 are the centre, and that of the miss is 0.
                    let moves_px = [moves[0], moves[1]].map(|moves| moves * weight);
                    sandwich.add(derivatives[MISS], (moves * *coefficient).reduce_sum() * weight, moves_px);
                }
                (0..MISS).for_each(|lane| pulls[unknown(lane, blur)] += f64::from(pull[lane]));
                along += f64::from(pull[MISS]);
            }
        }
        let moved = fit.covariance * pulls;
        let shift_px = Vector2::new(moved[0], moved[1]).norm();
        // The residuals tell along what the unknowns cannot take up.
        let response = Response { shift_px, unshown_px: UNSHOWN_PX, along, information: (squares - pulls.dot(&moved)).max(0.0) };
        Errors { noise_px2: sandwich.covariance_px2(), response }
    }

    /// By how much a bent response changes a square's coefficients: with grey levels that are roots of the light (gamma 2) a pixel of two
    /// colours is brighter than their mean, whichever of them is darker.
    #[inline(always)]
    fn bent<S: Simd>(&self, simd: S, lit: &[Lit<S>; BLOCKS], square: &Square, plane: usize, slot: usize) -> [f32; COUNT] {
        let (marker, background) = (self.squares.marker_rgb, self.squares.background_rgb);
        let mut bent = [0.0; COUNT];
        for ((block, lit), bent) in square.blocks.iter().zip(lit).zip(bent.as_chunks_mut().0) {
            let (told, trust) = self.tell(simd, lit, block, plane, slot);
            let lit = told.bright / self.squares.channels[plane].gain;
            let mut sum = f32x16::splat(simd, 0.0);
            for channel in 0..3 {
                let (marker, background) = (lit * marker[channel], background[channel]);
                let squares = told.share * marker * marker + (1.0 - told.share) * (background * background);
                let mixed = told.share * marker + (1.0 - told.share) * background;
                sum += (squares.sqrt() - mixed) * OF_RGB[plane][channel] as f32;
            }
            *bent = (sum * trust).to_array();
        }
        to_cosines(&mut bent);
        bent
    }
}

impl Evidence for Spectrum<'_> {
    /// A step leaves a tenth of itself.
    const ENOUGH_PX: [f64; 2] = [0.2, 0.04];

    fn normal(&self, x: &Vector, shade: Shade) -> Normal {
        dispatch!(*LEVEL, simd => self.normal_of(simd, x, shade))
    }

    fn shade(&self) -> [f64; 2] {
        self.shade
    }

    fn blur_px(&self) -> [f64; 2] {
        self.squares.blur_px
    }

    fn errors(&self, fit: &Settled) -> Errors {
        dispatch!(*LEVEL, simd => self.told_by(simd, fit))
    }
}

/// Of a square's blocks: Cb and Cr have the same.
#[inline(always)]
fn lit<S: Simd>(model: &Model<S>, square: &Square, squares: &Squares) -> [Lit<S>; BLOCKS] {
    let blur = squares.blur(square);
    // Not by `map`, whose closure may not be inlined: it would lose the processor's instructions.
    let [a, b, c, d] = &square.blocks;
    let (a, b, c, d) = (model.place(a.u, a.v), model.place(b.u, b.v), model.place(c.u, c.v), model.place(d.u, d.v));
    let lights = (model.light(&a, blur), model.light(&b, blur), model.light(&c, blur), model.light(&d, blur));
    [
        Lit { place: a, light: lights.0 },
        Lit { place: b, light: lights.1 },
        Lit { place: c, light: lights.2 },
        Lit { place: d, light: lights.3 },
    ]
}

/// What a coefficient's squared miss says of the noise.
#[derive(Debug, Clone, Copy)]
struct Beyond {
    /// Variance of its rounding.
    rounding2: f32,
    /// The largest square that counts.
    most2: f32,
    /// Inverse variance of the square, but for a factor.
    weight: f32,
}

impl Beyond {
    fn rounding_to(step: f32) -> Self {
        let rounding2 = step * step / 12.0;
        let expected2 = rounding2 + NOISE * NOISE;
        Self { rounding2, most2: FAR * FAR * expected2, weight: (expected2 * expected2).recip() }
    }
}

/// Squared misses away from the edge, by plane.
#[inline(always)]
fn away<S: Simd>(simd: S, squares: &Squares, fit: &Settled) -> [Vec<f64>; PLANES] {
    let mut away2 = [0; PLANES].map(|_| Vec::with_capacity(COUNT * squares.all.len()));
    let model = Model::new(simd, &fit.x, fit.shade, squares.corner);
    for square in &squares.all {
        for (block, lit) in square.blocks.iter().zip(&lit(&model, square, squares)) {
            let looked_at = block.is_looked_at(simd);
            for (plane, slot) in square.planes() {
                let told = lit.light.tell(simd, &block.planes[slot], &lit.place, squares.channels[plane].gain);
                let wanted = |&i: &usize| looked_at.test(i) && told.share[i].min(1.0 - told.share[i]) < AWAY;
                away2[plane].extend((0..LANES).filter(wanted).map(|i| f64::from(told.miss[i]).powi(2)));
            }
        }
    }
    away2
}

/// Rows as columns: four times, each half is laid between the other.
#[inline(always)]
fn transposed<S: Simd>(mut rows: [f32x16<S>; LANES]) -> [f32x16<S>; LANES] {
    const HALF: usize = LANES / 2;
    for _ in 0..LANES.ilog2() {
        let before = rows;
        for i in 0..HALF {
            (rows[2 * i], rows[2 * i + 1]) = before[i].interleave(before[HALF + i]);
        }
    }
    rows
}

/// Covariances of the unknowns that a plane with this blur tells of, by lane: none with the miss.
fn in_lanes(covariance: &Matrix, blur: usize) -> [[f32; LANES]; MISS] {
    let of = |i: usize, j: usize| if j < MISS { covariance[(unknown(i, blur), unknown(j, blur))] as f32 } else { 0.0 };
    std::array::from_fn(|i| std::array::from_fn(|j| of(i, j)))
}

/// The unknown by which a lane has the derivative, in a plane with this blur: outline, the one blur, brightness.
const fn unknown(lane: usize, blur: usize) -> usize {
    match lane {
        0..BLUR => lane,
        BLUR => BLUR + blur,
        _ => lane - BLUR - 1 + BRIGHTNESS,
    }
}
