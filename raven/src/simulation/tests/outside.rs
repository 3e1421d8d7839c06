//! Causes outside the library: each does what its equation says, and a recording shows it.

use approx::assert_relative_eq;

use super::*;
use crate::log::{MotorSource, Recording, TipStatus};

#[test]
fn a_wall_pushes_only_beyond_itself() {
    let wall = Contact { point_m: Vector3::new(0.01, 0.0, 0.0), normal: Vector3::x(), stiffness: 300.0 };
    assert_eq!(wall.force_n(&Vector3::new(0.005, 0.1, 0.2)), Vector3::zeros());
    assert_relative_eq!(wall.force_n(&Vector3::new(0.02, 0.1, 0.2)), Vector3::new(-3.0, 0.0, 0.0), epsilon = 1e-12);
}

#[test]
fn a_pulley_that_is_not_round_keeps_the_hard_stop() {
    let bulge = Bulge { size: 0.02, middle: 0.8, half: 0.75 };
    assert_eq!(bulge.taken(0.0).0, 0.0);
    for travel in [0.1, 0.7, 1.3] {
        let slope = (bulge.taken(travel + 1e-6).0 - bulge.taken(travel - 1e-6).0) / 2e-6;
        assert_relative_eq!(bulge.taken(travel).1, slope, epsilon = 1e-8);
    }
}

#[test]
fn an_encoder_wanders_by_its_deviation() {
    let wander = Wander { deviation: 0.01, counts_per_joint: 1e5, periods_s: [10.0, 17.0, 31.0], phases: [0.0; 3] };
    assert_eq!(wander.counts(0.0), 0);
    let squares: f64 = (0..100_000).map(|k| f64::from(wander.counts(f64::from(k) * 0.05)).powi(2)).sum();
    assert_relative_eq!((squares / 1e5).sqrt(), 1000.0, max_relative = 0.02);
}

#[test]
fn a_base_sways_with_its_period() {
    let sway = Outside::SwayingBase(Sway { amplitude_m: Vector3::new(0.003, 0.0, 0.0), period_s: 8.0, phase: 0.0 });
    assert_relative_eq!(sway.base_shift_m(2.0).x, 0.003, epsilon = 1e-12);
    assert_relative_eq!(sway.base_shift_m(3.0), sway.base_shift_m(11.0), epsilon = 1e-12);
}

/// Tips [m] and torques [N m] of a recording with a cause, or without.
fn shown(outside: Option<Outside>) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let robot = nominal::gold();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r.mcap");
    let options = Options { outside, hidden_part: 0.0, noise_px: 1e-3, ..Options::default() };
    Session::new(&robot, options).unwrap().record(Motion::Rich, 20.0, &path, |_| {}).unwrap();
    let log = Recording::read(&path, &MotorSource::from(&robot)).unwrap();
    let tips = log.require_tip().unwrap().iter().filter(|tip| tip.status == TipStatus::Seen).map(|tip| tip.position_m).collect();
    let effort = log.require_motor().unwrap().effort.clone().unwrap();
    (tips, (0..effort[0].len()).map(|k| Vector3::from_fn(|j, _| effort[j][k])).collect())
}

#[test]
fn every_cause_shows_several_times_the_noise() {
    let robot = nominal::gold();
    let (tips, torques) = shown(None);
    for kind in 0..Outside::KINDS {
        let outside = Outside::draw(&robot, kind, &mut rng(kind as u64)).unwrap();
        assert!(EffectKind::all().all(|effect| effect.id() != outside.id()));
        let (with_tips, with_torques) = shown(Some(outside.clone()));
        assert_eq!(tips.len(), with_tips.len());
        let tip_m = tips.iter().zip(&with_tips).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let torque = torques.iter().zip(&with_torques).map(|(a, b)| (a - b).norm_squared()).sum::<f64>() / torques.len() as f64;
        // A tenth of a pixel is a fifth of a millimetre; the motors' dry friction after the gear box is 0.05 to 0.08 N m.
        eprintln!("{}: tip {:.2} mm, torque {:.4} N m", outside.id(), 1e3 * tip_m, torque.sqrt());
        assert!(tip_m > 1e-3 || torque.sqrt() > 0.01, "{}: tip {tip_m} m, torque {} N m", outside.id(), torque.sqrt());
    }
}

#[test]
fn a_joint_rubs_at_its_place() {
    let bump = Bump { friction: 3.0, at: 0.8, width: 0.1 };
    assert_relative_eq!(bump.friction(0.9), 3.0 / std::f64::consts::E, epsilon = 1e-12);
    let robot = nominal::gold();
    let outside = Outside::PlaceFriction("shoulder".to_owned(), bump);
    let torque_at = |outside: Option<&Outside>, shoulder: f64| {
        let machine = Machine::new(&robot, &[]).unwrap();
        let machine = outside.map_or(machine.clone(), |outside| machine.with_outside(&robot, outside).unwrap());
        let mut recorder = Recorder::at_hard_stop(&robot, machine, [0; 3]).unwrap();
        let from = Vector3::new(shoulder - 0.05, 1.5, 0.35);
        recorder.approach(from);
        let path = Trajectory::rest(from).then(0.0, 1.0, from + Vector3::new(0.1, 0.0, 0.0));
        let trace = recorder.record(&path, 1.0, || {});
        trace.samples()[500].cycle.torque[0]
    };
    // Three newton metres at the joint are 3 r_mc / r_l after the gear box.
    let more = |shoulder| torque_at(Some(&outside), shoulder) - torque_at(None, shoulder);
    assert_relative_eq!(more(0.8), 3.0 * 5.675 / 63.095, max_relative = 0.15);
    assert!(more(0.4).abs() < 0.01);
}
