//! What a camera's bent response moves the centres of balls by, alike in both cameras.
//!
//! Grey levels of most webcams are roots of the light (gamma 2.2). A pixel of two colours is then brighter than their mean, and a ball that is
//! lit from one side shifts towards the light. With `b` what a response by the square root (gamma 2) would add to the samples of a ball, and
//! `e` what its fit misses, both whitened and without what the fit's unknowns can take up, there is a part
//!
//! ```text
//! p = (sum b e + 1 / s^2) / (sum b b + 1 / s^2),   s = 0.6
//! ```
//!
//! of such a response. Neither it nor the light changes between frames, so that the sums go over all of a camera's frames.

use nalgebra::Matrix2;

/// How much of a bent response there may be before residuals tell, where one is a response by the square root. By rendered balls it is found
/// to 0.2, and half of it is where harmonics follow the light badly: so much shows that there is one, and as much may be there unseen.
const UNKNOWN: f64 = 0.6;
const SHOWN: f64 = 0.5;
const UNSEEN: f64 = 0.25;

/// What a response does to one ball, and what the ball tells of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Response {
    /// What a response by the square root moves the centre by [px].
    pub shift_px: f64,
    /// What else moves the centre alike in both cameras, per axis [px].
    pub unshown_px: f64,
    /// `sum b e`.
    pub along: f64,
    /// `sum b b`.
    pub information: f64,
}

impl Response {
    /// Of a ball that tells nothing, and that a response moves by so much per axis [px].
    #[must_use]
    pub const fn untold(std_px: f64) -> Self {
        Self { shift_px: std_px * std::f64::consts::SQRT_2, unshown_px: 0.0, along: 0.0, information: 0.0 }
    }

    /// The part of a response by the square root that all balls of a camera tell of; 1 where nothing tells.
    #[must_use]
    pub fn part<'a>(all: impl IntoIterator<Item = &'a Self>) -> f64 {
        let prior = UNKNOWN.powi(-2);
        let (along, information) =
            all.into_iter().fold((prior, prior), |(along, information), one| (along + one.along, information + one.information));
        along / information
    }

    /// Standard deviation per axis of what moves the centre alike in both cameras [px], where there is such a part of a response.
    #[must_use]
    pub fn alike_px(&self, part: f64) -> f64 {
        let shift_px = self.shift_px * (part / SHOWN).clamp(UNSEEN, 1.0);
        (shift_px * std::f64::consts::FRAC_1_SQRT_2).hypot(self.unshown_px)
    }

    /// Covariance of a centre beside its noise [px^2], as far as this ball tells.
    #[must_use]
    pub fn beside(&self, noise_px2: Matrix2<f64>) -> Matrix2<f64> {
        noise_px2 + Matrix2::identity() * self.alike_px(Self::part([self])).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_ball_leaves_open_many_tell() {
        let ball = |along: f64| Response { shift_px: 0.2, unshown_px: 0.02, along, information: 10.0 };
        let alike_px = |all: &[Response]| all[0].alike_px(Response::part(all));
        // No response, by balls that scatter; then one that half the part shows.
        let straight: Vec<Response> = (0..100).map(|k| ball(if k % 2 == 0 { 4.0 } else { -4.0 })).collect();
        assert!(straight[0].beside(Matrix2::zeros()).m11 > 0.13_f64.powi(2));
        approx::assert_relative_eq!(alike_px(&straight), (0.2 * 0.25 / 2.0_f64.sqrt()).hypot(0.02), epsilon = 1e-12);
        let bent: Vec<Response> = (0..100).map(|_| ball(6.0)).collect();
        approx::assert_relative_eq!(alike_px(&bent), (0.2 / 2.0_f64.sqrt()).hypot(0.02), epsilon = 1e-12);
    }

    #[test]
    fn where_nothing_tells_all_of_it_may_be_there() {
        let ball = Response::untold(0.07);
        approx::assert_relative_eq!(ball.alike_px(Response::part([&ball; 3])), 0.07, epsilon = 1e-12);
        assert_eq!(Response::default().alike_px(1.0), 0.0);
    }
}
