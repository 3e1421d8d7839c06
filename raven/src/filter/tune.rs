//! How the transmission bias wanders in a log, and how the cameras' errors persist, by maximum likelihood of the tips.
//!
//! Given the joints that the model has, both are a linear problem: `tip - f(q) = J(q) b + e`, `b` a random walk over time and travel, `e` partly
//! [persistent](super::persistence). Its exact Kalman filter gives their likelihood in milliseconds (the innovations form: Schweppe 1965).

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};

use super::persistence::TipPath;
use super::run::REFUSALS_MAX;
use super::wander::{gathered, travel};
use super::{Persistence, TipAt, Wander};
use crate::robot::{LinkModel, MotorTrack};

/// Range of wander that is looked through [rad or m per sqrt(s), or per sqrt of travel]: from nothing a camera could see to a joint that
/// floats.
const WANDER_RANGE: [f64; 2] = [1e-6, 0.1];

/// Paths over which errors persist that are looked through [m]: from a fraction of a pixel to a marker's size. What lasts longer is the registration's.
const PATH_RANGE: [f64; 2] = [1e-4, 1e-2];

/// Largest part of the errors that may persist: something is new in every image.
const PART_MAX: f64 = 0.98;

/// Innovations whose normalised square is beyond this count as false tips and not as wander, as long as they do not come in a row.
const OUTLIER_NIS: f64 = 30.0;

/// Numbers of [`Persistence`], each worth a nat.
const NUMBERS: f64 = 2.0;

/// Steps in which whole ranges are looked through, until another sweep gains less [nats], or so often.
const GRID: u8 = 12;
const GAIN_MIN: f64 = 0.5;
const SWEEPS_MAX: usize = 6;

/// Fewest tips that say something.
const TIPS_MIN: usize = 10;

struct Sample {
    time_s: f64,
    /// Of each cable since the start [rad, rad, m].
    travelled: Vector3<f64>,
    /// Of the tip since the start [m].
    path_m: f64,
    residual: Vector3<f64>,
    slope: Matrix3<f64>,
    /// Factor of the covariance that the tip claims.
    claimed: Matrix3<f64>,
}

/// A log's tips against where the model has them.
pub(super) struct Seen {
    samples: Vec<Sample>,
    /// What the bias may be at the start (one sigma) [rad, rad, m].
    initial: Vector3<f64>,
}

impl Seen {
    /// `motor` is what the encoders read, `driving` what `model` is driven with. `None` with fewer than ten tips in reach of the motors.
    pub(super) fn new(model: &LinkModel, motor: &MotorTrack, driving: &MotorTrack, tips: &[TipAt], initial: &Vector3<f64>) -> Option<Self> {
        let kinematics = &model.arm().kinematics;
        let times: Vec<f64> = tips.iter().map(|tip| tip.time_s).collect();
        let states = model.rollout(driving, &times);
        let travelled = gathered(motor, |turned| travel(&model.arm().transmission, turned));
        let path = TipPath::of(model.arm());
        let paths_m = gathered(driving, |turned| path.m(turned));
        let known = tips.iter().zip(&states).filter_map(|(tip, state)| {
            let (state, k) = (state.as_ref()?, motor.interval(tip.time_s)?);
            Some(Sample {
                time_s: tip.time_s,
                travelled: travelled[k],
                path_m: paths_m[k],
                residual: tip.position - kinematics.forward(&state.position),
                slope: kinematics.jacobian(&state.position),
                claimed: tip.covariance.cholesky()?.l(),
            })
        });
        let samples: Vec<Sample> = known.collect();
        (samples.len() >= TIPS_MIN).then_some(Self { samples, initial: *initial })
    }

