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
//! What fits badly weighs less in the first fit and is left out of the next, so a shaft before the ball, a highlight or an edge in the background
//! do little harm.
//!
//! On a JPEG frame the next fits go by the file's own samples and how they were rounded: see `squares` and `spectrum`.
//!
//! How much a pixel weighs in the first fit is set for a webcam's frames. The next sees from the residuals of the first how much noise there
//! is, how it is shared between chroma and luma, how well the edge is described and how much shade there is, and weighs by that: see
//! `refine`. A refined fit tries the light of one lamp besides, which nine coefficients only follow.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use crate::model::Shade;
use crate::normal::Normal;
use crate::patch::Patch;
use crate::pixels::Pixels;
use crate::response::Response;
use crate::spectrum::Spectrum;
use crate::squares::Squares;

/// `u, v`, radius, two elongations, blur of chroma and of luma, nine coefficients of brightness.
pub(crate) const SIZE: usize = 16;
/// Where the blurs are; before them the outline.
pub(crate) const BLUR: usize = 5;
/// Where the coefficients of brightness begin: one of order 0, three of order 1, five of order 2.
pub const BRIGHTNESS: usize = 7;
const BLUR_STD_PX: f64 = 0.3;
/// Elongation of the outline: perspective and motion within the exposure.
const ELONGATION_STD: f64 = 0.1;
/// What the camera's unknown response does to a ball that is lit from one side, per axis [px]: rendered balls lie where they are by a
/// linear response, and with grey levels of gamma 2.2, which most webcams send, they shift towards the light by 0.07 to 0.11 px, whatever
/// their size. All cameras that see the ball from one side err alike. Of a JPEG file, where luma weighs more, the shift is told from the fit.
pub const RESPONSE_STD_PX: f64 = 0.07;
/// How often a refined fit takes new weights: they settle after two or three times. Before which of them it looks for a lamp.
const REFINED: usize = 5;
const LAMP_AT: usize = 3;
/// How often the spectrum of a JPEG file is fitted without that: the first time the weights come from decoded pixels.
const SPECTRUM: usize = 2;
/// Standard deviation of a lamp's light over the mean brightness; what else harmonics follow is not there.
const LAMP_STD: [f64; 2] = [2.0, 1e-6];
const ITERATIONS: usize = 15;
/// Steps smaller than this end a fit that only gives a start [px]: for decoded pixels, or for the spectrum, which moves the centre by more.
const ROUGH_PX: f64 = 0.02;
const ROUGHER_PX: f64 = 0.1;
/// Steps that end one that gives the centre, as part of its standard deviation.
const FINE: f64 = 0.1;

pub(crate) type Vector = SVector<f64, SIZE>;
pub(crate) type Matrix = SMatrix<f64, SIZE, SIZE>;

/// A centre with its covariance, and the radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Centre of the outline `(u, v)` [px].
    pub centre_px: Vector2<f64>,
    /// Covariance of the centre by noise, and by what the model misses in this frame [px^2].
    pub noise_px2: Matrix2<f64>,
    /// What moves the centre alike in both cameras, beside that.
    pub response: Response,
    /// Mean radius of the outline [px].
    pub radius_px: f64,
}

impl Ball {
    /// Covariance of the centre by both, as far as this ball alone tells [px^2].
    #[must_use]
    pub fn covariance_px2(&self) -> Matrix2<f64> {
        self.response.beside(self.noise_px2)
    }
}

/// A fit that has settled.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settled {
    pub(crate) x: Vector,
    pub(crate) shade: Shade,
    /// Weighted squares of the residuals.
    square: f64,
    /// Of the unknowns, neighbours taken to err independently.
    pub(crate) covariance: Matrix,
    /// So many unknowns the evidence determined, and not the prior.
    pub(crate) determined: f64,
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

    /// What a pull at each unknown moves the centre by.
    pub(crate) fn centre_by(&self) -> SMatrix<f64, 2, SIZE> {
        self.covariance.fixed_rows::<2>(0).into()
    }

    /// Its centre and what it errs by.
    fn ball(&self, evidence: &impl Evidence) -> Ball {
        let Errors { noise_px2, response } = evidence.errors(self);
        Ball { centre_px: self.x.fixed_rows::<2>(0).into(), noise_px2, response, radius_px: self.x[2] }
    }
}

/// What a fit goes by.
pub(crate) trait Evidence {
    /// Steps smaller than this end a fit that gives weights, and the last one, which gives the centre [px].
    const ENOUGH_PX: [f64; 2];
    /// Of one step from `x`.
    fn normal(&self, x: &Vector, shade: Shade) -> Normal;
    /// Standard deviation of the coefficients of brightness of order 1 and 2, over the mean brightness.
    fn shade(&self) -> [f64; 2];
    /// Usual blur of chroma and of luma [px].
    fn blur_px(&self) -> [f64; 2];
    /// What a fit errs by.
    fn errors(&self, fit: &Settled) -> Errors;
}

