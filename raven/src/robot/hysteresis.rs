//! Rate-independent hysteresis between capstan and cable: the cable's end lags behind the capstan by up to `h`, whatever the load.
//!
//! ```text
//! dz / d|x| = (h sign(dx) - z) / (2 h)
//! ```
//!
//! The lag `z` approaches `h` after each reversal over a travel of `2 h`, after which a sharp play would have its whole lag (Dahl 1968
//! with exponent one; the Duhem class in Visintin, Differential Models of Hysteresis, 1994).

use std::borrow::Cow;

use nalgebra::Vector3;

use super::{Arm, MotorTrack, PAUSE_MAX_S};

impl Arm {
    /// The motors' motion as the cables have it: behind the hysteresis of each. After a pause there is no lag, as at the start.
    #[must_use]
    pub fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        if self.hysteresis_half_loop == Vector3::zeros() {
            return Cow::Borrowed(motor);
        }
        let half_rad = self.hysteresis_half_loop.component_mul(&self.transmission.ratio);
        let mut lag = Vector3::zeros();
        let mut last: Option<(f64, Vector3<f64>)> = None;
        let angle = motor.time_s.iter().zip(&motor.angle).map(|(&time_s, angle)| {
            match last.filter(|(before_s, _)| time_s - before_s <= PAUSE_MAX_S) {
                Some((_, before)) => lag = Vector3::from_fn(|j, _| lagging(lag[j], half_rad[j], angle[j] - before[j])),
                None => lag = Vector3::zeros(),
            }
            last = Some((time_s, *angle));
            angle - lag
        });
        Cow::Owned(MotorTrack { angle: angle.collect(), time_s: motor.time_s.clone() })
    }
}

/// Lag after a travel, exactly.
fn lagging(lag: f64, half: f64, travel: f64) -> f64 {
    if travel == 0.0 || half == 0.0 {
        return lag;
    }
    let target = half * travel.signum();
    target + (lag - target) * (-(travel / (2.0 * half)).abs()).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::nominal;
    use approx::assert_relative_eq;

    #[test]
    fn the_loop_is_twice_the_half_loop_at_any_speed() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.hysteresis_half_loop = Vector3::new(0.0, 0.01, 0.001);
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
