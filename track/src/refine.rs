//! Weights for the next fit of a ball, from the residuals of the one before.
//!
//! On raw frames noise is white and the edge is as the model has it: then all of the contrast counts, and the centre comes close to the
//! Cramer-Rao bound. On compressed frames residuals at the edge are larger and neighbours err together. Both are seen in the residuals:
//!
//! | from | comes |
//! |---|---|
//! | residuals away from the edge | noise of chroma, of luma, and what they have in common |
//! | the same at the edge and inside, beyond the noise | what the model misses, over contrast and brightness |
//! | the coefficients of brightness over their own deviations | how much shade to allow for: none where none is seen |

use fearless_simd::Simd;

use crate::centre::{BRIGHTNESS, Settled};
use crate::model::Told;
use crate::patch::{CHROMA, LUMA, Patch};
use crate::pixels::{Expected, Outlier, Weights, residuals};

/// Least noise: what rounding to whole grey levels leaves.
const ROUNDING: f64 = 0.289;
/// A pixel with less of the marker than this, or of the background, is away from the edge.
const AWAY: f64 = 0.02;

/// One pixel's residuals, chroma and luma.
pub(crate) struct Residual {
    of: [Seen; 2],
}

/// What [`Told`] says of one pixel.
struct Seen {
    miss: f64,
    share: f64,
    contrast: f64,
    bright: f64,
}

impl Residual {
    /// Of the `i`-th pixel.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(told: &[Told<S>; 2], i: usize) -> Self {
        let seen = |told: &Told<S>| {
            let [miss, share, contrast, bright] = [told.miss[i], told.share[i], told.contrast[i], told.bright[i]].map(f64::from);
            Seen { miss, share, contrast, bright }
        };
        Self { of: told.each_ref().map(seen) }
    }

    fn is_away(&self) -> bool {
        let share = self.of[0].share;
        share.min(1.0 - share) < AWAY
    }
}

/// The patch with luma freed of what it has in common with chroma, and the weights.
pub(crate) fn refined(patch: &Patch, first: &Settled) -> (Patch, Weights) {
    let all: Vec<Residual> = residuals(patch, first);
    let common = |of: fn(&Residual) -> f64| robust_mean(all.iter().filter(|r| r.is_away()).map(of));
    let chroma2 = common(|r| r.of[0].miss.powi(2)).max(ROUNDING * ROUNDING);
    let slope = common(|r| r.of[0].miss * r.of[1].miss) / chroma2;
    let patch = patch.without_common(slope);
    let all: Vec<Residual> = residuals(&patch, first);
    let expected = [CHROMA, LUMA].map(|k| {
        let square = |seen: &Seen| seen.miss * seen.miss;
        let noise2 = robust_mean(all.iter().filter(|r| r.is_away()).map(|r| square(&r.of[k]))).max(ROUNDING * ROUNDING);
        let beyond = |wanted: fn(&Residual) -> bool, scale: fn(&Seen) -> f64| {
            let there = || all.iter().filter(|r| wanted(r));
            let excess = robust_mean(there().map(|r| square(&r.of[k]))) - noise2;
            let scale2 = there().map(|r| scale(&r.of[k]).powi(2)).sum::<f64>() / there().count().max(1) as f64;
            if scale2 > 0.0 { (excess.max(0.0) / scale2).sqrt() } else { 0.0 }
        };
        Expected {
            noise: noise2.sqrt(),
            edge: beyond(|r| !r.is_away(), |seen| 4.0 * seen.share * (1.0 - seen.share) * seen.contrast),
            inside: beyond(|r| r.is_away() && r.of[0].share > 0.5, |seen| seen.bright),
            outlier: Outlier::IsLeftOut,
        }
    });
    (patch.without_noise(expected.map(|e| e.noise * e.noise)), Weights { expected, shade: shade(first) })
}

/// So many values tell their median well enough to know what is far beyond it.
const ENOUGH: usize = 200;

/// Mean of squares or products, without the largest that outliers make: values beyond twenty times the median magnitude are left
/// out, of squares of normal deviates one in 4000.
pub(crate) fn robust_mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    let some = values.iter().step_by(values.len().div_ceil(ENOUGH).max(1));
    let magnitude = raven::stats::median(&some.map(|v| v.abs()).collect::<Vec<f64>>()).unwrap_or(0.0);
    let near = values.iter().filter(|v| v.abs() <= 20.0 * magnitude);
    let (sum, count) = near.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Standard deviations of the coefficients of brightness of order 1 and 2 over the mean: what is left of their squares beyond their variance.
pub(crate) fn shade(first: &Settled) -> [f64; 2] {
    let mean = first.x[BRIGHTNESS].abs().max(1e-9);
    let variance = first.variance();
    let of = |range: std::ops::Range<usize>| {
        let count = range.len() as f64;
        let squares: f64 = range.clone().map(|i| first.x[i].powi(2)).sum::<f64>() / count;
        let own: f64 = range.map(|i| variance[i]).sum::<f64>() / count;
        // Below twice their own variance they may be nothing but noise.
        (if squares > 2.0 * own { squares - own } else { 0.02 * own }).sqrt() / mean
    };
    [of(BRIGHTNESS + 1..BRIGHTNESS + 4), of(BRIGHTNESS + 4..BRIGHTNESS + 9)]
}