    fn minus_log_likelihood(&self, wander: &Wander, persistence: &Persistence) -> f64 {
        let [new_part, persistent_part] = persistence.new_and_persistent();
        // The bias [rad, rad, m], and what persists of the errors, in deviations.
        let mut state = Vector6::zeros();
        let mut covariance = Matrix6::identity();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::from_diagonal(&self.initial.component_mul(&self.initial)));
        let (mut cost, mut last, mut refusals) = (0.0, None::<&Sample>, 0);
        for sample in &self.samples {
            if let Some(last) = last.replace(sample) {
                let gathers = wander.variance(sample.time_s - last.time_s, &(sample.travelled - last.travelled));
                let kept = persistence.kept(sample.path_m - last.path_m);
                state.fixed_rows_mut::<3>(3).scale_mut(kept);
                covariance.fixed_rows_mut::<3>(3).scale_mut(kept);
                covariance.fixed_columns_mut::<3>(3).scale_mut(kept);
                for j in 0..3 {
                    covariance[(j, j)] += gathers[j];
                    covariance[(3 + j, 3 + j)] += 1.0 - kept * kept;
                }
            }
            let mut slope = Matrix3x6::zeros();
            slope.fixed_columns_mut::<3>(0).copy_from(&sample.slope);
            slope.fixed_columns_mut::<3>(3).copy_from(&(sample.claimed * persistent_part));
            let new = sample.claimed * new_part;
            let noise = new * new.transpose();
            let innovation = sample.residual - slope * state;
            let across = covariance * slope.transpose();
            let Some(factor) = (slope * across + noise).cholesky() else { continue };
            let nis = innovation.dot(&factor.solve(&innovation));
            let accepted = nis <= OUTLIER_NIS || refusals >= REFUSALS_MAX;
            refusals = if accepted { 0 } else { refusals + 1 };
            cost += 2.0 * factor.l().diagonal().map(f64::ln).sum() + if accepted { nis } else { OUTLIER_NIS };
            if accepted {
                let gain = across * factor.inverse();
                state += gain * innovation;
                let left = Matrix6::identity() - gain * slope;
                covariance = left * covariance * left.transpose() + gain * noise * gain.transpose();
            }
        }
        0.5 * cost
    }
}

/// The most likely wander of each joint's bias where no error persists, and the negative logarithm of its likelihood up to a constant of the tips.
pub(super) fn likeliest_wander(seen: &Seen) -> (Place, f64) {
    let cost = |place: &Place| place.unlikeliness(seen);
    // Either kind alone, then the likelier kind for each joint, then mixtures: from the middle of all six the search would settle on
    // whatever mixture it meets first.
    let [with_time, with_travel] = [[0, 1, 2], [3, 4, 5]].map(|active| {
        let mut place = Place([-1.0; 8]);
        active.iter().for_each(|&k| place.0[k] = 0.0);
        search(place, &active, seen)
    });
    let (mut best, other) = if cost(&with_time) < cost(&with_travel) { (with_time, with_travel) } else { (with_travel, with_time) };
    for j in 0..3 {
        let mut trial = best;
        (trial.0[j], trial.0[3 + j]) = (other.0[j], other.0[3 + j]);
        if cost(&trial) < cost(&best) {
            best = trial;
        }
    }
    let best = search(best, &[0, 1, 2, 3, 4, 5], seen);
    (best, cost(&best))
}

/// Wander and persistence that are most likely together, from the wander that is where no error persists; that one, if errors that do gain less than
/// the two numbers that say how are worth (Akaike 1974).
pub(super) fn likeliest_persistence(seen: &Seen, wander: Place) -> Place {
    let cost = |place: &Place| place.unlikeliness(seen);
    let starts = [-0.5, 0.0, 0.5, 0.9].into_iter().flat_map(|part| {
        [-0.6, 0.0, 0.6].map(|path| {
            let mut place = wander;
            (place.0[PART], place.0[PATH]) = (part, path);
            (cost(&place), place)
        })
    });
    let start = starts.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(wander, |(_, place)| place);
    let best = search(start, &[PART, PATH, 0, 1, 2, 3, 4, 5], seen);
    if cost(&best) + NUMBERS < cost(&wander) { best } else { wander }
}

/// Where in the ranges, -1 to 1 each: wander with time and with travel of three joints, the part of the errors that persists, and its path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place([f64; 8]);

const PART: usize = 6;
const PATH: usize = 7;

impl Place {
    pub(super) fn wander(&self) -> Wander {
        let at = |k: usize| between(WANDER_RANGE, self.0[k]);
        Wander { with_time: Vector3::from_fn(|j, _| at(j)), with_travel: Vector3::from_fn(|j, _| at(3 + j)) }
    }

    pub(super) fn persistence(&self) -> Persistence {
        Persistence { part: 0.5 * PART_MAX * (1.0 + self.0[PART]), path_m: between(PATH_RANGE, self.0[PATH]) }
    }

    fn unlikeliness(&self, seen: &Seen) -> f64 {
        seen.minus_log_likelihood(&self.wander(), &self.persistence())
    }
}

/// From the low end of a range at -1 to the high one at 1, by equal factors.
fn between(range: [f64; 2], place: f64) -> f64 {
    let [low, high] = range.map(f64::ln);
    (0.5 * (low + high) + 0.5 * (high - low) * place).exp()
}

