//! What the model of [`crate::centre`] says of pixels, [`LANES`] at a time in single precision, and its derivatives.
//!
//! No pixel branches: where one is all background, what it tells has no weight. So the compiler does many at once. Grey levels need no more than
//! single precision, and places count from the patch's corner, so that a centre is exact to 1e-6 px.

use crate::centre::{BLUR, BRIGHTNESS, SIZE, Vector, Weights};
use crate::patch::{Block, LANES, Lanes, Patch, Samples};

/// Beyond so many blurs outside the outline a pixel tells nothing of the ball, and within so many all of it is marker.
const OUTSIDE: f32 = 4.0;
const INSIDE: f32 = -8.0;
/// The normal distribution by a logistic function of an odd polynomial (Page 1977).
const NORMAL: [f32; 2] = [1.5976, 0.070_565_99];
/// Height of the normal density.
const DENSITY: f32 = 0.398_942_3;

/// A ball with given unknowns.
pub(crate) struct Model {
    x: [f32; SIZE],
    /// Brightness of chroma and of luma over that of chroma.
    gain: [f32; 2],
}

/// Where pixels are on the outline's own scale.
pub(crate) struct Place {
    dx: Lanes,
    dy: Lanes,
    from_centre: Lanes,
    /// From the outline [px], positive outside.
    distance: Lanes,
    /// What the distance loses by centre, radius and elongations.
    nearer: [Lanes; BLUR],
}

/// What the model says of pixels, in one coordinate of colour.
pub(crate) struct Told {
    /// Colour seen minus colour told.
    pub(crate) miss: Lanes,
    /// Share of the marker in the pixel.
    pub(crate) share: Lanes,
    /// Marker minus background.
    pub(crate) contrast: Lanes,
    /// The marker's own colour there.
    pub(crate) bright: Lanes,
    /// Whether the pixel is more than background.
    pub(crate) tells: [bool; LANES],
    /// Derivatives of the colour told by the unknowns.
    pub(crate) rows: [Lanes; SIZE],
}

impl Model {
    /// For pixels of `patch`.
    pub(crate) fn new(x: &Vector, patch: &Patch) -> Self {
        let mut from_corner = *x;
        from_corner[0] -= f64::from(patch.corner[0]);
        from_corner[1] -= f64::from(patch.corner[1]);
        Self { x: std::array::from_fn(|i| from_corner[i] as f32), gain: [1.0, patch.luma_per_chroma as f32] }
    }

    #[inline(always)]
    pub(crate) fn place(&self, block: &Block) -> Place {
        let [u, v, radius, e, f, ..] = self.x;
        let zero = [0.0; LANES];
        let mut place = Place { dx: zero, dy: zero, from_centre: zero, distance: zero, nearer: [zero; BLUR] };
        for i in 0..LANES {
            let (dx, dy) = (block.u[i] - u, block.v[i] - v);
            let (x, y) = ((1.0 + e) * dx + f * dy, f * dx + (1.0 - e) * dy);
            let from_centre = (x * x + y * y).sqrt().max(1e-6);
            let (x, y) = (x / from_centre, y / from_centre);
            (place.dx[i], place.dy[i]) = (dx, dy);
            (place.from_centre[i], place.distance[i]) = (from_centre, from_centre - radius);
            place.nearer[0][i] = x * (1.0 + e) + y * f;
            place.nearer[1][i] = x * f + y * (1.0 - e);
            place.nearer[2][i] = 1.0;
            place.nearer[3][i] = y * dy - x * dx;
            place.nearer[4][i] = -(x * dy + y * dx);
        }
        place
    }

