//! The shoulder's pulley from a sinusoid of the virtual lab, whose plant shares no equations with the fitted model: the camera is turned
//! by 1 deg and 60 ms late, and nobody says so. A fit of the pulley alone is off by more than 1 % there and claims a fiftieth of that.

use std::path::Path;

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::simulation::{Effect, EffectKind, Motion, Options};
use raven::stats::rms;

use super::virtual_lab;

const TURN_RAD: f64 = std::f64::consts::PI / 180.0;
const LATENCY_S: f64 = 0.06;
/// The paper's pulley: 59 mm where the drawing has 63.095 mm.
const PULLEY: f64 = 0.059 / 0.063_095 - 1.0;
/// Half an interval of 95 % in standard deviations.
const HALF_95: f64 = 1.96;

/// What one session found: relative error of the pulley and the claimed relative deviation.
fn pulley(seed: u64, duration_s: f64, folder: &Path) -> [f64; 2] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let axis = Vector3::from_fn(|_, _| Distribution::<f64>::sample(&StandardNormal, &mut random)).normalize() * TURN_RAD;
    let effects = vec![
        Effect::new(EffectKind::PulleyRadius, Some("shoulder"), &[PULLEY]).unwrap(),
        Effect::new(EffectKind::CameraRotation, None, axis.as_slice()).unwrap(),
        Effect::new(EffectKind::TimeOffset, None, &[LATENCY_S]).unwrap(),
    ];
    let result = virtual_lab::identified(Options { seed, effects, ..Options::default() }, Motion::Sinusoid, duration_s, &[], folder);
    let found = virtual_lab::found(&result, "r_l1").unwrap();
    assert_eq!(found["identified"], true, "seed {seed}: {found}");
    let (truth, number) = (0.063_095 * (1.0 + PULLEY), |key: &str| found[key].as_f64().unwrap());
    [number("value") / truth - 1.0, number("std") / truth]
}

/// Least and most of `count` intervals of 95 % that hold the truth in 99 of 100 cases, if they are what they claim.
fn binomial_band(count: u32) -> [u32; 2] {
    let mut chances = vec![0.05_f64.powi(count as i32)];
    for k in 0..count {
        chances.push(chances[k as usize] * f64::from(count - k) / f64::from(k + 1) * 0.95 / 0.05);
    }
    let possible = |k: &u32| {
        let (below, above) = (&chances[..=*k as usize], &chances[*k as usize..]);
        below.iter().sum::<f64>() > 0.005 && above.iter().sum::<f64>() > 0.005
    };
    [(0..=count).find(possible).unwrap(), (0..=count).rev().find(possible).unwrap()]
}

fn accept(seeds: u32, duration_s: f64, bias_max: f64) {
    let folder = tempfile::tempdir().unwrap();
    let found: Vec<[f64; 2]> = (0..seeds).map(|seed| pulley(u64::from(seed), duration_s, folder.path())).collect();
    let errors: Vec<f64> = found.iter().map(|[error, _]| *error).collect();
    let bias = errors.iter().sum::<f64>() / f64::from(seeds);
    let scatter = rms(&errors.iter().map(|e| e - bias).collect::<Vec<_>>()).unwrap() * (f64::from(seeds) / f64::from(seeds - 1)).sqrt();
    let claimed = rms(&found.iter().map(|[_, std]| *std).collect::<Vec<_>>()).unwrap();
    let inside = found.iter().filter(|[error, std]| error.abs() < HALF_95 * std).count() as u32;
    let summary = format!(
        "{seeds} sessions of {duration_s} s: bias {:+.4} %, sd {:.4} %, claimed {:.4} %, {inside} of {seeds} intervals of 95 % hold the truth",
        100.0 * bias,
        100.0 * scatter,
        100.0 * claimed
    );
    eprintln!("{summary}");
    assert!(bias.abs() < bias_max, "{summary}");
    let [low, high] = binomial_band(seeds);
    assert!((low..=high).contains(&inside), "{low} to {high} expected; {summary}");
}

#[test]
fn the_binomial_band_is_that_of_the_tables() {
    // Of 20 at 95 %: 15 or fewer come with 0.26 %, 16 or fewer with 1.6 %; all 20 with 36 %.
    assert_eq!(binomial_band(20), [16, 20]);
    assert_eq!(binomial_band(100), [89, 100]);
}

#[test]
fn the_pulley_of_a_turned_and_late_camera_in_short() {
    accept(4, 60.0, 1e-3);
}

#[test]
#[ignore = "long: 20 sessions of 200 s"]
fn the_pulley_of_a_turned_and_late_camera() {
    accept(20, 200.0, 1e-3);
}