/// What makes a fit err.
pub(crate) struct Errors {
    /// Covariance of the centre by noise, and by what the model misses in this frame [px^2].
    pub(crate) noise_px2: Matrix2<f64>,
    /// What moves the centre alike in both cameras.
    pub(crate) response: Response,
}

/// Fits a ball to a patch, from a centre and radius that are right to about a third of the radius, and once more with the weights that the
/// fit gives; `refine` until these settle, and under the light of one lamp where that says as much with fewer unknowns. Of a JPEG file the
/// weights are those of its `squares`.
///
/// `None` where the fit does not settle near its start: what is there is no ball.
#[must_use]
pub(crate) fn fit(patch: &Patch, squares: Option<&Squares>, start_px: Vector2<f64>, radius_px: f64, refine: bool) -> Option<Ball> {
    let start = Start { centre_px: start_px, radius_px, chroma: patch.chroma };
    // The first only gives weights and a place to go on from: every other pixel, as on a chessboard, tells enough.
    let usual = Pixels::usual(patch);
    let enough_px = if squares.is_some() { ROUGHER_PX } else { ROUGH_PX };
    let first = start.settle(&usual, Shade::Harmonics, None, enough_px)?;
    let passes = |least: usize| if refine { REFINED } else { least };
    let by_squares = squares.and_then(|squares| {
        let (fitted, spectrum) = start.refine(first, None, passes(SPECTRUM), |fit| Spectrum::weighed(squares, fit));
        spectrum.map(|spectrum| fitted.ball(&spectrum))
    });
    by_squares.or_else(|| {
        let (fitted, pixels) = start.refine(first, Some(usual), passes(1), |fit| Pixels::weighed(patch, fit));
        pixels.map(|pixels| fitted.ball(&pixels))
    })
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
    /// Fits again as often as `passes` says, each time with what `weigh` makes of the last fit; what the last that settled went by comes along.
    fn refine<E: Evidence>(
        &self,
        mut fitted: Settled,
        mut evidence: Option<E>,
        passes: usize,
        weigh: impl Fn(&Settled) -> E,
    ) -> (Settled, Option<E>) {
        for pass in 1..=passes {
            if let Some(evidence) = evidence.as_ref().filter(|_| pass == LAMP_AT) {
                let lit = self.settle(evidence, Shade::Lamp, Some(under_lamp(&fitted.x)), E::ENOUGH_PX[0]);
                fitted = lit.filter(|lit| lit.is_simpler_than(&fitted)).unwrap_or(fitted);
            }
            let weighed = weigh(&fitted);
            let enough_px = E::ENOUGH_PX[usize::from(pass == passes)];
            if let Some(better) = self.settle(&weighed, fitted.shade, Some(fitted.x), enough_px) {
                (fitted, evidence) = (better, Some(weighed));
            }
        }
        (fitted, evidence)
    }

    /// From where another fit has settled, or from the start, until steps are no larger than `enough_px` or hardly count.
    fn settle(&self, evidence: &impl Evidence, shade: Shade, from: Option<Vector>, enough_px: f64) -> Option<Settled> {
        let mut prior = Vector::zeros();
        prior.fixed_rows_mut::<3>(0).copy_from_slice(&[self.centre_px.x, self.centre_px.y, self.radius_px]);
        prior.fixed_rows_mut::<2>(BLUR).copy_from_slice(&evidence.blur_px());
        prior[BRIGHTNESS] = self.chroma;
        let [first, second] = if shade == Shade::Lamp { LAMP_STD } else { evidence.shade() }.map(|share| (share * self.chroma).powi(-2));
        let e = ELONGATION_STD.powi(-2);
        let w = BLUR_STD_PX.powi(-2);
        let stiffness = Vector::from([0.0, 0.0, 0.0, e, e, w, w, 0.0, first, first, first, second, second, second, second, second]);

        let mut x = from.unwrap_or(prior);
        for _ in 0..ITERATIONS {
            let normal = evidence.normal(&x, shade);
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
            if largest < enough_px.max(ROUGH_PX) {
                let covariance = factors.inverse();
                let std_px = (0.5 * (covariance[(0, 0)] + covariance[(1, 1)])).sqrt();
                if largest < enough_px.max(FINE * std_px) {
                    let by_prior = stiffness.component_mul(&covariance.diagonal());
                    let determined = SIZE as f64 - by_prior.sum();
                    return Some(Settled { x, shade, square: normal.square, covariance, determined });
                }
            }
        }
        None
    }
}