    /// In chroma or luma `k`.
    #[inline(always)]
    pub(crate) fn tell(&self, block: &Block, place: &Place, k: usize) -> Told {
        let (radius, blur, gain) = (self.x[2], self.x[BLUR + k], self.gain[k]);
        let samples = &block.planes[k];
        let zero = [0.0; LANES];
        let mut told = Told { miss: zero, share: zero, contrast: zero, bright: zero, tells: [false; LANES], rows: [zero; SIZE] };
        let mut slope = zero;
        for i in 0..LANES {
            let t = place.distance[i] / blur;
            told.tells[i] = t <= OUTSIDE;
            let t = t.clamp(INSIDE, OUTSIDE);
            let share = 1.0 / (1.0 + exp(t * (NORMAL[0] + NORMAL[1] * t * t)));
            // Blur brings the marker's light to a pixel from within the outline: the mean of the distances below 0.
            let within = (t - DENSITY * exp(-0.5 * t * t) / share) * blur;
            // The ball's surface normal there, and its products: spherical harmonics up to the second order.
            let inwards = (radius + within).max(0.0) / (place.from_centre[i] * radius);
            let (nx, ny) = (place.dx[i] * inwards, place.dy[i] * inwards);
            let nz = (1.0 - nx * nx - ny * ny).max(0.0).sqrt();
            let harmonics = [1.0, nx, ny, nz, nx * ny, nx * nz, ny * nz, nx * nx - ny * ny, 3.0 * nz * nz - 1.0];
            let mut brightness = 0.0;
            for (j, harmonic) in harmonics.into_iter().enumerate() {
                brightness += harmonic * self.x[BRIGHTNESS + j];
                told.rows[BRIGHTNESS + j][i] = gain * share * harmonic;
            }
            let bright = gain * brightness;
            let contrast = bright - samples.background[i];
            told.miss[i] = samples.colour[i] - samples.background[i] - share * contrast;
            (told.share[i], told.contrast[i], told.bright[i]) = (share, contrast, bright);
            slope[i] = share * (1.0 - share) * (NORMAL[0] + 3.0 * NORMAL[1] * t * t) / blur * contrast;
            told.rows[BLUR + k][i] = slope[i] * t;
        }
        for (row, nearer) in told.rows.iter_mut().zip(&place.nearer) {
            for i in 0..LANES {
                row[i] = slope[i] * nearer[i];
            }
        }
        told
    }
}

impl Told {
    /// Weights of the squared misses: the inverse of their expected squares, less for outliers.
    #[inline(always)]
    pub(crate) fn weights(&self, samples: &Samples, weights: &Weights, k: usize) -> Lanes {
        let [noise, edge, inside] = [weights.noise[k], weights.edge[k], weights.inside[k]].map(|w| w as f32);
        let huber = weights.huber as f32;
        let mut of = [0.0; LANES];
        for i in 0..LANES {
            let (share, background) = (self.share[i], 1.0 - self.share[i]);
            let (at_edge, within) = (edge * 4.0 * share * background * self.contrast[i], inside * share * self.bright[i]);
            let variance = noise * noise + background * background * samples.texture[i] + at_edge * at_edge + within * within;
            let weight = (huber * variance.sqrt() / self.miss[i].abs().max(1e-9)).min(1.0) / variance;
            of[i] = if self.tells[i] { weight } else { 0.0 };
        }
        of
    }
}

/// `e^x` to 2e-7 of it for `|x|` below 87, by a power of two and a Taylor series.
#[inline(always)]
fn exp(x: f32) -> f32 {
    // Adding it leaves a whole number in the lowest bits.
    const WHOLE: f32 = 12_582_912.0;
    let shifted = x * std::f32::consts::LOG2_E + WHOLE;
    let part = x - (shifted - WHOLE) * std::f32::consts::LN_2;
    let series = 1.0 + part * (1.0 + part * (1.0 / 2.0 + part * (1.0 / 6.0 + part * (1.0 / 24.0 + part * (1.0 / 120.0 + part / 720.0)))));
    series * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_e_are_those_of_the_library() {
        for i in -8700..8700 {
            let x = i as f32 / 100.0;
            let exact = f64::from(x).exp();
            // The argument's own rounding counts `x` times.
            let limit = 2e-7 + 1.2e-7 * f64::from(x.abs());
            assert!((f64::from(exp(x)) / exact - 1.0).abs() < limit, "{x}: {} {exact}", exp(x));
        }
    }
}