/// Coordinate search over the `active` coordinates of a place: through their whole ranges until that gains no more, as a joint's wander with time
/// and with travel stand in for each other, then in a bracket that shrinks about what was found.
fn search(place: Place, active: &[usize], seen: &Seen) -> Place {
    let mut best = (place.unlikeliness(seen), place);
    let better = |best: (f64, Place), k: usize, at: f64| {
        let mut trial = best.1;
        trial.0[k] = at.clamp(-1.0, 1.0);
        let value = trial.unlikeliness(seen);
        if value < best.0 { (value, trial) } else { best }
    };
    let step = 2.0 / f64::from(GRID);
    for _ in 0..SWEEPS_MAX {
        let before = best.0;
        for &k in active {
            best = (0..=GRID).fold(best, |best, i| better(best, k, f64::from(i) * step - 1.0));
        }
        if before - best.0 < GAIN_MIN {
            break;
        }
    }
    for width in (0..12).map(|shrunk| step * 0.6_f64.powi(shrunk)) {
        for &k in active {
            let middle = best.1.0[k];
            best = [-1.0, -0.5, 0.5, 1.0].iter().fold(best, |best, share| better(best, k, middle + share * width));
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::robot::nominal;

    /// Tips of a robot that moves for a minute, its bias wandering by so much over time, seen with errors of 0.3 mm of which a part persists.
    fn seen(wander: Vector3<f64>, persistence: Persistence, pause: bool) -> (Seen, Vector3<f64>) {
        let model = LinkModel::new(nominal::gold().arm().unwrap());
        let (kinematics, transmission) = (model.arm().kinematics, &model.arm().transmission);
        // Half of the time at rest, or always in motion.
        let phase = |t: f64| if pause { (0.5 * t).floor() + (2.0 * (0.5 * t).fract() - 1.0).max(0.0) } else { 0.5 * t };
        let path = |t: f64| {
            let t = 2.0 * phase(t);
            Vector3::new(0.8 + 0.3 * t.sin(), 1.5 + 0.2 * (1.3 * t).cos(), 0.33 + 0.03 * (0.7 * t).sin())
        };
        let time_s: Vec<f64> = (0..12_000).map(|k| f64::from(k) * 5e-3).collect();
        let motor = MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&path(t))).collect(), time_s };
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal = || Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng));
        let step_s = 1.0 / 15.0;
        let times: Vec<f64> = (1..850).map(|k| f64::from(k) * step_s).collect();
        let tip_path = TipPath::of(model.arm());
        let [new_part, persistent_part] = persistence.new_and_persistent();
        let (mut bias, mut error, mut before) = (Vector3::zeros(), normal(), motor.angle[0]);
        let states = model.rollout(&motor, &times);
        let tips: Vec<TipAt> = times
            .iter()
            .zip(&states)
            .map(|(&time_s, state)| {
                bias += wander.component_mul(&normal()) * step_s.sqrt();
                let (now, _) = motor.at(time_s).unwrap();
                let kept = persistence.kept(tip_path.m(&(now - before)));
                before = now;
                error = error * kept + normal() * (1.0 - kept * kept).sqrt();
                let off = 3e-4 * (normal() * new_part + error * persistent_part);
                TipAt {
                    time_s,
                    position: kinematics.forward(&(state.unwrap().position + bias)) + off,
                    covariance: Matrix3::identity() * 9e-8,
                }
            })
            .collect();
        let travelled = *gathered(&motor, |turned| travel(transmission, turned)).last().unwrap();
        (Seen::new(&model, &motor, &motor, &tips, &Vector3::new(0.02, 0.02, 2e-3)).unwrap(), travelled)
    }

    #[test]
    fn a_known_wander_is_found() {
        let truth = Vector3::new(4e-3, 1e-3, 3e-4);
        let (seen, travelled) = seen(truth, Persistence::NONE, false);
        let place = likeliest_persistence(&seen, likeliest_wander(&seen).0);
        assert_eq!(place.persistence().part, 0.0);
        // Under steady motion time and travel say much the same, so what counts is how much gathers by both.
        let gathered = place.wander().variance(60.0, &travelled);
        for j in 0..3 {
            let ratio = (gathered[j] / 60.0).sqrt() / truth[j];
            assert!((0.7..1.4).contains(&ratio), "joint {j}: {ratio}");
        }
    }

    #[test]
    fn how_errors_persist_is_found() {
        let truth = Persistence { part: 0.7, path_m: 8e-3 };
        let (seen, _) = seen(Vector3::new(5e-4, 5e-4, 5e-5), truth, true);
        let found = likeliest_persistence(&seen, likeliest_wander(&seen).0).persistence();
        assert!((found.part - truth.part).abs() < 0.05, "{found:?}");
        assert!((0.7..1.4).contains(&(found.path_m / truth.path_m)), "{found:?}");
    }
}
