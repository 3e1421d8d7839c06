//! Exponential cable (the paper's eq. 5): tension difference `gamma = k_e (e^x - e^-x) + 2 b_e xdot` for a stretch `x` in metres.
//!
//! At millimetres of stretch the law is linear to 1e-6, with slope `2 k_e`. Cables that stiffen have an exponent of their own, and a
//! slack pair a dead zone, so that in general
//!
//! ```text
//! gamma = 2 k_e x0 sinh(y / x0) + 2 b_e xdot,   y = x less the nearer end of [-slack / 2, slack / 2], no force within it
//! ```
//!
//! A pair with a dead zone lets its joint go freely: where the damper would outweigh the spring, it hangs slack.

use serde::Deserialize;

/// Stiffness and damping of the cable pair that drives one joint.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cable {
    /// `k_e` [N].
    pub stiffness: f64,
    /// `b_e` [N s/m].
    pub damping: f64,
    /// `x0` [m]: the stretch that makes the exponent one; the paper's exponent is in metres.
    #[serde(default = "one")]
    pub exponent_length: f64,
    /// Stretch over which the pair does not pull at all [m].
    #[serde(default)]
    pub slack: f64,
    /// Part of the stretch under the joint's load that a recording finds not yet there as it begins: 0 of a cable that has settled, 1 of one
    /// that was without load until then.
    #[serde(default)]
    pub fresh_part: f64,
}

fn one() -> f64 {
    1.0
}

impl Cable {
    /// With a stiffness [N] and a damping [N s/m], taut, exponent in metres.
    #[must_use]
    pub fn new(stiffness: f64, damping: f64) -> Self {
        Self { stiffness, damping, exponent_length: 1.0, slack: 0.0, fresh_part: 0.0 }
    }

    /// Tension difference [N] at a stretch [m] and its rate [m/s].
    #[must_use]
    pub fn force(&self, stretch_m: f64, stretch_rate_m_s: f64) -> f64 {
        Pull::new(self).n(stretch_m, stretch_rate_m_s)
    }

    /// Slope of the tension difference by the stretch [N/m] under a static tension difference [N].
    #[must_use]
    pub fn tangent_stiffness(&self, force_n: f64) -> f64 {
        2.0 * self.stiffness * (force_n / (2.0 * self.stiffness * self.exponent_length)).hypot(1.0)
    }

    /// Stretch [m] under a static tension difference [N].
    #[must_use]
    pub fn static_stretch_m(&self, force_n: f64) -> f64 {
        let taut = self.exponent_length * asinh(force_n / (2.0 * self.stiffness * self.exponent_length));
        // Without a load a slack pair may stand anywhere; the middle is as good as any.
        if force_n == 0.0 { 0.0 } else { taut + 0.5 * self.slack * force_n.signum() }
    }
}

/// The law of one cable, with what does not change along a motion worked out.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull {
    half_slack_m: f64,
    /// `2 k_e x0` [N].
    scale_n: f64,
    /// `1 / x0` [1/m].
    per_length: f64,
    /// `2 b_e` [N s/m].
    damping: f64,
}

impl Pull {
    pub(super) fn new(cable: &Cable) -> Self {
        Self {
            // A fit may try less than none, as of a pulley whose radius it takes below zero.
            half_slack_m: 0.5 * cable.slack.max(0.0),
            scale_n: 2.0 * cable.stiffness * cable.exponent_length,
            per_length: cable.exponent_length.recip(),
            damping: 2.0 * cable.damping,
        }
    }

    /// As [`Cable::force`].
    pub(super) fn n(&self, stretch_m: f64, stretch_rate_m_s: f64) -> f64 {
        let half = self.half_slack_m;
        let pull = |taut: f64| self.scale_n * sinh(taut * self.per_length) + self.damping * stretch_rate_m_s;
        if half == 0.0 {
            return pull(stretch_m);
        }
        let taut = stretch_m - stretch_m.clamp(-half, half);
        let pull = pull(taut);
        // Slack cannot push.
        if pull * taut <= 0.0 { 0.0 } else { pull }
    }
}

