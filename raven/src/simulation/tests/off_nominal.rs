//! Draws within the tolerances, by sampling.

use std::collections::BTreeMap;

use approx::assert_relative_eq;

use super::*;

/// Standard deviation that a draw is to have with the whole tolerance, from the robot file's own words.
fn tolerance(kind: EffectKind, target: Option<&str>) -> f64 {
    let insertion = target.is_some_and(|t| t.ends_with("insertion"));
    match kind {
        EffectKind::PulleyRadius => 0.002,
        EffectKind::JointOffset if insertion => 0.0003,
        EffectKind::JointOffset => 0.0009,
        EffectKind::CableCoupling if insertion => 0.01 / 3.0,
        EffectKind::CableCoupling => 0.01,
        EffectKind::CableStretch => 0.10,
        EffectKind::CableDamping => 0.30,
        EffectKind::MotorInertia | EffectKind::LinkInertia => 0.05,
        EffectKind::MotorCoulombFriction | EffectKind::MotorViscousFriction => 0.10,
        EffectKind::LinkCoulombFriction | EffectKind::LinkViscousFriction => 0.10,
        EffectKind::TorqueConstant => 0.02,
        EffectKind::LinkAngleError => 0.001,
        EffectKind::ToolLength => 0.0003,
        EffectKind::CameraRotation => 0.002,
        EffectKind::CameraTranslation => 0.0005,
        EffectKind::StereoScale => 0.002,
        EffectKind::TimeOffset => 0.003,
        EffectKind::ClockDrift => 0.000_02,
        other => panic!("{} has no tolerance", other.id()),
    }
}

#[test]
fn every_number_with_a_tolerance_scatters_by_the_part_asked_for() {
    let robot = nominal::gold();
    let seeds = 2000;
    let mut scatter: BTreeMap<String, (f64, f64, f64)> = BTreeMap::new();
    for seed in 0..seeds {
        for deviation in deviations(&robot, 0.7, &[], &mut rng(seed)) {
            let target = deviation.target.as_deref();
            for (i, value) in deviation.values.iter().enumerate() {
                let factor = deviation.kind.values()[0].name == "factor";
                let off = if factor { value - 1.0 } else { *value } / (0.7 * tolerance(deviation.kind, target));
                let key = format!("{} {target:?} {i}", deviation.kind.id());
                let sums = scatter.entry(key).or_default();
                *sums = (sums.0 + 1.0, sums.1 + off, sums.2 + off * off);
            }
        }
    }
    // Three joints with eleven numbers, three couplings, two link angles, the tool, two vectors, the baseline, two of time.
    assert_eq!(scatter.len(), 33 + 3 + 2 + 1 + 6 + 1 + 2);
    for (key, (count, sum, squares)) in scatter {
        assert_eq!(count, seeds as f64, "{key}");
        // One in 5e6 of means and of deviations would leave these bands.
        assert!((sum / count).abs() < 5.2 / count.sqrt(), "{key}: mean {}", sum / count);
        let deviation = (squares / count).sqrt();
        assert!((deviation - 1.0).abs() < 5.2 / (2.0 * count).sqrt(), "{key}: {deviation}");
    }
}

#[test]
fn the_machine_and_the_truth_have_what_was_drawn() {
    let robot = nominal::gold();
    let session = |off_nominal| Session::new(&robot, Options { off_nominal, ..Options::default() }).unwrap();
    let (exact, off) = (session(0.0), session(0.7));
    assert!(exact.truth().deviations.is_empty());
    assert_eq!(exact.truth().machine.drives, Machine::new(&robot, &[]).unwrap().drives);
    let value = |kind, target: Option<&str>| {
        let found = off.truth().deviations.iter().find(|d| d.kind == kind && d.target.as_deref() == target);
        found.unwrap().values[0]
    };
    let drives = &off.truth().machine.drives;
    assert_relative_eq!(drives[1].pulley_m, 56.297e-3 * (1.0 + value(EffectKind::PulleyRadius, Some("elbow"))), epsilon = 1e-12);
    assert_relative_eq!(drives[2].stiffness_n, 9250.0 * value(EffectKind::CableStretch, Some("insertion")), epsilon = 1e-6);
    assert_relative_eq!(drives[0].torque_gain, value(EffectKind::TorqueConstant, Some("shoulder")));
    assert_relative_eq!(off.truth().delays.latency_s, value(EffectKind::TimeOffset, None));
    let rig = off.truth().rig.as_ref().unwrap();
    assert_relative_eq!(
        rig.actual.right_from_left.translation.vector.norm() / rig.believed.right_from_left.translation.vector.norm() - 1.0,
        value(EffectKind::StereoScale, None),
        epsilon = 1e-12
    );
    assert_eq!(exact.cameras(), off.cameras());
    assert_eq!(off.truth_json()["off_nominal"].as_array().unwrap().len(), off.truth().deviations.len());
}

#[test]
fn an_effect_keeps_its_size() {
    let robot = nominal::gold();
    let options =
        Options { off_nominal: 0.7, effects: effects(&["pulley-radius:shoulder=0.05", "time-offset=0.04"]), ..Options::default() };
    let session = Session::new(&robot, options).unwrap();
    assert_relative_eq!(session.truth().machine.drives[0].pulley_m, 63.095e-3 * 1.05, epsilon = 1e-12);
    assert_eq!(session.truth().delays.latency_s, 0.04);
    assert!(Session::new(&robot, Options { off_nominal: -0.1, ..Options::default() }).is_err());
}
