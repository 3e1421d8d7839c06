//! Robots and cameras of the virtual lab that are off within their tolerances in every number, of which few are asked for: what is claimed of these holds.

use std::path::Path;

use raven::simulation::{Effect, EffectKind, Motion, Options};

use super::virtual_lab;

const PULLEY: f64 = -0.05;
const LATENCY_S: f64 = 0.03;

/// What one robot came out as.
struct Outcome {
    /// Errors of the shoulder's pulley and the latency over their claimed deviations.
    off: [f64; 2],
    /// Claimed deviation of the pulley, as a part of it.
    pulley_std: f64,
    nis: f64,
    /// Whether the file's other numbers were taken as they are.
    as_filed: bool,
}

/// Of a robot and cameras that are off by so many of their tolerances.
fn identified(seed: u64, off_nominal: f64, duration_s: f64, method: &str, folder: &Path) -> Outcome {
    let effects = vec![
        Effect::new(EffectKind::PulleyRadius, Some("shoulder"), &[PULLEY]).unwrap(),
        Effect::new(EffectKind::TimeOffset, None, &[LATENCY_S]).unwrap(),
    ];
    let cameras = folder.join("cameras.yaml");
    let arguments = ["--cameras", cameras.to_str().unwrap(), "--method", method];
    let options = Options { seed, effects, off_nominal, ..Options::default() };
    let result = virtual_lab::identified(options, Motion::Rich, duration_s, &arguments, folder);
    let found = |name: &str, truth: f64| {
        let found = virtual_lab::found(&result, name).unwrap();
        let number = |key: &str| found[key].as_f64().unwrap();
        ((number("value") - truth) / number("std"), number("std") / truth)
    };
    let (pulley, pulley_std) = found("r_l1", 0.063_095 * (1.0 + PULLEY));
    Outcome {
        off: [pulley, found("latency", LATENCY_S).0],
        pulley_std,
        nis: result["nis_mean"].as_f64().unwrap(),
        as_filed: result["as_filed"].as_bool().unwrap(),
    }
}

/// Mean squared errors of the shoulder's pulley and the latency over the claimed variances, of several robots.
fn squares(method: &str, duration_s: f64, seeds: u64) -> [f64; 2] {
    let folder = tempfile::tempdir().unwrap();
    let all: Vec<Outcome> = (1..=seeds).map(|seed| identified(seed, 1.0, duration_s, method, folder.path())).collect();
    let mean = |of: &dyn Fn(&Outcome) -> f64| all.iter().map(of).sum::<f64>() / seeds as f64;
    let [pulley, latency] = [0, 1].map(|k| mean(&|outcome| outcome.off[k].powi(2)));
    let (std, nis) = (mean(&|outcome| outcome.pulley_std), mean(&|outcome| outcome.nis));
    println!(
        "{method}, {seeds} robots, {duration_s} s: errors rms {:.2} (r_l1) and {:.2} (latency) of the claimed deviation, r_l1 to {:.3} %, mean NIS {nis:.2}",
        pulley.sqrt(),
        latency.sqrt(),
        100.0 * std
    );
    assert!(std < 1e-3 && nis < 4.0, "{std} of the radius, residuals {nis}");
    assert!(all.iter().all(|outcome| !outcome.as_filed));
    [pulley, latency]
}

/// Holds them against where 99 % of such means lie.
fn assert_claims_hold(method: &str, duration_s: f64, seeds: u64) {
    let limit = virtual_lab::mean_square_max(seeds);
    let squares = squares(method, duration_s, seeds);
    assert!(
        squares.iter().all(|square| *square < limit),
        "squared errors are {squares:.2?} of the claimed variance, and at most {limit:.2} expected"
    );
}

#[test]
fn claims_hold_on_robots_within_their_tolerances_in_short() {
    assert_claims_hold("batch", 30.0, 6);
    assert_claims_hold("dual", 30.0, 6);
}

#[test]
fn a_file_that_fits_is_taken_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    for method in ["batch", "dual"] {
        let outcome = identified(1, 0.0, 20.0, method, folder.path());
        assert!(outcome.as_filed && outcome.off.iter().all(|off| off.abs() < 3.0), "{method}: {:?}", outcome.off);
    }
}

#[test]
#[ignore = "long: 32 sessions of 40 s, three times"]
fn claims_hold_on_robots_within_their_tolerances() {
    assert_claims_hold("batch", 40.0, 32);
    // The filters' latency is off by 1.3 of its deviations, which docs/identifiability.md says.
    for method in ["dual", "joint"] {
        let [pulley, _] = squares(method, 40.0, 32);
        assert!(pulley < virtual_lab::mean_square_max(32), "{pulley}");
    }
}
