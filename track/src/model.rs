//! What the model of [`crate::centre`] says of pixels, [`LANES`](crate::patch::LANES) at a time in single precision, and its derivatives.
//!
//! No pixel branches: where one is all background, what it tells has no weight. Grey levels need no more than single precision, and places
//! count from the patch's corner, so that a centre is exact to 1e-6 px.

use fearless_simd::prelude::*;
use fearless_simd::{f32x16, mask32x16};

use crate::centre::{BLUR, BRIGHTNESS, SIZE, Vector};
use crate::patch::{Lanes, Samples};
use crate::pixels::{Expected, Outlier};

/// Beyond so many blurs outside the outline a pixel tells nothing of the ball, and within so many all of it is marker.
const OUTSIDE: f32 = 4.0;
const INSIDE: f32 = -8.0;
/// Where a residual pulls no more than a smaller one, and where it is left out, in standard deviations.
const PULLS: f32 = 1.5;
const LEFT_OUT: f32 = 6.0;
/// The normal distribution by a logistic function of an odd polynomial (Page 1977).
const NORMAL: [f32; 2] = [1.5976, 0.070_565_99];
/// Height of the normal density.
const DENSITY: f32 = 0.398_942_3;

/// How bright a ball is by its surface normal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shade {
    /// Spherical harmonics up to the second order, which follow a matt sphere in any light.
    Harmonics,
    /// `a + max(0, n . l)`: a matt sphere in even light and that of one lamp. Where its light ends there is an edge, which harmonics miss.
    Lamp,
}

/// A ball with given unknowns.
pub(crate) struct Model<S> {
    simd: S,
    shade: Shade,
    x: [f32; SIZE],
}

/// What one coordinate of colour shows of a ball.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Channel {
    /// Which blur it has: that of chroma or of luma.
    pub(crate) blur: usize,
    /// The marker's colour over its chroma.
    pub(crate) gain: f32,
}

/// Where pixels are on the outline's own scale.
pub(crate) struct Place<S: Simd> {
    dx: f32x16<S>,
    dy: f32x16<S>,
    from_centre: f32x16<S>,
    /// From the outline [px], positive outside.
    distance: f32x16<S>,
    /// What the distance loses by centre, radius and elongations.
    nearer: [f32x16<S>; BLUR],
}

/// How much of the ball is in pixels and how bright it is there, whatever the coordinate of colour.
pub(crate) struct Light<S: Simd> {
    blur: usize,
    /// From the outline, in blurs.
    t: f32x16<S>,
    tells: mask32x16<S>,
    share: f32x16<S>,
    /// What the share gains where the outline is nearer by a pixel.
    slope: f32x16<S>,
    /// Derivatives of the brightness by its coefficients.
    terms: [f32x16<S>; SIZE - BRIGHTNESS],
    brightness: f32x16<S>,
}

/// What the model says of pixels, in one coordinate of colour.
pub(crate) struct Told<S: Simd> {
    /// Colour seen minus colour told.
    pub(crate) miss: f32x16<S>,
    /// Share of the marker in the pixel.
    pub(crate) share: f32x16<S>,
    /// Marker minus background.
    pub(crate) contrast: f32x16<S>,
    /// The marker's own colour there.
    pub(crate) bright: f32x16<S>,
    /// Whether the pixel is more than background.
    pub(crate) tells: mask32x16<S>,
    /// Derivatives of the colour told by the unknowns.
    pub(crate) rows: [f32x16<S>; SIZE],
}

impl<S: Simd> Model<S> {
    /// For places that count from the pixel `corner` of the image.
    #[inline(always)]
    pub(crate) fn new(simd: S, x: &Vector, shade: Shade, corner: [u32; 2]) -> Self {
        let mut from_corner = *x;
        from_corner[0] -= f64::from(corner[0]);
        from_corner[1] -= f64::from(corner[1]);
        Self { simd, shade, x: std::array::from_fn(|i| from_corner[i] as f32) }
    }

