//! Rate-independent hysteresis between capstan and cable: the cable's end lags behind the capstan by up to `h`, whatever the load.
//!
//! ```text
//! dz / dx = (h / l) min(1, (1 - z / h) / (1 - s))        for a travel dx > 0
//! ```
//!
//! After a reversal the lag `z` changes in proportion to the travel, by `h` over `l`, until it has come to the part `s` of `h`, and then
//! approaches `h`. With `s = 0` that is Bouc's and Wen's law (Bouc 1967, Wen 1976, with exponent one and `beta = gamma`); with `s` near one and
//! `l = h` it is a sharp play, which has its whole lag after `2 h`; with `s = -1`, where nothing is straight, Dahl's law (Dahl 1968; Bouc's and Wen's
//! with `gamma = 0`) of a length of `2 l`.

use std::borrow::Cow;

use nalgebra::Vector3;

use serde::Deserialize;

use super::stiction::{behind_play, has_play};
use super::{Arm, MotorTrack, PAUSE_MAX_S};

/// Hysteresis of one cable, at its joint [rad or m].
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hysteresis {
    /// `h`: half the loop.
    pub half_loop: f64,
    /// `l`: travel over which the lag turns after a reversal.
    #[serde(default = "usual_length")]
    pub length: f64,
    /// `s`: part of the half loop up to which the lag turns in proportion to the travel [-1 to 1].
    #[serde(default)]
    pub straight_part: f64,
    /// Lag at a recording's start, as a part of `half_loop` [-1 to 1]: what the motion before left.
    #[serde(default)]
    pub lag_at_start: f64,
}

/// A centimetre, or a hundredth of a radian: between a sharp play and cables that rub along their way.
fn usual_length() -> f64 {
    0.01
}

impl Default for Hysteresis {
    /// None.
    fn default() -> Self {
        Self { half_loop: 0.0, length: usual_length(), straight_part: 0.0, lag_at_start: 0.0 }
    }
}

impl Hysteresis {
    /// Lag after a travel, exactly; before and after as a part of the half loop.
    #[must_use]
    pub fn lag_after(&self, lag: f64, travel: f64) -> f64 {
        lagging(lag, self.straight_part, travel / self.length)
    }

    /// `1 - dz / dx`: what moves behind the lag per travel that is on its `way` [1 or -1]. The lag is a part of the half loop.
    #[must_use]
    pub fn passed_on(&self, lag: f64, way: f64) -> f64 {
        let rounded = (1.0 - self.straight_part).max(f64::MIN_POSITIVE);
        1.0 - self.half_loop / self.length * ((1.0 - lag * way) / rounded).clamp(0.0, 1.0)
    }
}

impl Arm {
    /// The motors' motion as it winds the cables: through the laws of the [listed effects](super::ListedEffect) and behind the hysteresis of
    /// each cable. After a pause there is no lag.
    #[must_use]
    pub fn winding<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        let winding = self.motor_laws.applied(self, motor);
        if self.hysteresis.iter().any(|h| h.half_loop != 0.0) {
            return Cow::Owned(behind_hysteresis(&self.hysteresis, &self.transmission.ratio, &winding));
        }
        winding
    }

    /// The motors' motion as it drives the links: [winding](Self::winding) the cables, behind the [play](super::stiction) of friction that
    /// holds.
    #[must_use]
    pub fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        let winding = self.winding(motor);
        if has_play(self) { Cow::Owned(behind_play(self, &winding)) } else { winding }
    }
}

