//! How fast the transmission bias wanders in a log, by maximum likelihood of the tips.
//!
//! Given the joints that the model has, the bias alone is a linear problem: `tip - f(q) = J(q) b + noise`, `b` a random walk. Its exact
//! Kalman filter gives the likelihood of a wander in milliseconds (the innovations form: Schweppe 1965).

use nalgebra::{Matrix3, Vector3};

use super::TipAt;
use crate::robot::{Kinematics, LinkModel, MotorTrack};

/// Range of wander that is looked through [rad or m per sqrt(s)]: from nothing a camera could see to a joint that floats.
const WANDER_RANGE: [f64; 2] = [1e-6, 0.1];

/// Innovations beyond this multiple of their deviation count as false tips and not as wander.
const OUTLIER_NIS: f64 = 30.0;

struct Sample {
    time_s: f64,
    residual: Vector3<f64>,
    slope: Matrix3<f64>,
    covariance: Matrix3<f64>,
}

/// The most likely wander of each joint's bias [rad, rad, m per sqrt(s)], given what the bias may be at the start (one sigma).
///
/// `None` with fewer than ten tips in reach of the motors.
#[must_use]
pub fn likeliest_wander(model: &LinkModel, motor: &MotorTrack, tips: &[TipAt], initial: &Vector3<f64>) -> Option<Vector3<f64>> {
    let samples = samples(model, &model.arm().kinematics, motor, tips);
    if samples.len() < 10 {
        return None;
    }
    let [low, high] = WANDER_RANGE.map(f64::ln);
    let mut log_wander = Vector3::repeat(0.5 * (low + high));
    // Coordinate search with a shrinking bracket; the three joints hardly interact.
    let mut width = 0.5 * (high - low);
    for _ in 0..12 {
        for j in 0..3 {
            let candidates = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| (log_wander[j] + share * width).clamp(low, high));
            let cost = |value: f64| {
                let mut trial = log_wander;
                trial[j] = value;
                minus_log_likelihood(&samples, &trial.map(f64::exp), initial)
            };
            let best = candidates.into_iter().map(|value| (cost(value), value)).min_by(|a, b| a.0.total_cmp(&b.0));
            log_wander[j] = best.map_or(log_wander[j], |(_, value)| value);
        }
        width *= 0.6;
    }
    Some(log_wander.map(f64::exp))
}

fn samples(model: &LinkModel, kinematics: &Kinematics, motor: &MotorTrack, tips: &[TipAt]) -> Vec<Sample> {
    let times: Vec<f64> = tips.iter().map(|tip| tip.time_s).collect();
    let states = model.rollout(motor, &times);
    let pairs = tips.iter().zip(&states).filter_map(|(tip, state)| Some((tip, state.as_ref()?)));
    pairs
        .map(|(tip, state)| Sample {
            time_s: tip.time_s,
            residual: tip.position - kinematics.forward(&state.position),
            slope: kinematics.jacobian(&state.position),
            covariance: tip.covariance,
        })
        .collect()
}

fn minus_log_likelihood(samples: &[Sample], wander: &Vector3<f64>, initial: &Vector3<f64>) -> f64 {
    let start = Matrix3::from_diagonal(&initial.component_mul(initial));
    let (mut bias, mut covariance) = (Vector3::zeros(), start);
    let (mut cost, mut last) = (0.0, None::<f64>);
    for sample in samples {
        if let Some(last) = last.replace(sample.time_s) {
            covariance += Matrix3::from_diagonal(&(wander.component_mul(wander) * (sample.time_s - last)));
        }
        let innovation = sample.residual - sample.slope * bias;
        let spread = sample.slope * covariance * sample.slope.transpose() + sample.covariance;
        let Some(factor) = spread.cholesky() else { continue };
        let nis = innovation.dot(&factor.solve(&innovation));
        cost += 2.0 * factor.l().diagonal().map(f64::ln).sum() + nis.min(OUTLIER_NIS);
        if nis <= OUTLIER_NIS {
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
        let found = likeliest_wander(&model, &motor, &tips, &Vector3::new(0.02, 0.02, 2e-3)).unwrap();
        for j in 0..3 {
            let ratio = found[j] / truth[j];
            assert!((0.7..1.4).contains(&ratio), "joint {j}: {ratio}");
        }
    }
}