    #[inline(always)]
    pub(crate) fn place(&self, u: Lanes, v: Lanes) -> Place<S> {
        let [centre_u, centre_v, radius, e, f, ..] = self.x;
        let (dx, dy) = (f32x16::load_array(self.simd, u) - centre_u, f32x16::load_array(self.simd, v) - centre_v);
        let (x, y) = (dx * (1.0 + e) + dy * f, dx * f + dy * (1.0 - e));
        let from_centre = (x * x + y * y).sqrt().max(1e-6);
        let (x, y) = (x / from_centre, y / from_centre);
        let nearer = [x * (1.0 + e) + y * f, x * f + y * (1.0 - e), f32x16::splat(self.simd, 1.0), y * dy - x * dx, -(x * dy + y * dx)];
        Place { dx, dy, from_centre, distance: from_centre - radius, nearer }
    }

    /// Where an edge has the blur of chroma or of luma.
    #[inline(always)]
    pub(crate) fn light(&self, place: &Place<S>, blur: usize) -> Light<S> {
        let (radius, blur_px) = (self.x[2], self.x[BLUR + blur]);
        let t = place.distance / blur_px;
        let tells = t.simd_le(OUTSIDE);
        let t = t.max(INSIDE).min(OUTSIDE);
        let share = normal(t);
        // Blur brings the marker's light to a pixel from within the outline: the mean of the distances below 0.
        let within = (t - exp(t * t * -0.5) * DENSITY / share) * blur_px;
        // The ball's surface normal there.
        let inwards = (within + radius).max(0.0) / (place.from_centre * radius);
        let (nx, ny) = (place.dx * inwards, place.dy * inwards);
        let nz = (1.0 - nx * nx - ny * ny).max(0.0).sqrt();
        let (terms, brightness) = self.brightness([nx, ny, nz], blur_px);
        let slope = share * (1.0 - share) * (t * t * (3.0 * NORMAL[1]) + NORMAL[0]) / blur_px;
        Light { blur, t, tells, share, slope, terms, brightness }
    }

    /// In one coordinate of colour.
    #[inline(always)]
    pub(crate) fn tell(&self, samples: &Samples, place: &Place<S>, channel: Channel) -> Told<S> {
        self.light(place, channel.blur).tell(self.simd, samples, place, channel.gain)
    }

    /// Brightness at a surface normal, and its derivatives by its coefficients.
    #[inline(always)]
    fn brightness(&self, [nx, ny, nz]: [f32x16<S>; 3], blur: f32) -> ([f32x16<S>; SIZE - BRIGHTNESS], f32x16<S>) {
        let [zero, one] = [0.0, 1.0].map(|value| f32x16::splat(self.simd, value));
        let coefficients = &self.x[BRIGHTNESS..];
        match self.shade {
            Shade::Harmonics => {
                let terms = [one, nx, ny, nz, nx * ny, nx * nz, ny * nz, nx * nx - ny * ny, nz * nz * 3.0 - 1.0];
                let sum = terms.iter().zip(coefficients).fold(zero, |sum, (term, coefficient)| sum + *term * *coefficient);
                (terms, sum)
            }
            Shade::Lamp => {
                let [even, lx, ly, lz] = [coefficients[0], coefficients[1], coefficients[2], coefficients[3]];
                let lamp = nx * lx + ny * ly + nz * lz;
                // The mean of `max(0, n . l)` where blur makes `n . l` normal.
                let spread = ((lx * lx + ly * ly + lz * lz).sqrt() * blur / self.x[2]).max(1e-6);
                let t = (lamp / spread).max(INSIDE).min(-INSIDE);
                let lit = normal(-t);
                let terms = [one, lit * nx, lit * ny, lit * nz, zero, zero, zero, zero, zero];
                (terms, lamp * lit + exp(t * t * -0.5) * (DENSITY * spread) + even)
            }
        }
    }
}

