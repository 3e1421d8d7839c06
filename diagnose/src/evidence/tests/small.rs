//! Small effects beside large ones.

use super::*;
use crate::evidence::search::HOPE_NATS;

/// What is named where a rolling shutter moves tips by a sixteenth of what another effect does.
fn named_beside(large: &'static str) -> Vec<&'static str> {
    let rows = Seen::new(&[(large, [0, 0]), ("rolling-shutter", [0, 0])], move |numbers: &[Option<&[f64]>], _: Links| {
        let [large, small] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        tips(|k| 4.0 * k.sin() * (1.0 - large) + 0.25 * k.cos() * (1.0 - small))
    });
    rows.named()
}

#[test]
fn a_law_that_is_not_quite_right_would_do_as_much() {
    assert_eq!(named_beside("load-dependent-friction"), ["load-dependent-friction"]);
}

#[test]
fn what_is_geometry_is_right_and_leaves_nothing_to_make_good() {
    assert_eq!(named_beside("lens-distortion"), ["lens-distortion", "rolling-shutter"]);
}

#[test]
fn what_is_found_beside_an_effect_of_the_file_is_held_to_what_a_second_one_is() {
    // Errors that are alike over a block of time, beside an effect that moves all tips alike.
    let named = |moved: f64, half_loop: f64| {
        let mut rows = Seen::new(&[("joint-offset", [2, 0])], move |numbers: &[Option<&[f64]>], _: Links| {
            let so_far = numbers[0].map_or(0.0, |u| u[0]);
            tips(|k| 0.5 * (moved - so_far) + 0.2 * (k * std::f64::consts::TAU / 180.0).cos())
        });
        rows.robot.joints[0].hysteresis.half_loop = half_loop;
        rows.named()
    };
    assert_eq!(named(0.25, 0.0), ["joint-offset"]);
    assert_eq!(named(0.25, 0.01), [""; 0]);
    assert_eq!(named(1.0, 0.01), ["joint-offset"]);
}

#[test]
fn how_an_effect_of_the_file_begins_is_no_effect() {
    let named = |listed: bool| {
        let mut rows = Seen::new(&[("creep", [1, 0])], |numbers: &[Option<&[f64]>], _: Links| {
            let so_far = numbers[0].map_or(0.0, |u| u[0] + u[2]);
            tips(|k| (0.8 - so_far) * (-k / 100.0).exp())
        });
        if listed {
            let creep = Sited::at(&rows.robot, "creep", Some("elbow")).unwrap();
            rows.robot = creep.added_to(&rows.robot, None, &[1e-3, 30.0, 0.0]).unwrap();
        }
        rows.named()
    };
    assert_eq!(named(false), ["creep"]);
    assert_eq!(named(true), [""; 0]);
}

/// Asserts that a damper is worth a fit beside an offset, where settled links have of it what it does to `settled`.
fn assert_damper_is_seen(settled: fn(f64) -> f64) {
    let rows = Seen::new(&[("joint-offset", [0, 0]), ("cable-damping", [1, 0])], move |numbers: &[Option<&[f64]>], links| {
        let [offset, damped] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let [shows, would_show] = if links == Links::RolledOut { [damped, 0.0] } else { [0.0, damped] };
        tips(|k| 4.0 * k.sin() * (1.0 - offset) + k.cos() * (-1.1 - shows) + settled(k) * (-1.1 - would_show))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [offset, damper] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let alone = fitter.fit(&[offset], &fitter.nowhere(), None).unwrap().unwrap();
    let seen = fitter.screen_some(&alone, alone.evidence, &[damper]).unwrap().remove(0);
    approx::assert_relative_eq!(coordinates.own(damper, &seen.start)[0], -1.1, epsilon = 0.01);
    // The nominal model could be there as well, at the price of its tolerance: a spike in place of the slab.
    let size = coordinates.sizes(damper).next().unwrap();
    let spike = coordinates.all[size].spike.unwrap();
    let of_size = fitter.beyond_normal(&[damper], &|_| -1.1, &|_| 0.01);
    let worth = 0.5 * 1.1_f64.powi(2) * (spike.powi(-2) - 1.0) + spike.ln() + of_size;
    assert!(worth > HOPE_NATS, "{worth}");
    approx::assert_relative_eq!(seen.evidence - alone.evidence, worth, epsilon = 0.1);
}

#[test]
fn a_damper_is_seen_beside_another_effect_though_settled_links_know_nothing_of_it() {
    assert_damper_is_seen(|_| 0.0);
}

#[test]
fn a_damper_is_seen_though_settled_links_promise_more_by_its_tolerance() {
    assert_damper_is_seen(|k| 2.0 * (2.0 * k).cos());
}
