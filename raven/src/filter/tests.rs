//! What a square-root filter must pass; each of these is a published failure of one that did not.

use std::ops::AddAssign;

use approx::assert_relative_eq;
use nalgebra::{Const, Matrix1, Matrix2, Matrix4, Matrix6, SMatrix, SVector, Vector1, Vector2, Vector3, Vector4, Vector6};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::persistence::TipPath;
use super::*;
use crate::observation::{covariance_by_pose_m2, moved_by_pose};
use crate::robot::{LinkModel, MotorTrack, nominal};

/// Two coupled masses of which only the first position is seen; the noise enters all states together.
fn two_masses() -> (Matrix4<f64>, Matrix4<f64>, SMatrix<f64, 1, 4>) {
    let transition = Matrix4::new(1.0, 0.1, 0.0, 0.0, -0.3, 0.95, 0.2, 0.0, 0.0, 0.0, 1.0, 0.1, 0.25, 0.0, -0.2, 0.97);
    let root = Matrix4::new(0.1, 0.0, 0.0, 0.0, 0.05, 0.2, 0.0, 0.0, -0.02, 0.07, 0.15, 0.0, 0.03, -0.04, 0.06, 0.1);
    (transition, root, SMatrix::<f64, 1, 4>::new(1.0, 0.0, 0.0, 0.0))
}

