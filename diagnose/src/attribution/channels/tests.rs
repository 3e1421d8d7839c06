//! How far the gap of a bench closes: simulated ones whose effect is known, and recordings of real ones.

use std::path::Path;

use raven::log::Recording;
use raven::robot::Robot;
use raven::simulation::{Motion, Options, Session};
use raven_tests::shared;

use crate::attribution::{Attribution, Closure, Nominal, Word, attribute};

fn slide() -> Robot {
    Robot::parse(Path::new("slide.yaml"), include_str!("../../../tests/slide.yaml")).unwrap()
}

fn of(robot: &Robot, hidden: &[&str]) -> Attribution {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("slide.mcap");
    let effects = hidden.iter().map(|text| text.parse().unwrap()).collect();
    Session::new(robot, Options { effects, ..Options::default() }).unwrap().record(Motion::Bench, 40.0, &path, |_| {}).unwrap();
    attribute(&Nominal::new(robot, None), &[Recording::read(&path, &robot.into()).unwrap()], || {}).unwrap()
}

fn channel<'a>(attribution: &'a Attribution, name: &str) -> &'a Closure {
    attribution.gap.iter().find(|gap| gap.channel == name).unwrap_or_else(|| panic!("{name} of {:?}", attribution.gap))
}

#[test]
fn friction_in_a_drive_closes_its_force_and_the_stretch_that_follows_from_it() {
    let robot = slide();
    let attribution = of(&robot, &["motor-coulomb-friction:carriage=2.5"]);
    let named: Vec<&str> = attribution.effects.iter().map(|effect| effect.id).collect();
    assert_eq!(named, ["motor-coulomb-friction"]);
    let force = channel(&attribution, "carriage force");
    assert!(force.held_out && force.unit == "N", "{force:?}");
    // 2.5 times 5 N instead of 5 N.
    assert!((force.before - 7.5).abs() < 0.5, "{force:?}");
    let [low, high] = force.closed_ci95.unwrap();
    assert!(force.closed.unwrap() > 0.95 && low <= force.closed.unwrap() && force.closed.unwrap() <= high, "{force:?}");
    // Nobody states the noise of a force. Nothing of friction that the file lacks counts as such.
    assert!(force.noise_floor > 0.0 && force.noise_floor < 1.05 * force.after, "{force:?}");
    let position = channel(&attribution, "carriage");
    // The cable of 2 x 5000 N/m seemed to be pulled by those 7.5 N.
    assert!(position.unit == "mm" && (position.before - 0.75).abs() < 0.05 && position.after < 0.05, "{position:?}");
    let left = attribution.remaining.iter().find(|remaining| remaining.channel == "carriage force").unwrap();
    let [before, after] = [&left.runs[0].before, &left.runs[0].after].map(|values| raven::stats::rms(values).unwrap());
    assert!((before - force.before).abs() < 1e-9 && (after - force.after).abs() < 1e-9);
}

#[test]
fn a_bench_without_an_effect_has_nothing_to_close() {
    let attribution = of(&slide(), &[]);
    assert_eq!(attribution.verdict, Word::None);
    assert!(attribution.gap.iter().all(|gap| gap.closed.is_none() && !gap.held_out) && attribution.remaining.is_empty());
}

#[test]
fn real_benches_have_their_gap() {
    for (robot, log, name) in [("bench-emps", "emps_estimation", "carriage force"), ("bench-davinci-tool", "davinci_tool", "jaw torque")] {
        let files = [format!("robot/{robot}.yaml"), format!("data/real/{log}.mcap")].map(|file| shared(&file));
        let [Some(robot), Some(log)] = files else { continue };
        let robot = Robot::read(&robot).unwrap();
        let attribution = attribute(&Nominal::new(&robot, None), &[Recording::read(&log, &(&robot).into()).unwrap()], || {}).unwrap();
        let gap = channel(&attribution, name);
        eprintln!("{gap:?}");
        assert!(gap.closed.unwrap() > 0.5 && gap.closed_ci95.unwrap()[0] > 0.5, "{gap:?}");
    }
}