/// The motors' motion behind the hysteresis of each cable: what is wound. `ratio` is motor motion per joint motion.
#[must_use]
pub fn behind_hysteresis(hysteresis: &[Hysteresis; 3], ratio: &Vector3<f64>, motor: &MotorTrack) -> MotorTrack {
    let half_rad = Vector3::from_fn(|j, _| hysteresis[j].half_loop * ratio[j]);
    let length_rad = Vector3::from_fn(|j, _| hysteresis[j].length * ratio[j]);
    // As parts of half a loop.
    let mut lag = Vector3::zeros();
    let mut last: Option<(f64, Vector3<f64>)> = None;
    let angle = motor.time_s.iter().zip(&motor.angle).map(|(&time_s, angle)| {
        match last.filter(|(before_s, _)| time_s - before_s <= PAUSE_MAX_S) {
            Some((_, before)) => {
                let travel = |j: usize| if half_rad[j] == 0.0 { 0.0 } else { (angle[j] - before[j]) / length_rad[j] };
                lag = Vector3::from_fn(|j, _| lagging(lag[j], hysteresis[j].straight_part, travel(j)));
            }
            None if last.is_none() => lag = Vector3::from_fn(|j, _| hysteresis[j].lag_at_start),
            None => lag = Vector3::zeros(),
        }
        last = Some((time_s, *angle));
        angle - lag.component_mul(&half_rad)
    });
    MotorTrack { angle: angle.collect(), time_s: motor.time_s.clone() }
}

/// Lag, as a part of half a loop, after a travel in lengths `l`, exactly.
fn lagging(lag: f64, straight_part: f64, travel: f64) -> f64 {
    if travel == 0.0 {
        return lag;
    }
    let (way, towards, travel) = (travel.signum(), lag * travel.signum(), travel.abs());
    let straight = (straight_part - towards).max(0.0);
    if travel < straight {
        return way * (towards + travel);
    }
    let short_of_all = 1.0 - towards.max(straight_part);
    let rounded = (1.0 - straight_part).max(f64::MIN_POSITIVE);
    way * (1.0 - short_of_all * ((straight - travel) / rounded).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::nominal;
    use approx::assert_relative_eq;

    #[test]
    fn a_straight_lag_turns_as_a_sharp_play() {
        let sharp = |lag: f64, travel: f64| lagging(lag, 1.0 - 1e-9, travel);
        for (lag, travel, expected) in
            [(1.0, -0.5, 0.5), (1.0, -2.5, -1.0), (-0.3, 0.9, 0.6), (0.7, 0.1, 0.8), (0.7, 1.0, 1.0), (0.2, 0.0, 0.2)]
        {
            assert_relative_eq!(sharp(lag, travel), expected, epsilon = 1e-8);
        }
    }

    #[test]
    fn a_rounded_lag_follows_bouc_and_wen() {
        for straight_part in [-1.0, 0.0, 0.4] {
            let mut lag = 1.0;
            let steps = 200_000;
            for _ in 0..steps {
                let slope = f64::min(1.0, (1.0 + lag) / (1.0 - straight_part));
                lag -= slope * 3.0 / f64::from(steps);
            }
            assert_relative_eq!(lagging(1.0, straight_part, -3.0), lag, epsilon = 1e-5);
        }
    }

    #[test]
    fn the_loop_is_twice_the_half_loop_at_any_speed() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.hysteresis[1] = Hysteresis { half_loop: 0.01, length: 0.01, ..Hysteresis::default() };
        arm.hysteresis[2] = Hysteresis { half_loop: 0.001, length: 0.004, ..Hysteresis::default() };
        let ratio = arm.transmission.ratio;
        let back_and_forth = |step: f64| {
            let up = (0..=(0.3 / step) as usize).map(|k| k as f64 * step);
            let positions: Vec<f64> = up.clone().chain(up.clone().rev().skip(1)).collect();
            let time_s = (0..positions.len()).map(|k| k as f64 * 1e-3).collect();
            let motor = MotorTrack { angle: positions.iter().map(|&q| ratio * q).collect(), time_s };
            let driving = arm.driving(&motor);
            // The middle on the way up and on the way down.
            let at = |k: usize| driving.angle[k].component_div(&ratio) - motor.angle[k].component_div(&ratio);
            let (up, down) = (positions.len() / 4, positions.len() - 1 - positions.len() / 4);
            at(down) - at(up)
        };
        for step in [1e-4, 1e-3] {
            let width = back_and_forth(step);
            assert_eq!(width[0], 0.0);
            assert_relative_eq!(width[1], 0.02, epsilon = 2e-5);
            assert_relative_eq!(width[2], 0.002, epsilon = 2e-6);
        }
    }
}