struct ExactKalman {
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

impl ExactKalman {
    fn step(&mut self, f: &Matrix4<f64>, q: &Matrix4<f64>, h: &SMatrix<f64, 1, 4>, r: f64, y: Option<f64>) {
        self.mean = f * self.mean;
        self.covariance = f * self.covariance * f.transpose() + q;
        let Some(y) = y else { return };
        let s = (h * self.covariance * h.transpose())[0] + r;
        let gain = self.covariance * h.transpose() / s;
        self.mean += gain * (y - (h * self.mean)[0]);
        let left = Matrix4::identity() - gain * h;
        self.covariance = left * self.covariance * left.transpose() + gain * r * gain.transpose();
    }
}

#[test]
fn equals_the_exact_kalman_filter_on_a_partially_observed_system() {
    let (f, root, h) = two_masses();
    let q = root * root.transpose();
    let r = 0.04;
    let start = Matrix4::from_diagonal(&Vector4::new(1.0, 0.5, 2.0, 0.1));
    let mut exact = ExactKalman { mean: Vector4::new(0.5, -0.1, 0.2, 0.3), covariance: start };
    let mut filter = SquareRootUkf::<Const<4>, 1>::new(exact.mean, start.map(f64::sqrt));
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for k in 0..2000 {
        // Every third frame is missing, as when the marker is hidden.
        let y = (k % 3 != 0).then(|| normal() * 0.5);
        exact.step(&f, &q, &h, r, y);
        filter.predict(|x| f * x, &root);
        if let Some(y) = y {
            let innovation = filter.update(&Vector1::new(y), |x| h * x, &Matrix1::new(r.sqrt()), None);
            assert!(innovation.accepted);
        }
        assert_relative_eq!(filter.mean, exact.mean, epsilon = 1e-10);
        assert_relative_eq!(filter.covariance(), exact.covariance, epsilon = 1e-10);
        assert!((0..4).all(|i| filter.factor[(i, i)] >= 0.0 && (i + 1..4).all(|j| filter.factor[(i, j)] == 0.0)));
    }
}

#[test]
fn smoother_equals_weighted_least_squares_over_the_whole_record() {
    let (f, root, h) = two_masses();
    let (q, r, steps) = (root * root.transpose(), 0.04, 12);
    let start = Matrix4::from_diagonal(&Vector4::new(1.0, 0.5, 2.0, 0.1));
    let observed = |k: usize| (!k.is_multiple_of(3)).then(|| (k as f64 * 0.7).cos());
    let mut filter = SquareRootUkf::<Const<4>, 1>::new(Vector4::new(0.5, -0.1, 0.2, 0.3), start.map(f64::sqrt));
    // All states at once: prior, transitions and observations as one information matrix.
    let size = 4 * (steps + 1);
    let (mut information, mut vector) = (nalgebra::DMatrix::<f64>::zeros(size, size), nalgebra::DVector::<f64>::zeros(size));
    let (start_inverse, q_inverse) = (start.try_inverse().unwrap(), q.try_inverse().unwrap());
    information.fixed_view_mut::<4, 4>(0, 0).add_assign(&start_inverse);
    vector.fixed_rows_mut::<4>(0).add_assign(&(start_inverse * filter.mean));
    let mut recorded = Vec::new();
    for k in 0..steps {
        recorded.push(filter.predict_recorded(|x| f * x, &root));
        let (a, b) = (4 * k, 4 * (k + 1));
        information.fixed_view_mut::<4, 4>(a, a).add_assign(&(f.transpose() * q_inverse * f));
        information.fixed_view_mut::<4, 4>(a, b).add_assign(&(-f.transpose() * q_inverse));
        information.fixed_view_mut::<4, 4>(b, a).add_assign(&(-q_inverse * f));
        information.fixed_view_mut::<4, 4>(b, b).add_assign(&q_inverse);
        if let Some(y) = observed(k) {
            filter.update(&Vector1::new(y), |x| h * x, &Matrix1::new(f64::sqrt(r)), None);
            information.fixed_view_mut::<4, 4>(b, b).add_assign(&(h.transpose() * h / r));
            vector.fixed_rows_mut::<4>(b).add_assign(&(h.transpose() * y / r));
        }
    }
    let covariance = information.try_inverse().unwrap();
    let mean = &covariance * vector;
    let smoothed = smooth(&recorded, Smoothed { mean: filter.mean, factor: filter.factor });
    for (k, state) in smoothed.iter().enumerate() {
        assert_relative_eq!(state.mean, mean.fixed_rows::<4>(4 * k).into_owned(), epsilon = 1e-9);
        let expected = covariance.fixed_view::<4, 4>(4 * k, 4 * k).into_owned();
        assert_relative_eq!(state.factor * state.factor.transpose(), expected, epsilon = 1e-9);
    }
}

/// A state that is known exactly leaves the predicted covariance without an inverse.
#[test]
fn a_step_that_cannot_be_smoothed_stays_as_filtered() {
    let factor = Matrix2::new(0.2, 0.0, 0.0, 0.0);
    let mut filter = SquareRootUkf::<Const<2>, 1>::new(Vector2::new(1.0, 2.0), factor);
    let step = filter.predict_recorded(|x| Vector2::new(x[0] + 0.1 * x[1], x[1]), &Matrix2::zeros());
    filter.update(&Vector1::new(1.3), |x| Vector1::new(x[0]), &Matrix1::new(0.1), None);
    let smoothed = smooth(&[step], Smoothed { mean: filter.mean, factor: filter.factor })[0];
    assert_relative_eq!(smoothed.mean, Vector2::new(1.0, 2.0), epsilon = 1e-12);
    assert_relative_eq!(smoothed.factor * smoothed.factor.transpose(), factor * factor.transpose(), epsilon = 1e-12);
}

#[test]
fn permuting_the_states_permutes_the_result() {
    let (f, root, h) = two_masses();
    let order = [2, 0, 3, 1];
    let p = Matrix4::from_fn(|i, j| f64::from(u8::from(order[i] == j)));
    let start = Matrix4::from_diagonal(&Vector4::new(1.0, 0.5, 2.0, 0.1));
    let (f2, root2, h2) = (p * f * p.transpose(), p * root, h * p.transpose());
    let mut one = SquareRootUkf::<Const<4>, 1>::new(Vector4::zeros(), start);
    let mut other = SquareRootUkf::<Const<4>, 1>::new(Vector4::zeros(), p * start * p.transpose());
    for k in 0..200 {
        let y = Vector1::new((f64::from(k) * 0.3).sin());
        one.predict(|x| f * x, &root);
        other.predict(|x| f2 * x, &root2);
        one.update(&y, |x| h * x, &Matrix1::new(0.2), None);
        other.update(&y, |x| h2 * x, &Matrix1::new(0.2), None);
    }
    assert_relative_eq!(p * one.mean, other.mean, epsilon = 1e-12);
    assert_relative_eq!(p * one.covariance() * p.transpose(), other.covariance(), epsilon = 1e-12);
}

#[test]
fn keeps_its_digits_under_tiny_measurement_noise() {
    // Two nearly parallel observations of two states with unit prior; the exact posterior is known in closed form.
    let (epsilon, r) = (1e-3, 1e-14);
    let (h1, h2) = (SVector::<f64, 2>::new(1.0, 1.0), SVector::<f64, 2>::new(1.0, 1.0 + epsilon));
    let mut filter = SquareRootUkf::<Const<2>, 1>::new(SVector::zeros(), SMatrix::identity());
    for h in [h1, h2] {
        filter.update(&Vector1::new(0.0), |x| Vector1::new(h.dot(x)), &Matrix1::new(f64::sqrt(r)), None);
    }
    // Information: I + (h1 h1' + h2 h2') / r; its inverse, worked out to leading order by the adjugate with exact determinants.
    let a = 1.0 + 2.0 / r;
    let b = (2.0 + epsilon) / r;
    let d = 1.0 + (2.0 + 2.0 * epsilon + epsilon * epsilon) / r;
    let determinant = 1.0 + (4.0 + 2.0 * epsilon + epsilon * epsilon) / r + (epsilon / r) * (epsilon / r);
    let expected = SMatrix::<f64, 2, 2>::new(d, -b, -b, a) / determinant;
    let relative = (filter.covariance() - expected).amax() / expected.amax();
    assert!(relative < 1e-9, "relative error {relative:e}");
}

#[test]
fn a_million_steps_stay_finite() {
    let (f, root, h) = two_masses();
    let mut filter = SquareRootUkf::<Const<4>, 1>::new(Vector4::zeros(), Matrix4::identity());
    for k in 0..1_000_000 {
        filter.predict(|x| f * x, &root);
        if k % 67 == 0 {
            filter.update(&Vector1::new(0.1), |x| h * x, &Matrix1::new(1e-6), None);
        }
    }
    assert!(filter.mean.iter().chain(filter.factor.iter()).all(|v| v.is_finite()));
}

#[test]
fn refuses_what_is_not_finite_or_beyond_the_gate() {
    let mut filter = SquareRootUkf::<Const<2>, 1>::new(SVector::zeros(), SMatrix::identity());
    let before = filter.clone();
    for y in [f64::NAN, f64::INFINITY, 50.0] {
        let innovation = filter.update(&Vector1::new(y), |x| Vector1::new(x[0]), &Matrix1::new(0.1), Some(16.0));
        assert!(!innovation.accepted);
        assert_eq!((filter.mean, filter.factor), (before.mean, before.factor));
    }
}

#[test]
fn noise_of_the_state_equations_adds_up_over_time_and_travel() {
    let wander = Wander { with_time: Vector3::new(1e-3, 2e-3, 1e-4), with_travel: Vector3::new(2e-3, 1e-3, 2e-4) };
    let (friction, persistence) = (Friction::Holding, Persistence { part: 0.6, path_m: 4e-3 });
    let arm = nominal::gold().arm().unwrap();
    let (path, rate) = (TipPath::of(&arm), Vector3::new(30.0, 20.0, 50.0));
    let states = BiasStates::new(arm, Tuning { friction, wander, persistence });
    let q = |t: f64| {
        let factor = states.noise_factor(t, &Turned { seen: rate * t, driving: rate * t });
        factor * factor.transpose()
    };
    // Noise over two steps: that of velocities carried by the kinematics x += v t, that of the cameras' errors as far as they are kept.
    let mut carry = SMatrix::<f64, BIAS_STATES, BIAS_STATES>::identity();
    for j in 0..3 {
        carry[(j, 3 + j)] = 0.01;
        carry[(9 + j, 9 + j)] = persistence.kept(path.m(&(rate * 0.01)));
    }
    assert_relative_eq!(carry * q(0.01) * carry.transpose() + q(0.01), q(0.02), epsilon = 1e-15, max_relative = 1e-9);
}

#[test]
fn at_rest_the_filter_stays_where_the_cables_hold_the_links() {
    let states = PaperStates::new(LinkModel::new(nominal::gold().arm().unwrap()));
    let joints = Vector3::new(0.8, 1.5, 0.35);
    let motor = states.model.arm().transmission.motor_from_joint(&joints);
    let (mean, _) = states.initial(&motor);
    let mut state = mean;
    for _ in 0..500 {
        state = states.transition(&state, &motor, &Vector3::zeros(), 1e-3);
    }
    assert_relative_eq!(states.joints(&state), states.joints(&mean), epsilon = 1e-5);
}

/// Mean normalised square of a filter's error, over robots that move, wander and are seen as the filter believes.
fn mean_nees<const N: usize>(
    equation: &impl StateEquation<N>,
    kinematics: &crate::robot::Kinematics,
    motor: Vector3<f64>,
    runs: u64,
) -> f64 {
    const STEP_S: f64 = 5e-3;
    let rate = Vector3::new(20.0, -15.0, 25.0);
    let seen = nalgebra::Matrix3::from_diagonal(&Vector3::new(1e-4, 1.5e-3, 1e-4));
    let mut sum = 0.0;
    for seed in 0..runs {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mean, factor) = equation.initial(&motor);
        let mut truth = mean + factor * SVector::<f64, N>::from_fn(|_, _| normal());
        let mut filter = SquareRootUkf::<Const<N>, 3>::new(mean, factor);
        let turned = rate.abs() * STEP_S;
        let noise = equation.noise_factor(STEP_S, &Turned { seen: turned, driving: turned });
        for k in 0..300 {
            let at = motor + rate * (f64::from(k) * STEP_S);
            truth = equation.transition(&truth, &at, &rate, STEP_S) + noise * SVector::<f64, N>::from_fn(|_, _| normal());
            filter.predict(|x| equation.transition(x, &at, &rate, STEP_S), &noise);
            if k % 13 == 12 {
                let observe = |x: &SVector<f64, N>| kinematics.forward(&equation.joints(x)) + equation.persistent_error(x, &seen);
                let new = seen * equation.new_part();
                filter.update(&(observe(&truth) + new * Vector3::from_fn(|_, _| normal())), observe, &new, None);
            }
        }
        let error = filter.factor.solve_lower_triangular(&(truth - filter.mean)).unwrap();
        sum += error.norm_squared();
    }
    sum / runs as f64
}

