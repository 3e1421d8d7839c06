//! Recordings of real hardware; skipped where they are not there.

use raven::effects::Channel;
use raven::stats::rms;
use raven_tests::shared;

use super::*;
use crate::evidence::recorded::data::Data;
use crate::evidence::recorded::rows::Rows;

/// Length of the blocks that are fitted and held out in turn [s].
const BLOCK_S: f64 = 3.0;

/// Joints or torques, in [`Bench::errors`].
const JOINTS: usize = 0;
const TORQUES: usize = 1;

fn real(robot: &str, log: &str) -> Option<(Robot, Recording)> {
    let (robot, log) = (shared(&format!("robot/{robot}"))?, shared(&format!("data/real/{log}"))?);
    let robot = Robot::read(&robot).unwrap();
    let recording = Recording::read(&log, &MotorSource::from(&robot)).unwrap();
    Some((robot, recording))
}

fn held_out(time_s: f64) -> bool {
    (time_s / BLOCK_S) as usize % 2 == 1
}

/// Rms of the first joint's errors in held-out blocks, where these effects and the nominal numbers were fitted to the others; by the file as
/// it is without effects to fit.
fn left(robot: &Robot, recording: &Recording, effects: Option<&[&str]>, what: usize) -> f64 {
    let recordings = std::slice::from_ref(recording);
    let bench = Bench::new(robot, recordings).unwrap().weighted(|_, time_s| if held_out(time_s) { 0.0 } else { 1.0 });
    let coordinates = Coordinates::new(robot, &bench);
    let fitter = Fitter::new(&bench, &coordinates);
    let found: Vec<usize> =
        effects.iter().flat_map(|ids| ids.iter()).filter_map(|id| coordinates.sited.iter().position(|s| s.effect.id == *id)).collect();
    let mut start = fitter.nowhere();
    found.iter().flat_map(|&e| coordinates.of(e)).for_each(|c| start[c] = 0.3);
    let at = effects.map_or_else(|| fitter.nowhere(), |_| fitter.fit(&found, &start, None).unwrap().unwrap().u);
    let whole = Bench::new(robot, recordings).unwrap();
    let errors = whole.errors(&coordinates.settings(&at), &[Channel::Tip, Channel::Torque]).unwrap();
    let counted = errors[0].0.iter().zip(&whole.recordings()[0].driven).zip(&whole.weights[0]);
    let counted = counted.filter(|((_, driven), weights)| held_out(driven.shaft.time_s) && weights[what].x > 0.0);
    rms(&counted.map(|((errors, _), _)| errors[what].x).collect::<Vec<_>>()).unwrap()
}

#[test]
fn a_slide_is_found_to_rub_as_published() {
    let Some((robot, recording)) = real("bench-emps.yaml", "emps_estimation.mcap") else { return };
    let of = |effects: Option<&[&str]>| left(&robot, &recording, effects, TORQUES);
    let [before, tuned, after] = [of(None), of(Some(&[])), of(Some(&["motor-coulomb-friction"]))];
    let found = found(&robot, recording);
    eprintln!("{found:?}; force {before:.2} (tuned {tuned:.2}) to {after:.2} N rms");
    // Janot, Gautier, Brunot 2019: 20.4 N.
    let (_, values, unit) = found.iter().find(|(id, ..)| *id == "motor-coulomb-friction").unwrap_or_else(|| panic!("{found:?}"));
    assert!((values[0] - 20.4).abs() < 2.0 && *unit == "N", "{values:?}");
    assert!(after < tuned, "{after} of {tuned}");
    assert!(1.0 - (after / before).powi(2) > 0.75, "{after} of {before}");
}

#[test]
fn an_instrument_is_found_to_be_soft() {
    let Some((robot, recording)) = real("bench-davinci-tool.yaml", "davinci_tool.mcap") else { return };
    let of = |effects: &[&str]| [JOINTS, TORQUES].map(|what| left(&robot, &recording, Some(effects), what));
    let (retuned, soft, rubbing) = (of(&[]), of(&["cable-stretch"]), of(&["cable-stretch", "link-coulomb-friction"]));
    assert!(soft[0] < 0.9 * retuned[0] && rubbing[1] < 0.9 * retuned[1], "{retuned:?} {soft:?} {rubbing:?}");
    // What is found does not depend on the processors of a machine.
    let by =
        |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| found(&robot, recording.clone()));
    let [alone, shared] = [1, 3].map(by);
    eprintln!("{alone:?}");
    assert!(alone.iter().any(|(id, ..)| *id == "cable-stretch"), "{alone:?}");
    assert_eq!(alone, shared);
}

#[test]
fn a_raven_without_dry_friction_in_its_file_is_found_to_have_it() {
    let Some((mut robot, recording)) = real("raven2-gold.yaml", "raven2_uiuc_run.mcap") else { return };
    for joint in &mut robot.joints {
        joint.motor.as_mut().unwrap().coulomb_friction = 0.0;
        joint.link_friction.as_mut().unwrap().coulomb = 0.0;
    }
    let data = [Data::new(&recording, None).unwrap()];
    let rows = Rows::new(&robot, None, &data).unwrap();
    let coordinates = Coordinates::new(&robot, &rows);
    let best = Fitter::new(&rows, &coordinates).search(|| {}).unwrap().unwrap().best;
    let found: Vec<_> = best.effects.iter().map(|&e| (coordinates.sited[e].effect.id, coordinates.sited[e].place.first)).collect();
    let mut joints: Vec<usize> = found.iter().filter(|(id, _)| id.ends_with("coulomb-friction")).map(|(_, joint)| *joint).collect();
    joints.sort_unstable();
    assert_eq!(joints, [0, 1, 2], "{found:?}");
}
