//! How the transmission bias wanders in a log, by maximum likelihood of the tips.
//!
//! Given the joints that the model has, the bias alone is a linear problem: `tip - f(q) = J(q) b + noise`, `b` a random walk over time and
//! travel. Its exact Kalman filter gives the likelihood of a wander in milliseconds (the innovations form: Schweppe 1965).

use nalgebra::{Matrix3, Vector3};

use super::run::REFUSALS_MAX;
use super::wander::travelled;
use super::{TipAt, Wander};
use crate::robot::{LinkModel, MotorTrack};

/// Range of wander that is looked through [rad or m per sqrt(s), or per sqrt of travel]: from nothing a camera could see to a joint that
/// floats.
const WANDER_RANGE: [f64; 2] = [1e-6, 0.1];

/// Innovations whose normalised square is beyond this count as false tips and not as wander, as long as they do not come in a row.
const OUTLIER_NIS: f64 = 30.0;

struct Sample {
    time_s: f64,
    /// Of each cable since the start [rad, rad, m].
    travelled: Vector3<f64>,
    residual: Vector3<f64>,
    slope: Matrix3<f64>,
    covariance: Matrix3<f64>,
}

/// The most likely wander of each joint's bias, given what the bias may be at the start (one sigma) [rad, rad, m], and the negative logarithm
/// of its likelihood up to a constant of the tips.
///
/// `motor` is what the encoders read, `driving` what `model` is driven with. `None` with fewer than ten tips in reach of the motors.
#[must_use]
pub fn likeliest_wander(
    model: &LinkModel,
    motor: &MotorTrack,
    driving: &MotorTrack,
    tips: &[TipAt],
    initial: &Vector3<f64>,
) -> Option<(Wander, f64)> {
    let samples = samples(model, motor, driving, tips);
    if samples.len() < 10 {
        return None;
    }
    let [low, high] = WANDER_RANGE.map(f64::ln);
    let (middle, width) = (0.5 * (low + high), 0.5 * (high - low));
    let cost = |logs: &[f64; 6]| minus_log_likelihood(&samples, &wander(logs), initial);
    // Either kind alone, then the likelier kind for each joint, then mixtures: from the middle of all six the search would settle on
    // whatever mixture it meets first.
    let [with_time, with_travel] = [[0, 1, 2], [3, 4, 5]].map(|active| {
        let mut logs = [low; 6];
        active.iter().for_each(|&k| logs[k] = middle);
        search(logs, &active, width, &cost)
    });
    let (mut best, other) = if cost(&with_time) < cost(&with_travel) { (with_time, with_travel) } else { (with_travel, with_time) };
    for j in 0..3 {
        let mut trial = best;
        (trial[j], trial[3 + j]) = (other[j], other[3 + j]);
        if cost(&trial) < cost(&best) {
            best = trial;
        }
    }
    let best = search(best, &[0, 1, 2, 3, 4, 5], 0.5 * width, &cost);
    Some((wander(&best), cost(&best)))
}

fn wander(logs: &[f64; 6]) -> Wander {
    Wander { with_time: Vector3::from_fn(|j, _| logs[j].exp()), with_travel: Vector3::from_fn(|j, _| logs[3 + j].exp()) }
}

/// Coordinate search with a shrinking bracket over the `active` ones of the six logarithms; the joints hardly interact.
fn search(mut logs: [f64; 6], active: &[usize], mut width: f64, cost: &impl Fn(&[f64; 6]) -> f64) -> [f64; 6] {
    let [low, high] = WANDER_RANGE.map(f64::ln);
    let mut lowest = cost(&logs);
    for _ in 0..12 {
        for &k in active {
            for share in [-1.0, -0.5, 0.5, 1.0] {
                let mut trial = logs;
                trial[k] = (logs[k] + share * width).clamp(low, high);
                let value = cost(&trial);
                if value < lowest {
                    (lowest, logs) = (value, trial);
                    break;
                }
            }
        }
        width *= 0.6;
    }
    logs
}