#[test]
fn claimed_deviations_hold_when_the_robot_is_as_believed() {
    let arm = nominal::gold().arm().unwrap();
    let (kinematics, motor) = (arm.kinematics, arm.transmission.motor_from_joint(&Vector3::new(0.6, 1.5, 0.35)));
    let wander = Wander { with_time: Vector3::new(2e-3, 2e-3, 2e-4), with_travel: Vector3::new(4e-3, 4e-3, 2e-3) };
    let runs = 60;
    // Three standard deviations of the mean of as many chi-squares.
    let band = |states: f64| 3.0 * (2.0 * states / runs as f64).sqrt();
    let six = mean_nees(&PaperStates::new(LinkModel::new(arm.clone())), &kinematics, motor, runs);
    assert!((six - 6.0).abs() < band(6.0), "six states: {six:.2}");
    for friction in [Friction::Holding, Friction::Creeping] {
        let tuning = Tuning { friction, wander, persistence: Persistence { part: 0.8, path_m: 5e-3 } };
        let twelve = mean_nees(&BiasStates::new(arm.clone(), tuning), &kinematics, motor, runs);
        assert!((twelve - 12.0).abs() < band(12.0), "twelve states: {twelve:.2}");
    }
}

/// Robots that move as believed, seen by cameras whose registration is off by what it may be.
#[test]
fn claimed_deviations_hold_when_the_registration_is_off() {
    const RUNS: u64 = 40;
    let arm = nominal::gold().arm().unwrap();
    let path = |t: f64| Vector3::new(0.7 + 0.3 * (1.1 * t).sin(), 1.5 + 0.2 * (0.9 * t).cos(), 0.33 + 0.03 * (0.7 * t).sin());
    let time_s: Vec<f64> = (0..1600).map(|k| f64::from(k) * 5e-3).collect();
    let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&path(t))).collect(), time_s };
    let tuning =
        Tuning { friction: Friction::Creeping, wander: Wander::over_time(Vector3::new(1e-5, 1e-5, 1e-6)), persistence: Persistence::NONE };
    let states = BiasStates::new(arm.clone(), tuning);
    let times: Vec<f64> = (1..118).map(|k| f64::from(k) / 15.0).collect();
    let actual: Vec<_> = states.paper.model.rollout(&motor, &times).into_iter().map(|state| state.unwrap().position).collect();
    let root = Matrix6::from_fn(|i, j| if j > i { 0.0 } else { [4e-4, 3e-4][i / 3] * (1.0 + 0.5 * (i as f64 - 2.0 * j as f64).sin()) });
    let (pose, pivot_m) = (root * root.transpose(), arm.kinematics.forward(&arm.hard_stop));
    let mut mean = [0.0; 2];
    for seed in 0..RUNS {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let off = root * Vector6::from_fn(|_, _| normal());
        let seen = times.iter().zip(&actual).map(|(&time_s, joints)| {
            let tip_m = arm.kinematics.forward(joints);
            let position = tip_m + moved_by_pose(&(tip_m - pivot_m)) * off + Vector3::from_fn(|_, _| 1e-4 * normal());
            TipAt { time_s, position, covariance: nalgebra::Matrix3::identity() * 1e-8 }
        });
        let seen: Vec<TipAt> = seen.collect();
        let found = run(&states, &arm.kinematics, &motor, &seen)
            .with_shared(&arm.kinematics, |tip_m| Some(covariance_by_pose_m2(&pose, &(tip_m - pivot_m))));
        for (track, mean) in [&found.filtered, &found.smoothed].into_iter().zip(&mut mean) {
            let k = track.time_s.iter().position(|&t| t == times[100]).unwrap();
            let error = track.joints[k] - actual[100];
            *mean += track.factor[k].solve_lower_triangular(&error).unwrap().norm_squared() / RUNS as f64;
        }
    }
    assert!(mean.iter().all(|mean| (mean - 3.0).abs() < 3.0 * (6.0 / RUNS as f64).sqrt()), "{mean:?}");
}
