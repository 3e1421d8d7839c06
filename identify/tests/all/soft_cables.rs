//! Cables of a seventh and a quarter of their stiffness in the virtual lab, whose plant shares no equations with the fitted model and whose
//! friction holds: links swing behind them by more than cameras see, and what is claimed of them holds nevertheless.

use std::path::Path;

use clap::Parser;
use raven::robot::nominal;
use raven::simulation::{Effect, EffectKind, Motion, Options, Session};
use raven_identify::{Args, run};

const SEEDS: u64 = 4;
const DURATION_S: f64 = 16.0;
/// What is left of the stiffness of the elbow's and the insertion's cable.
const SOFT: [(&str, f64); 2] = [("elbow", 0.15), ("insertion", 0.25)];

/// What is found of one session, as scripts read it.
fn identified(seed: u64, folder: &Path) -> serde_json::Value {
    let robot = nominal::gold();
    let effects = SOFT.map(|(joint, factor)| Effect::new(EffectKind::CableStretch, Some(joint), &[factor]).unwrap()).to_vec();
    let session = Session::new(&robot, Options { seed, effects, ..Options::default() }).unwrap();
    let (log, file, result) = (folder.join("log.mcap"), folder.join("robot.yaml"), folder.join("result.json"));
    session.record(Motion::Rich, DURATION_S, &log, |_| ()).unwrap();
    robot.write(&file).unwrap();
    let asked = [Path::new("--parameters"), "r_l,k_e2,k_e3,latency".as_ref()];
    let line = [Path::new("raven-identify"), &log, "--robot".as_ref(), &file, "--json".as_ref(), &result];
    run(Args::parse_from(line.iter().chain(&asked)), &mut Vec::new()).unwrap();
    serde_json::from_str(&std::fs::read_to_string(&result).unwrap()).unwrap()
}

#[test]
fn stiffness_of_soft_cables_is_known_as_well_as_claimed() {
    let folder = tempfile::tempdir().unwrap();
    let nominal = nominal::gold().arm().unwrap().cables.map(|cable| cable.stiffness);
    let truths = [("k_e2", SOFT[0].1 * nominal[1]), ("k_e3", SOFT[1].1 * nominal[2]), ("latency", 0.0)];
    let mut squares = [0.0; 3];
    for seed in 1..=SEEDS {
        let result = identified(seed, folder.path());
        for ((name, truth), square) in truths.iter().zip(&mut squares) {
            let found = result["parameters"].as_array().unwrap().iter().find(|p| p["name"] == *name).unwrap();
            let number = |key: &str| found[key].as_f64().unwrap();
            assert_eq!(found["identified"], true, "seed {seed}: {found}");
            *square += ((number("value") - truth) / number("std")).powi(2) / SEEDS as f64;
        }
        // Mean of 230 sums of three squared normals: one deviation is 0.16.
        let nis = result["nis_mean"].as_f64().unwrap();
        assert!(nis < 3.5, "seed {seed}: residuals are {nis}, and noise alone would be 3");
    }
    // Mean of four squared normals: 99 % lie below 3.32.
    for ((name, _), square) in truths.iter().zip(squares) {
        assert!(square < 3.32, "{name}: squared errors are {square:.2} of the claimed variance");
    }
}
