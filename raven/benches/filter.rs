//! What the filter's algebra costs beside the model evaluations inside it: the six-state filter against its 13 rollouts, same run.
//!
//!     cargo bench -p raven --bench filter
//!
//! Times on shared machines wander; the ratio of interleaved medians does not. In the same run, as a peer: filterpy's UKF with a model that
//! is simpler than ours, where Python 3 has filterpy (`PYTHON` names another interpreter).

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Matrix3, SVector, Vector3};
use raven::filter::{PaperStates, SquareRootUkf, StateEquation};
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
    let noise = equation.noise_factor(STEP_S, &rate.map(|r: f64| r.abs() * STEP_S));
    let seen = Matrix3::identity() * 1e-3;
    let mut filter = SquareRootUkf::<6, 3>::new(mean, factor);

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
    match filterpy_us() {
        Some(peer_us) => println!("filterpy's UKF             {peer_us:8.2} us, {:.0} times ours", peer_us / filter_us),
        None => println!("filterpy's UKF             not run: python3 has no filterpy (pip install filterpy numpy scipy)"),
    }
}

/// Microseconds that filterpy takes for a predict and update; `None` where it cannot be run.
fn filterpy_us() -> Option<f64> {
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peer/filterpy_ukf.py");
    let output = std::process::Command::new(python).arg(script).output().ok()?;
    String::from_utf8(output.stdout).ok()?.trim().parse().ok()
}
