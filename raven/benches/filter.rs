//! What the filter's algebra costs beside the model evaluations inside it: the six-state filter against its 13 rollouts, same run.
//!
//!     cargo bench -p raven --bench filter
//!
//! Times on shared machines wander; the ratio of interleaved medians does not. In the same run, as a peer: filterpy's UKF, both with the model
//! of three uncoupled links in `peer/filterpy_ukf.py`, where Python 3 has filterpy (`PYTHON` names another interpreter).

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Const, Matrix3, SMatrix, SVector, Vector3};
use raven::filter::{PaperStates, SquareRootUkf, StateEquation, Turned};
use raven::robot::{LinkModel, nominal};

const STEP_S: f64 = 1e-3;
const BATCH: usize = 200;
const ROUNDS: usize = 101;

fn main() {
    let Ok(arm) = nominal::gold().arm() else { return eprintln!("the nominal robot is no arm") };
    let kinematics = arm.kinematics;
    let motor = arm.transmission.motor_from_joint(&Vector3::new(0.8, 1.5, 0.35));
    let rate = Vector3::new(30.0, -25.0, 20.0);
    let equation = PaperStates::new(LinkModel::new(arm));
    let (mean, factor) = equation.initial(&motor);
    let tip = kinematics.forward(&equation.joints(&mean));
    let turned = rate.map(|r: f64| r.abs() * STEP_S);
    let noise = equation.noise_factor(STEP_S, &Turned { seen: turned, driving: turned });
    let seen = Matrix3::identity() * 1e-3;
    let mut filter = SquareRootUkf::<Const<6>, 3>::new(mean, factor);

    let (mut rollouts, mut filters) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let started = Instant::now();
        for _ in 0..BATCH {
            for i in 0..13 {
                let state: SVector<f64, 6> = mean + SVector::repeat(1e-4 * f64::from(i));
                black_box(equation.transition(black_box(&state), &motor, &rate, STEP_S));
            }
        }
        rollouts.push(started.elapsed().as_secs_f64());
        let started = Instant::now();
        for _ in 0..BATCH {
            filter.predict(|x| equation.transition(x, &motor, &rate, STEP_S), &noise);
            black_box(filter.update(&tip, |x| kinematics.forward(&equation.joints(x)), &seen, None));
        }
        filters.push(started.elapsed().as_secs_f64());
    }
    let median_us = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2] / BATCH as f64 * 1e6
    };
    let (rollout_us, filter_us) = (median_us(&mut rollouts), median_us(&mut filters));
    println!("13 rollouts of 1 ms        {rollout_us:8.2} us");
    println!("predict and update         {filter_us:8.2} us");
    println!("ratio                      {:8.3}", filter_us / rollout_us);
    let uncoupled_us = uncoupled_us();
    println!("with uncoupled links       {uncoupled_us:8.2} us");
    match filterpy_us() {
        Some(peer_us) => println!("filterpy's UKF of the same {peer_us:8.2} us, {:.0} times as long", peer_us / uncoupled_us),
        None => println!("filterpy's UKF of the same not run: python3 has no filterpy (pip install filterpy numpy scipy)"),
    }
}

/// Microseconds per predict and update with the peer's model and numbers.
fn uncoupled_us() -> f64 {
    let position = Vector3::new(0.8, 1.5, 0.35);
    let (wound, wound_rate) = (RADIUS_M.component_mul(&position), Vector3::new(0.01, -0.01, 0.01));
    let mean = SVector::<f64, 6>::from_iterator(position.iter().copied().chain([0.0; 3]));
    let factor = SMatrix::from_diagonal(&SVector::<f64, 6>::from([2e-3, 2e-3, 5e-4, 0.02, 0.02, 5e-3]));
    let noise = SMatrix::from_diagonal(&SVector::<f64, 6>::from([1e-5, 1e-5, 3e-6, 1e-3, 1e-3, 1e-4]));
    let seen = Matrix3::from_diagonal(&Vector3::new(1e-2, 1e-2, 1e-3));
    let mut filter = SquareRootUkf::<Const<6>, 3>::new(mean, factor);
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let started = Instant::now();
            for _ in 0..BATCH {
                filter.predict(|x| uncoupled(x, &wound, &wound_rate), &noise);
                black_box(filter.update(&position, |x| Vector3::new(x[0], x[1], x[2]), &seen, None));
            }
            started.elapsed().as_secs_f64() / BATCH as f64 * 1e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

const RADIUS_M: Vector3<f64> = Vector3::new(63.095e-3, 56.297e-3, 1.0);

/// One Runge-Kutta step of the peer's model: links of constant inertia that do not couple, gravity as a sine.
fn uncoupled(state: &SVector<f64, 6>, wound: &Vector3<f64>, wound_rate: &Vector3<f64>) -> SVector<f64, 6> {
    let slope = |state: SVector<f64, 6>, wound: Vector3<f64>| {
        let mut slope = SVector::<f64, 6>::zeros();
        for j in 0..3 {
            let (position, rate) = (state[j], state[3 + j]);
            let stretch = wound[j] - RADIUS_M[j] * position;
            let damping = 2.0 * [4000.0, 1380.0, 400.0][j] * (wound_rate[j] - RADIUS_M[j] * rate);
            let tension = [720e3, 88e3, 9.25e3][j] * (stretch.exp() - (-stretch).exp()) + damping;
            let drag = [0.505, 0.49, 0.53][j] * (rate / [5e-3, 5e-3, 1e-3][j]).tanh() + 0.005 * rate;
            slope[j] = rate;
            slope[3 + j] = (RADIUS_M[j] * tension - [1.1, 0.6, 3.3][j] * position.sin() - drag) / [0.2, 0.09, 0.407][j];
        }
        slope
    };
    let (half, full) = (wound + wound_rate * (0.5 * STEP_S), wound + wound_rate * STEP_S);
    let k1 = slope(*state, *wound);
    let k2 = slope(state + k1 * (0.5 * STEP_S), half);
    let k3 = slope(state + k2 * (0.5 * STEP_S), half);
    let k4 = slope(state + k3 * STEP_S, full);
    state + (k1 + (k2 + k3) * 2.0 + k4) * (STEP_S / 6.0)
}

/// Microseconds that filterpy takes for a predict and update; `None` where it cannot be run.
fn filterpy_us() -> Option<f64> {
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peer/filterpy_ukf.py");
    let output = std::process::Command::new(python).arg(script).output().ok()?;
    String::from_utf8(output.stdout).ok()?.trim().parse().ok()
}