impl<S: Simd> Light<S> {
    /// In a coordinate of colour in which the marker's colour is `gain` times its chroma.
    #[inline(always)]
    pub(crate) fn tell(&self, simd: S, samples: &Samples, place: &Place<S>, gain: f32) -> Told<S> {
        let [colour, background] = [samples.colour, samples.background].map(|of| f32x16::load_array(simd, of));
        let bright = self.brightness * gain;
        let contrast = bright - background;
        let slope = self.slope * contrast;
        let mut rows = [f32x16::splat(simd, 0.0); SIZE];
        for (row, nearer) in rows.iter_mut().zip(&place.nearer) {
            *row = slope * *nearer;
        }
        rows[BLUR + self.blur] = slope * self.t;
        for (row, term) in rows[BRIGHTNESS..].iter_mut().zip(&self.terms) {
            *row = self.share * gain * *term;
        }
        let miss = colour - background - self.share * contrast;
        Told { miss, share: self.share, contrast, bright, tells: self.tells, rows }
    }
}

impl<S: Simd> Told<S> {
    /// Weights of the squared misses: the inverse of their expected squares, less for outliers; none of what tells nothing of the ball.
    #[inline(always)]
    pub(crate) fn weights(&self, simd: S, samples: &Samples, expected: &Expected) -> f32x16<S> {
        self.tells.select(self.trust(simd, samples, expected), f32x16::splat(simd, 0.0))
    }

    /// The same of all pixels, background as well.
    #[inline(always)]
    pub(crate) fn trust(&self, simd: S, samples: &Samples, expected: &Expected) -> f32x16<S> {
        let [noise, edge, inside] = [expected.noise, expected.edge, expected.inside].map(|e| e as f32);
        let texture = f32x16::load_array(simd, samples.texture);
        let background = 1.0 - self.share;
        let at_edge = self.share * background * self.contrast * (4.0 * edge);
        let within = self.share * self.bright * inside;
        let variance = background * background * texture + at_edge * at_edge + within * within + noise * noise;
        let kept = match expected.outlier {
            Outlier::Pulls => (variance.sqrt() * PULLS / self.miss.abs().max(1e-9)).min(1.0),
            Outlier::IsLeftOut => {
                let kept = (1.0 - self.miss * self.miss / (variance * (LEFT_OUT * LEFT_OUT))).max(0.0);
                kept * kept
            }
        };
        kept / variance
    }
}

/// The normal distribution beyond `t`, within 8.
#[inline(always)]
fn normal<S: Simd>(t: f32x16<S>) -> f32x16<S> {
    1.0 / (exp(t * (t * t * NORMAL[1] + NORMAL[0])) + 1.0)
}

/// `e^x` to 2e-7 of it for `|x|` below 87, by a power of two and a Taylor series.
#[inline(always)]
fn exp<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    // Adding it leaves a whole number in the lowest bits.
    const WHOLE: f32 = 12_582_912.0;
    let shifted = x * std::f32::consts::LOG2_E + WHOLE;
    let part = x - (shifted - WHOLE) * std::f32::consts::LN_2;
    let mut series = part * (1.0 / 720.0) + 1.0 / 120.0;
    for coefficient in [1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        series = series * part + coefficient;
    }
    series * f32x16::from_bits((shifted.to_bits() << 23) + 1.0_f32.to_bits())
}

#[cfg(test)]
mod tests {
    use fearless_simd::dispatch;

    use super::*;
    use crate::sieve::LEVEL;

    #[test]
    fn powers_of_e_are_those_of_the_library() {
        for first in (-8700..8700).step_by(16) {
            let x: [f32; 16] = std::array::from_fn(|i| (first + i as i32) as f32 / 100.0);
            let powers: [f32; 16] = dispatch!(*LEVEL, simd => exp(f32x16::load_array(simd, x)).to_array());
            for (x, power) in x.into_iter().zip(powers) {
                // The argument's own rounding counts `x` times.
                let limit = 2e-7 + 1.2e-7 * f64::from(x.abs());
                assert!((f64::from(power) / f64::from(x).exp() - 1.0).abs() < limit, "{x}: {power}");
            }
        }
    }
}
