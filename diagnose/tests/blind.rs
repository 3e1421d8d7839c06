//! A small sealed set, diagnosed blind: what the large ones of `docs/diagnosis.md` are made of, each of a size that shows.

use std::path::Path;

use raven::robot::nominal;
use raven::simulation::{Case, Motion, Outside, SealedFolder, Sway};
use raven_diagnose::check::{Diagnosed, Names, check};
use raven_diagnose::{Nominal, Spread, diagnose_recording, when_told};

fn case(name: &str, seed: u64, effects: &[&str]) -> Case {
    Case {
        name: name.to_owned(),
        effects: effects.iter().map(|text| text.parse().unwrap()).collect(),
        outside: None,
        motion: if seed.is_multiple_of(2) { Motion::Rich } else { Motion::Fls(0) },
        duration_s: 30.0,
        rate_hz: 15.0,
        noise_px: 0.2,
        seed,
    }
}

#[test]
fn a_frozen_set_is_diagnosed_blind() {
    let sway = Sway { amplitude_m: nalgebra::Vector3::new(0.0, 3e-3, 2e-3), period_s: 11.0, phase: 0.4 };
    let cases = [
        case("a", 3_000_001, &[]),
        case("c", 3_000_003, &["pulley-radius:elbow=0.03"]),
        case("d", 3_000_004, &["motor-coulomb-friction:shoulder=2"]),
        case("e", 3_000_005, &["hysteresis:insertion=0.0015"]),
        case("f", 3_000_006, &["motor-inertia:elbow=3", "time-offset=0.04"]),
        Case { outside: Some(Outside::SwayingBase(sway)), ..case("g", 3_000_007, &[]) },
    ];
    let robot = nominal::gold();
    let folder = tempfile::tempdir().unwrap();
    let mut sealed = SealedFolder::open(folder.path()).unwrap();
    sealed.add_all(&robot, &cases, &SealedFolder::options(), || {}).unwrap();
    let cameras = raven::camera::Cameras::read(&folder.path().join("cameras.yaml")).unwrap();
    let model = Nominal::new(&robot, Some(&cameras));
    // Each alone: that recordings tell each other how far the robot is off is a test of its own.
    let diagnose = |log: &Path, _: &Spread| Ok(Diagnosed { departures: None, ..diagnose_recording(log, &model)? });
    let oracle = |log: &Path, _: &Spread, effects: &[(&str, Option<&str>)]| when_told(log, &model, effects);
    let verdicts = folder.path().join("verdicts.json");
    let score = check(folder.path(), &Names::of(&robot), &diagnose, &oracle, &verdicts, &mut Vec::new()).unwrap();
    eprintln!("{score}");
    assert_eq!(score.false_alarms.hits, 0);
    assert_eq!((score.single_exact.hits, score.single_exact.of), (3, 3));
    assert_eq!(score.pairs_exact.hits, 1);
    assert_eq!(score.outside_recall.hits, 1);
    assert!(score.sizes.median_relative_error.unwrap() < 0.1);
    assert!(score.gap_closed_of_oracle.unwrap() > 0.9);
}
