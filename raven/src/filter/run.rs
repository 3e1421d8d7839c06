//! A filter over a whole log: motor angles at the robot's rate, tip observations at their own times.

use nalgebra::{Matrix3, Vector3};

use super::{Innovation, SquareRootUkf, StateEquation};
use crate::robot::{Kinematics, MotorTrack, PAUSE_MAX_S};
use crate::stats::chi_square_quantile;

/// A tip seen by the cameras, at the time the robot had it there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipAt {
    /// [s], on the motor's clock, latency taken out.
    pub time_s: f64,
    /// Frame 0 [m].
    pub position: Vector3<f64>,
    /// [m^2].
    pub covariance: Matrix3<f64>,
}

/// What a filter made of a log.
#[derive(Debug, Clone, Default)]
pub struct FilterRun {
    /// One estimate per motor sample [s].
    pub time_s: Vec<f64>,
    /// Joint positions [rad, rad, m].
    pub joints: Vec<Vector3<f64>>,
    /// Their standard deviations.
    pub std: Vec<Vector3<f64>>,
    /// Time and innovation of every tip that was offered, accepted or not.
    pub innovations: Vec<(f64, Innovation<3>)>,
    /// Pauses in the log after which the filter started anew.
    pub restarts: usize,
}

/// Chance that a good observation is refused by the gate.
const GATE_REFUSES: f64 = 1e-6;

/// Runs a filter with `N` states over a log. Tips must be sorted by time; those outside the log are passed over.
#[must_use]
pub fn run<const N: usize>(equation: &impl StateEquation<N>, kinematics: &Kinematics, motor: &MotorTrack, tips: &[TipAt]) -> FilterRun {
    let gate = chi_square_quantile(3, 1.0 - GATE_REFUSES);
    let mut out = FilterRun::default();
    let Some(first) = motor.angle.first() else { return out };
    let (mean, factor) = equation.initial(first);
    let mut filter = SquareRootUkf::<N, 3>::new(mean, factor);
    let mut pending = tips.iter().skip_while(|tip| tip.time_s < motor.time_s[0]).peekable();
    for k in 0..motor.angle.len() {
        let now = motor.time_s[k];
        if k > 0 {
            let (start, from) = (motor.time_s[k - 1], &motor.angle[k - 1]);
            let interval = now - start;
            if interval > PAUSE_MAX_S {
                (filter.mean, filter.factor) = equation.initial(&motor.angle[k]);
                out.restarts += 1;
                while pending.next_if(|tip| tip.time_s <= now).is_some() {}
            } else {
                let rate = (motor.angle[k] - from) / interval;
                let mut at = start;
                while let Some(tip) = pending.next_if(|tip| tip.time_s <= now) {
                    advance(&mut filter, equation, &(from + rate * (at - start)), &rate, tip.time_s - at);
                    at = tip.time_s;
                    if let Some(noise) = tip.covariance.cholesky() {
                        let observe = |x: &_| kinematics.forward(&equation.joints(x));
                        out.innovations.push((at, filter.update(&tip.position, observe, &noise.l(), gate)));
                    }
                }
                advance(&mut filter, equation, &(from + rate * (at - start)), &rate, now - at);
            }
        }
        out.time_s.push(now);
        out.joints.push(equation.joints(&filter.mean));
        out.std.push(Vector3::from_fn(|j, _| filter.factor.row(j).norm()));
    }
    out
}

fn advance<const N: usize>(
    filter: &mut SquareRootUkf<N, 3>,
    equation: &impl StateEquation<N>,
    motor: &Vector3<f64>,
    rate: &Vector3<f64>,
    step_s: f64,
) {
    if step_s > 0.0 {
        filter.predict(|x| equation.transition(x, motor, rate, step_s), &equation.noise_factor(step_s));
    }
}
