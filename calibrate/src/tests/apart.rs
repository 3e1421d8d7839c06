//! A board waved before two cameras that run freely, one of which is later than its stamps say.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::log::Stamp;

use super::simulated::{Lab, Noise};
use crate::calibration::Options;
use crate::cameras::calibrate;
use crate::corners::Sighting;
use crate::film::Film;
use crate::glimpses::Glimpses;
use crate::pictures::Pictures;
use crate::stills;

const RATE_HZ: f64 = 15.0;
const LATE_S: f64 = 0.008;
const NOISE: Noise = Noise { corner_px: 0.05, picture_px: 0.0, between_m: 0.0 };

/// A board in the hand: up to a tenth of a metre and half a radian to every side, 60 mm/s and 10 deg/s rms.
fn pose(lab: &Lab, time_s: f64) -> Isometry3<f64> {
    let wave = |rate: f64, phase: f64| (rate * time_s + phase).sin();
    let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.5 * wave(0.41, 0.3), 0.5 * wave(0.53, 1.9), 0.3 * wave(0.29, 0.7)));
    let centre = Vector3::new(0.01 + 0.07 * wave(0.71, 0.0), 0.05 * wave(0.97, 1.1), 0.36 + 0.07 * wave(0.37, 2.0));
    Isometry3::from_parts((centre - tilt * lab.board.middle()).into(), tilt)
}

/// Pictures of one camera whose stamps are right or `late_s` too late.
fn film(lab: &Lab, camera: usize, phase_s: f64, late_s: f64, seed: u64) -> Vec<(Stamp, Option<Sighting>)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..600)
        .map(|k| {
            let time_s = phase_s + f64::from(k) / RATE_HZ;
            let jitter: f64 = StandardNormal.sample(&mut random);
            let stamp = Stamp(1_700_000_000_000_000_000).plus_seconds(time_s + late_s + 1e-3 * jitter);
            (stamp, Some(lab.sighting(camera, &pose(lab, time_s), NOISE, &mut random)))
        })
        .collect()
}

fn pictures(lab: &Lab, phase_s: f64, late_s: f64) -> Pictures {
    let seen = [film(lab, 0, 0.0, 0.0, 1), film(lab, 1, phase_s, late_s, 2)];
    let films = seen.map(|seen| Film::new(Stamp(1_700_000_000_000_000_000), seen));
    let shots = stills::shots(&films, 0.0);
    let count = [600, 600];
    Pictures {
        shots,
        films: Some(films),
        sizes_px: lab.sizes(),
        pictures: count,
        boards_seen: count,
        undecodable: 0,
        repeated: 0,
        glimpses: Glimpses::default(),
    }
}

#[test]
fn a_waved_board_calibrates_cameras_that_look_at_different_times() {
    let lab = Lab::new(9, 6);
    for (phase_s, late_s) in [(0.029, 0.0), (0.018, LATE_S), (0.05, -LATE_S)] {
        let mut pictures = pictures(&lab, phase_s, late_s);
        let (found, offset) = calibrate(&mut pictures, &lab.board, Options::default()).unwrap();
        let known_s = offset.map_or(0.0, |offset| offset.right_minus_left_s);
        println!("late by {late_s} s: {offset:?}, {:.3} px", found.rms_px);
        assert!((known_s - late_s).abs() < 1e-3, "right minus left is {known_s} s, not {late_s}");
        let baseline_off = found.rig.right_from_left.translation.vector.norm() / lab.right_from_left.translation.vector.norm() - 1.0;
        assert!(found.rms_px < 0.15 && baseline_off.abs() < 0.01, "{} px, baseline off by {baseline_off}", found.rms_px);
        assert!(found.pairs.len() > 60, "{} pairs", found.pairs.len());
    }
}