/// Up to here three terms of the series are exact to the last digit. A cable whose exponent is in metres never leaves it.
const SERIES: f64 = 1e-3;

/// Up to here those of [`SINH`] are.
const LONGER_SERIES: f64 = 1.0;
/// What a term of the hyperbolic sine's series is of the one before, over the square of its argument.
const SINH: [f64; 8] = [1.0 / 6.0, 1.0 / 20.0, 1.0 / 42.0, 1.0 / 72.0, 1.0 / 110.0, 1.0 / 156.0, 1.0 / 210.0, 1.0 / 272.0];

/// As [`f64::sinh`], which takes several times as long.
fn sinh(x: f64) -> f64 {
    let square = x * x;
    if x.abs() < SERIES {
        x * (1.0 + square * SINH[0] * (1.0 + square * SINH[1]))
    } else if x.abs() < LONGER_SERIES {
        x * SINH.iter().rev().fold(1.0, |sum, part| 1.0 + square * part * sum)
    } else {
        let grown = x.abs().exp();
        (0.5 * (grown - grown.recip())).copysign(x)
    }
}

fn asinh(x: f64) -> f64 {
    let square = x * x;
    if x.abs() < SERIES { x * (1.0 - square / 6.0 * (1.0 - square * 9.0 / 20.0)) } else { x.asinh() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn less_slack_than_none_is_none() {
        let [none, less] = [0.0, -1e-3].map(|slack| Pull::new(&Cable { slack, ..Cable::new(7.2e5, 1.0) }).n(1e-5, 1e-3));
        assert_eq!(none, less);
    }

    #[test]
    fn the_slope_is_that_of_the_force() {
        let cable = Cable { exponent_length: 2e-6, ..Cable::new(7.2e5, 0.0) };
        for force_n in [0.0, 1.0, 30.0] {
            let (at, step) = (cable.static_stretch_m(force_n), 1e-10);
            let slope = (cable.force(at + step, 0.0) - cable.force(at - step, 0.0)) / (2.0 * step);
            approx::assert_relative_eq!(cable.tangent_stiffness(force_n), slope, max_relative = 1e-6);
        }
    }

    #[test]
    fn a_slack_pair_lets_its_joint_go_and_stops_it() {
        let cable = Cable { slack: 2e-3, ..Cable::new(2e4, 50.0) };
        for side in [1.0, -1.0] {
            // A tenth of a millimetre beyond the dead zone the spring pulls with 4 N, and the damper makes 1 N of a centimetre per second.
            let force = |rate_m_s: f64| side * cable.force(side * 1.1e-3, side * rate_m_s);
            for (rate_m_s, expected_n) in [(0.0, 4.0), (0.01, 5.0), (0.1, 14.0), (-0.01, 3.0), (-0.039, 0.1), (-0.041, 0.0), (-1.0, 0.0)] {
                approx::assert_relative_eq!(force(rate_m_s), expected_n, epsilon = 1e-5);
            }
            assert_eq!(cable.force(side * 0.9e-3, side * 0.1), 0.0);
        }
        // A pair without a dead zone is taut on both sides, and its damper holds.
        assert!(Cable { slack: 0.0, ..cable }.force(1e-4, -0.1) < 0.0);
    }

    #[test]
    fn the_series_meet_the_functions() {
        for x in [1e-9, 1e-6, 1e-4, 0.999e-3, -0.999e-3] {
            approx::assert_relative_eq!(sinh(x), x.sinh(), max_relative = 4e-16);
            approx::assert_relative_eq!(asinh(x), x.asinh(), max_relative = 4e-16);
        }
        for x in (-3000..3000).map(|k| f64::from(k) * 0.01 + 0.003) {
            approx::assert_relative_eq!(sinh(x), x.sinh(), max_relative = 8e-16);
        }
        assert_eq!([sinh(-1e3), sinh(1e3)], [f64::NEG_INFINITY, f64::INFINITY]);
        assert!(sinh(f64::NAN).is_nan());
    }
}
