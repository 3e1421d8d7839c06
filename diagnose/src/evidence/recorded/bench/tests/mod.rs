//! Simulated benches with something hidden, and recordings of real ones.

mod real;

use std::path::Path;

use raven::log::{MotorSource, Recording};
use raven::simulation::{Motion, Options, Session};

use super::*;
use crate::attribution::check_bench_fitness;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::coordinates::Coordinates;

const CABLE: &str = "cable: {stiffness: 5000.0, damping: 30.0}, ";

/// A slide with a carriage of two kilograms behind a cable.
fn slide(coulomb_n: f64, cable: &str) -> Robot {
    let gold = raven::robot::nominal::GOLD_YAML;
    let text = format!(
        "format: raven-robot/1\nname: slide\nkinematics: {{kind: bench}}\nsource: {{topic: /motor/joint_states, format: joint_state}}\n\
         joints:\n  - {{name: carriage, type: prismatic, gear_ratio: 1.0, motor_capstan_radius: 1.0, link_pulley_radius: 1.0, {cable}\
         motor: {{inertia: 5.0, coulomb_friction: {coulomb_n:?}, viscous_friction: 20.0}}, link_friction: {{coulomb: 10.0, viscous: 50.0}}}}\n\
         links:\n  - {{mass: 2.0, center_of_mass: [0.0, 0.0, 0.0], inertia: [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]}}\n{}",
        &gold[gold.find("tolerances:").unwrap()..]
    );
    Robot::parse(Path::new("slide.yaml"), &text).unwrap()
}

fn recorded(robot: &Robot, hidden: &[&str]) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slide.mcap");
    let effects = hidden.iter().map(|text| text.parse().unwrap()).collect();
    Session::new(robot, Options { effects, ..Options::default() }).unwrap().record(Motion::Bench, 40.0, &path, |_| {}).unwrap();
    Recording::read(&path, &MotorSource::from(robot)).unwrap()
}

/// What is found, with the values of its numbers.
fn found(robot: &Robot, recording: Recording) -> Vec<(&'static str, Vec<f64>, &'static str)> {
    let recordings = [recording];
    let bench = Bench::new(robot, &recordings).unwrap();
    let coordinates = Coordinates::new(robot, &bench);
    let fitter = Fitter::new(&bench, &coordinates);
    let best: Hypothesis = fitter.search(|| {}).unwrap().unwrap().best;
    let of = |&e: &usize| {
        let sited = &coordinates.sited[e];
        (sited.effect.id, coordinates.values(e, &best.u), sited.effect.parameters[0].unit_at(sited.measure))
    };
    best.effects.iter().map(of).collect()
}

#[test]
fn nothing_is_found_where_nothing_is_hidden() {
    let robot = slide(5.0, CABLE);
    assert_eq!(found(&robot, recorded(&robot, &[])), []);
}

#[test]
fn dry_friction_that_the_file_has_as_zero_is_found_in_newtons() {
    let found = found(&slide(0.0, CABLE), recorded(&slide(8.0, CABLE), &[]));
    let [("motor-coulomb-friction", values, "N")] = found.as_slice() else { panic!("{found:?}") };
    assert!((7.2..8.8).contains(&values[0]), "{values:?}");
}

#[test]
fn a_soft_cable_is_found() {
    let robot = slide(5.0, CABLE);
    let found = found(&robot, recorded(&robot, &["cable-stretch:carriage=0.3"]));
    let (_, values, unit) = found.iter().find(|(id, ..)| *id == "cable-stretch").unwrap_or_else(|| panic!("{found:?}"));
    assert_eq!(*unit, "1");
    assert!((0.26..0.34).contains(&values[0]), "{values:?}");
}

#[test]
fn compliance_that_the_file_does_not_have_is_found() {
    let found = found(&slide(5.0, ""), recorded(&slide(5.0, "cable: {stiffness: 1500.0, damping: 5.0}, "), &[]));
    let (_, values, unit) = found.iter().find(|(id, ..)| *id == "cable-stretch").unwrap_or_else(|| panic!("{found:?}"));
    assert_eq!(*unit, "m/N");
    assert!((values[0] * 3000.0 - 1.0).abs() < 0.15, "{values:?}");
}

#[test]
fn play_is_found_as_hysteresis() {
    let robot = slide(5.0, CABLE);
    let found = found(&robot, recorded(&robot, &["hysteresis:carriage=0.002"]));
    let (_, values, unit) = found.iter().find(|(id, ..)| *id == "hysteresis").unwrap_or_else(|| panic!("{found:?}"));
    assert_eq!(*unit, "m");
    assert!((values[0] / 0.002 - 1.0).abs() < 0.2, "{values:?}");
}