fn samples(model: &LinkModel, motor: &MotorTrack, driving: &MotorTrack, tips: &[TipAt]) -> Vec<Sample> {
    let kinematics = &model.arm().kinematics;
    let times: Vec<f64> = tips.iter().map(|tip| tip.time_s).collect();
    let states = model.rollout(driving, &times);
    let travelled = travelled(&model.arm().transmission, motor);
    let known = tips.iter().zip(&states).filter_map(|(tip, state)| Some((tip, state.as_ref()?, motor.interval(tip.time_s)?)));
    known
        .map(|(tip, state, k)| Sample {
            time_s: tip.time_s,
            travelled: travelled[k],
            residual: tip.position - kinematics.forward(&state.position),
            slope: kinematics.jacobian(&state.position),
            covariance: tip.covariance,
        })
        .collect()
}

fn minus_log_likelihood(samples: &[Sample], wander: &Wander, initial: &Vector3<f64>) -> f64 {
    let start = Matrix3::from_diagonal(&initial.component_mul(initial));
    let (mut bias, mut covariance) = (Vector3::zeros(), start);
    let (mut cost, mut last, mut refusals) = (0.0, None::<(f64, Vector3<f64>)>, 0);
    for sample in samples {
        if let Some((time_s, travelled)) = last.replace((sample.time_s, sample.travelled)) {
            covariance += Matrix3::from_diagonal(&wander.variance(sample.time_s - time_s, &(sample.travelled - travelled)));
        }
        let innovation = sample.residual - sample.slope * bias;
        let spread = sample.slope * covariance * sample.slope.transpose() + sample.covariance;
        let Some(factor) = spread.cholesky() else { continue };
        let nis = innovation.dot(&factor.solve(&innovation));
        let accepted = nis <= OUTLIER_NIS || refusals >= REFUSALS_MAX;
        refusals = if accepted { 0 } else { refusals + 1 };
        cost += 2.0 * factor.l().diagonal().map(f64::ln).sum() + if accepted { nis } else { OUTLIER_NIS };
        if accepted {
            let gain = covariance * sample.slope.transpose() * factor.inverse();
            bias += gain * innovation;
            let left = Matrix3::identity() - gain * sample.slope;
            covariance = left * covariance * left.transpose() + gain * sample.covariance * gain.transpose();
        }
    }
    0.5 * cost
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::robot::nominal;

    #[test]
    fn a_known_wander_is_found() {
        let model = LinkModel::new(nominal::gold().arm().unwrap());
        let (kinematics, transmission) = (model.arm().kinematics, &model.arm().transmission);
        let path = |t: f64| Vector3::new(0.8 + 0.3 * t.sin(), 1.5 + 0.2 * (1.3 * t).cos(), 0.33 + 0.03 * (0.7 * t).sin());
        let time_s: Vec<f64> = (0..12_000).map(|k| f64::from(k) * 5e-3).collect();
        let motor = MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&path(t))).collect(), time_s };
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (truth, step_s) = (Vector3::new(4e-3, 1e-3, 3e-4), 1.0 / 15.0);
        let times: Vec<f64> = (1..850).map(|k| f64::from(k) * step_s).collect();
        let mut bias = Vector3::zeros();
        let states = model.rollout(&motor, &times);
        let tips: Vec<TipAt> = times
            .iter()
            .zip(&states)
            .map(|(&time_s, state)| {
                bias += truth.map(|w| w * step_s.sqrt() * normal());
                let position = kinematics.forward(&(state.unwrap().position + bias)) + Vector3::from_fn(|_, _| 3e-4 * normal());
                TipAt { time_s, position, covariance: Matrix3::identity() * 9e-8 }
            })
            .collect();
        let (found, _) = likeliest_wander(&model, &motor, &motor, &tips, &Vector3::new(0.02, 0.02, 2e-3)).unwrap();
        // Under steady motion time and travel say much the same, so what counts is how much gathers by both.
        let travelled = *travelled(transmission, &motor).last().unwrap();
        let gathered = found.variance(60.0, &travelled);
        for j in 0..3 {
            let ratio = (gathered[j] / 60.0).sqrt() / truth[j];
            assert!((0.7..1.4).contains(&ratio), "joint {j}: {ratio}");
        }
    }
}
