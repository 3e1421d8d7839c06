use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::effects::Stage;

use super::*;
use crate::phase::{Phase, phases};

const INTERVAL_S: f64 = 1.0 / 15.0;

/// A joint that goes to and fro: its speed is a sine with a wandering period, as free motion has.
fn motion(seconds: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..(seconds / INTERVAL_S) as usize).map(|k| k as f64 * INTERVAL_S).collect();
    let angle = |t: f64| (1.9 * t + 1.5 * (0.31 * t).sin()).sin() + 0.4 * (0.7 * t).cos();
    let rate = time_s.iter().map(|&t| (angle(t + 1e-3) - angle(t - 1e-3)) / 2e-3).collect();
    let position = time_s.iter().map(|&t| angle(t)).collect();
    (time_s, rate, position)
}

fn channel(seconds: f64, error: impl Fn(usize, f64, Phase, f64) -> f64) -> Channel {
    let (time_s, rate, position) = motion(seconds);
    let phases = phases(&time_s, &rate);
    let error = (0..time_s.len()).map(|k| error(k, time_s[k], phases[k], position[k])).collect::<Vec<f64>>();
    let phase = phases.iter().map(|p| Phase::ALL.iter().position(|q| q == p).unwrap() as f64).collect();
    let factors = vec![
        (Kind::Phase, phase),
        (Kind::Speed, rate.iter().map(|r| r.abs()).collect()),
        (Kind::Capstan, position.iter().map(|p| (3.0 * p).rem_euclid(1.0)).collect()),
        (Kind::Position, position),
    ];
    let track = Track { noise: vec![1.0; time_s.len()], time_s, error, factors };
    Channel {
        stage: Stage::Transmission,
        joint: Some("elbow".to_owned()),
        name: "elbow".to_owned(),
        unit: "deg",
        scale: 1.0,
        horizon_s: None,
        position_unit: "deg",
        tracks: vec![track],
    }
}

fn noise(seed: u64, count: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| StandardNormal.sample(&mut rng)).collect()
}

fn place<'a>(found: &'a Whereabouts, kind: Kind, label: &str) -> &'a Place {
    found.places.iter().find(|p| p.kind == kind && p.label == label && p.horizon_s.is_none()).unwrap()
}

/// What a rigid robot that is simulated without noise leaves: rounding, larger where numbers are.
#[test]
fn rounding_is_nowhere() {
    let rounded = |scale: f64| find(&[Channel { unit: "mm", ..channel(75.0, |_, _, _, position| scale * position) }]);
    assert!(rounded(1e-15).places.is_empty() && !rounded(1e-6).places.is_empty());
}

#[test]
fn excess_at_reversals_is_found_with_its_share() {
    let white = noise(1, 4000);
    let found = find(&[channel(75.0, |k, _, phase, _| white[k] * if phase == Phase::Reversal { 3.0 } else { 1.0 })]);
    let reversal = place(&found, Kind::Phase, "reversal");
    assert!(reversal.stands_out() && reversal.share_of_excess > 0.9, "{reversal:?}");
    assert!((reversal.rms - 3.0).abs() < 0.3, "{reversal:?}");
    assert!(!place(&found, Kind::Phase, "cruise").stands_out());
    assert!(
        found.sentences[0].contains("the elbow's excess error")
            && found.sentences[0].contains("sits within 150 ms of reversals, which are "),
        "{:?}",
        found.sentences
    );
}

#[test]
fn an_error_that_grows_with_the_position_is_found_at_its_end() {
    let white = noise(2, 4000);
    let found = find(&[channel(75.0, |k, _, _, position| white[k] + 1.5 * (position + 1.4))]);
    let last = found.places.iter().rfind(|p| p.kind == Kind::Position && p.horizon_s.is_none()).unwrap();
    assert!(last.stands_out() && last.share_of_excess > 1.5 * last.share_of_time, "{last:?}");
    assert!(found.sentences.iter().any(|s| s.contains("at positions of")), "{:?}", found.sentences);
}

#[test]
fn a_disturbed_tenth_of_the_time_is_found() {
    let white = noise(3, 4000);
    let found = find(&[channel(75.0, |k, time_s, _, _| white[k] * if (30.0..37.5).contains(&time_s) { 2.5 } else { 1.0 })]);
    assert!(place(&found, Kind::Time, "40 to 50 %").stands_out(), "{:?}", found.sentences);
    assert!(!place(&found, Kind::Time, "0 to 10 %").stands_out());
}

#[test]
fn an_error_once_per_turn_of_the_capstan_is_found_by_angle_or_position() {
    let white = noise(4, 4000);
    let found = find(&[channel(75.0, |k, _, _, position| white[k] * if (3.0 * position).rem_euclid(1.0) < 0.125 { 2.5 } else { 1.0 })]);
    let bins = ["0 to 22 deg", "22 to 45 deg"].map(|label| place(&found, Kind::Capstan, label));
    assert!(bins.iter().all(|p| p.stands_out()), "{bins:?}");
    assert!(found.sentences[0].contains("capstan at 0 to 45 deg"), "{:?}", found.sentences);
}

#[test]
fn a_tone_is_found_in_its_band() {
    let white = noise(5, 4000);
    let found = find(&[channel(75.0, |k, time_s, _, _| white[k] + 0.6 * (17.0 * time_s).sin())]);
    let band = place(&found, Kind::Frequency, "2.0 to 4.0 Hz");
    assert!(band.stands_out() && band.share_of_excess > 0.5, "{band:?}");
}

/// Errors spread evenly: what stands out in them does so by chance. `sets` of `errors` with a seed each.
fn false_alarms(sets: u64, errors: impl Fn(u64) -> Vec<f64>) -> usize {
    let alarm = |seed: u64| {
        let error = errors(seed);
        let channels = [channel(40.0, |k, _, _, _| error[k])];
        let looks = looks(&channels);
        find_with(&channels, looks, 99, seed).places.iter().any(|place| place.p <= LEVEL)
    };
    (0..sets).filter(|&seed| alarm(seed)).count()
}

#[test]
fn white_noise_raises_no_more_false_alarms_than_it_may() {
    let alarms = false_alarms(220, |seed| noise(1000 + seed, 600));
    // Binomial with 5 %: 19 or more of 220 would come up once in fifty.
    assert!(alarms < 19, "{alarms} of 220");
}

#[test]
fn nor_does_an_evenly_spread_error_that_wanders() {
    let wander = |seed: u64| {
        let (white, mut level) = (noise(5000 + seed, 1200), 0.0);
        (0..600)
            .map(|k| {
                level = 0.9 * level + white[2 * k];
                2.0 * level + white[2 * k + 1]
            })
            .collect()
    };
    let alarms = false_alarms(220, wander);
    assert!(alarms < 19, "{alarms} of 220");
}

#[test]
fn silence_says_so() {
    let white = noise(7, 4000);
    let found = find(&[channel(75.0, |k, _, _, _| white[k])]);
    assert_eq!(found.sentences.len(), 1);
    assert!(found.sentences[0].starts_with("No part of the motion stands out"), "{:?}", found.sentences);
    assert!(find(&[]).sentences.is_empty());
}