/// Where friction makes the load change sides with the motion, lost motion and play are one.
#[test]
fn lost_motion_is_found_as_backlash_or_as_play() {
    let robot = slide(5.0, CABLE);
    let found = found(&robot, recorded(&robot, &["backlash:carriage=0.003"]));
    assert!(found.iter().any(|(id, ..)| matches!(*id, "backlash" | "hysteresis")), "{found:?}");
}

#[test]
fn a_bench_at_rest_or_of_few_seconds_is_refused() {
    let robot = slide(5.0, CABLE);
    let said = |recording: &Recording| {
        let bench = Bench::new(&robot, std::slice::from_ref(recording)).unwrap();
        check_bench_fitness(&robot, &bench).err().map(|error| error.to_string())
    };
    let mut recording = recorded(&robot, &[]);
    assert_eq!(said(&recording), None);
    let motor = recording.motor.as_mut().unwrap();
    motor.time_s.iter_mut().for_each(|time_s| *time_s *= 0.1);
    let short = said(&recording).unwrap();
    assert!(short.contains("s were recorded, at least 5 s"), "{short}");
    let motor = recording.motor.as_mut().unwrap();
    motor.time_s.iter_mut().for_each(|time_s| *time_s *= 10.0);
    motor.position[0].iter_mut().for_each(|q| *q = 0.1);
    let at_rest = said(&recording).unwrap();
    assert!(at_rest.contains("no joint moves"), "{at_rest}");
}

#[test]
fn a_side_that_counts_backwards_is_turned_and_said() {
    let robot = slide(5.0, CABLE);
    let mut recording = recorded(&robot, &[]);
    let encoders = recording.joint_encoders.as_mut().unwrap();
    encoders.position.iter_mut().flatten().for_each(|q| *q = -*q);
    recording.motor.as_mut().unwrap().effort.as_mut().unwrap().iter_mut().flatten().for_each(|force| *force = -*force);
    let recordings = [recording];
    let bench = Bench::new(&robot, &recordings).unwrap();
    assert_eq!(bench.remarks().len(), 2, "{:?}", bench.remarks());
    let left = bench.residuals(&[], Links::Settled, &crate::evidence::recorded::rows::ALL).unwrap();
    assert!(raven::stats::rms(&left[..bench.tip_rows()]).unwrap() < 1.0);
}

#[test]
fn what_a_bench_cannot_show_is_listed_with_a_reason() {
    let robot = slide(5.0, "");
    let recordings = [recorded(&robot, &[])];
    let bench = Bench::new(&robot, &recordings).unwrap();
    let coordinates = Coordinates::new(&robot, &bench);
    let because = |id: &str| coordinates.not_observable.iter().find(|(effect, _)| effect.id == id).map(|(_, because)| *because);
    assert_eq!(because("tool-length"), Some("a bench has no tool"));
    assert_eq!(because("lens-distortion"), Some("a bench has no cameras"));
    assert_eq!(because("cable-damping"), Some("the nominal transmission is rigid"));
    assert_eq!(because("cable-stretch"), None);
    assert_eq!(because("missed-counts"), None);
    let recordings = [recordings[0].clone(), recordings[0].clone()];
    let bench = Bench::new(&robot, &recordings).unwrap();
    let coordinates = Coordinates::new(&robot, &bench);
    let miscount = coordinates.not_observable.iter().find(|(effect, _)| effect.id == "missed-counts").unwrap();
    assert!(miscount.1.contains("give each alone"), "{}", miscount.1);
}

#[test]
fn only_a_motor_that_turns_has_waves_per_turn() {
    let mut robot = slide(5.0, CABLE);
    for (capstan_radius_m, because) in [(0.01, None), (1.0, Some("its motor slides: it has no turns in which a wave would come again"))] {
        robot.joints[0].motor_capstan_radius = capstan_radius_m;
        let recordings = [recorded(&robot, &[])];
        let bench = Bench::new(&robot, &recordings).unwrap();
        for id in ["torque-ripple", "pulley-eccentricity"] {
            assert_eq!(bench.cannot_show(&Sited::at(&robot, id, Some(&robot.joints[0].name)).unwrap()), because, "{id}");
        }
    }
}

#[test]
fn a_joint_counts_from_its_hard_stop_wherever_the_motor_was_set_to_there() {
    let mut robot = slide(5.0, CABLE);
    for (hard_stop, motor) in [(0.1, None), (0.1, Some(0.02))] {
        (robot.joints[0].hard_stop, robot.joints[0].motor_at_hard_stop) = (hard_stop, motor);
        let recording = recorded(&robot, &[]);
        let channels = crate::residual::channels(&robot, &[recording], std::slice::from_ref(&robot)).unwrap();
        // The cable stretches by some millimetres at most.
        let largest_m = channels[0].joints[0].error.iter().fold(0.0, |largest: f64, error| largest.max(error.abs()));
        assert!(largest_m < 0.01, "{motor:?}: {largest_m}");
    }
}
