//! Fits that stop short or go astray, begun again.

use super::*;
use crate::evidence::fit::linear::dot;

#[test]
fn an_effect_that_was_lost_is_found_where_the_nominal_model_has_come_to() {
    // Slopes lead past three and a half tolerances of a coupling, where all is well, unless the tolerance holds them back.
    let places = [("cable-coupling", [0, 1])];
    let nothing = Seen::new(&places, |_: &[Option<&[f64]>], _| vec![0.0; ROWS]);
    let spike = Coordinates::new(&nothing.robot, &nothing).all[0].spike.unwrap();
    let rows = Seen::new(&places, |numbers: &[Option<&[f64]>], _| {
        let tolerances = numbers[0].map_or(0.0, |u| u[0]) / spike;
        let [missed, elsewhere] = [0.019 * (7.0 - tolerances), 0.12 * (1.0 - (-2.0 * (tolerances - 3.5).powi(2)).exp())];
        let row = |k: usize| (k as f64).sin() * missed + (k as f64).cos() * elsewhere;
        (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * row(k)).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let outcome = fitter.search(|| {}).unwrap().unwrap();
    let (found, _) = &outcome.fitted[&vec![0]];
    approx::assert_relative_eq!(found.u[0] / spike, 3.5, epsilon = 0.5);
    assert!(found.evidence > outcome.none.evidence, "{} {}", found.evidence, outcome.none.evidence);
    let astray = fitter.fit(&[0], &fitter.nowhere(), None).unwrap().unwrap();
    assert!(astray.u[0] > 6.0 * spike && fitter.lost_nats(&astray, &outcome.none) > 5.0, "{:?}", astray.u);
    assert!(fitter.lost_nats(found, &outcome.none) < 1e-6);
}

#[test]
fn a_soft_cable_is_found_where_creep_stands_in_for_it() {
    // A cable of a thirty-eighth of its stiffness, found with a third of its stretch to come, of which settled links say nothing.
    let places = [("cable-stretch", [2, 0]), ("creep", [2, 0])];
    let robot = nominal::gold();
    let all = Sited::all(&robot);
    let sited = places.map(|(id, [joint, _])| *all.iter().find(|s| s.effect.id == id && s.place.first == joint).unwrap());
    let rows = Seen::new(&places, |numbers: &[Option<&[f64]>], links| {
        let still_to_come = |t: f64, settles_s: f64| (-t / settles_s).exp();
        let stretched = |t: f64, factor: f64, fresh: f64| (1.0 - fresh * still_to_come(t, 0.05 / factor)) / factor;
        let cable = |t: f64| match numbers[0].filter(|_| links == Links::RolledOut).map(|u| sited[0].values(u)) {
            Some(values) => stretched(t, values[0], values[1]),
            None => 1.0,
        };
        let creep = |t: f64| numbers[1].map(|u| sited[1].values(u)).map_or(0.0, |v| v[0] * (1.0 - v[2] * still_to_come(t, v[1])));
        (0..ROWS).map(|k| 0.05 * k as f64).map(|t| SEEN * (stretched(t, 1.0 / 38.0, 0.33) - cable(t) - creep(t))).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let outcome = fitter.search(|| {}).unwrap().unwrap();
    let named: Vec<_> = outcome.best.effects.iter().map(|&effect| coordinates.sited[effect].effect.id).collect();
    assert_eq!(named, ["cable-stretch"]);
    let values = coordinates.values(outcome.best.effects[0], &outcome.best.u);
    approx::assert_relative_eq!(values[0], 1.0 / 38.0, max_relative = 1e-2);
}

#[test]
fn a_slack_beside_another_effect_is_found_where_a_cable_and_its_stiffening_stand_in_for_it() {
    // A payload comes first, and beside it settled links, which know nothing of a slack, have something to say of the elbow's cable alone.
    let effects = [("payload", [0, 0]), ("backlash", [1, 0]), ("cable-stretch", [1, 0]), ("cable-stiffening", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [loaded, slack, soft, stiffening] = [0, 1, 2, 3].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let stiffened = if numbers[3].is_some() { (-2.0 * stiffening).exp() } else { 0.0 };
        let slack = if links == Links::RolledOut { slack } else { 0.0 };
        let row = |k: f64| {
            let elbow = k.cos() * (0.7 - slack - soft) + (2.0 * k).sin() * (0.7 * soft - stiffened) + (3.0 * k).sin() * 0.1 * soft;
            3.0 * k.sin() * (1.0 - loaded) + elbow
        };
        tips(row)
    });
    assert_eq!(rows.named(), ["backlash", "payload"]);
}

#[test]
fn a_slack_beside_another_effect_is_found_where_nothing_stands_in_for_it() {
    // Settled links say nothing of a slack beside a payload, and something remains.
    let rows = Seen::new(&[("payload", [0, 0]), ("backlash", [1, 0])], |numbers: &[Option<&[f64]>], links| {
        let [loaded, slack] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let slack = if links == Links::RolledOut { slack } else { 0.0 };
        tips(|k| 3.0 * k.sin() * (1.0 - loaded) + k.cos() * (0.7 - slack))
    });
    assert_eq!(rows.named(), ["backlash", "payload"]);
}

#[test]
fn what_is_beside_an_effect_is_looked_for_where_that_has_been_fitted_again() {
    // Settled links take a payload for twice of what it is, so that its fit stops at a ridge, unless a rolling shutter helps it over. Beyond,
    // nothing is missing but a hard stop that is eight tolerances off.
    let effects = [("payload", [0, 0]), ("rolling-shutter", [0, 0]), ("joint-offset", [0, 0])];
    let nothing = Seen::new(&effects[2..], |_: &[Option<&[f64]>], _| vec![0.0; ROWS]);
    let off = 8.0 * Coordinates::new(&nothing.robot, &nothing).all[0].spike.unwrap();
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [loaded, shutter, offset] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let payload = if links == Links::RolledOut { loaded } else { 2.0 * loaded };
        let ridge = (-((loaded - 0.75) / 0.1).powi(2)).exp();
        let row = |k: f64| 3.0 * k.sin() * (1.0 - payload) + (2.0 * k).sin() * (2.0 * ridge - shutter) + k.cos() * (1.0 - offset / off);
        tips(row)
    });
    assert_eq!(rows.named(), ["joint-offset", "payload"]);
}

#[test]
fn a_slack_is_found_where_its_joint_bounces_as_recorded_between_sizes_that_were_tried() {
    // A broad valley about 0.68 slabs, and a deep and narrow one at 0.27.
    let rows = Seen::new(&[("backlash", [0, 0])], |numbers: &[Option<&[f64]>], _| {
        let slack = numbers[0].map_or(0.0, |u| u[0]);
        let bounces_otherwise = 1.0 - (-((slack - 0.27) / 0.03).powi(2)).exp();
        let row = |k: f64| k.sin() * 0.1 * (0.68 - slack) + k.cos() * 0.15 * bounces_otherwise;
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let outcome = Fitter::new(&rows, &coordinates).search(|| {}).unwrap().unwrap();
    assert_eq!(outcome.best.effects, [0]);
    approx::assert_relative_eq!(outcome.best.u[0], 0.27, epsilon = 0.02);
}

#[test]
fn a_slack_that_leaves_something_is_resized_before_others_make_up_for_it() {
    // Any slack does for most of it. It bounces a part as recorded at 1.7 times the size that a fit comes to, and wholly at 1.7 times that.
    let rows = Seen::new(&[("backlash", [1, 0])], |numbers: &[Option<&[f64]>], _| {
        let slack = numbers[0].map_or(0.0, |u| u[0]);
        let about = |size: f64| (-((slack - size) / 0.015).powi(2)).exp();
        let (lost, bounces_otherwise) = ((1.0 - slack / 0.2).max(0.0), 1.0 - 0.4 * about(0.34) - about(0.578));
        (0..ROWS)
            .map(|k| SEEN * std::f64::consts::SQRT_2 * (3.0 * lost * (k as f64).sin() + bounces_otherwise * (k as f64).cos()))
            .collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let best = fitter.fit(&[0], &[0.15], Some(&nominal)).unwrap().unwrap();
    approx::assert_relative_eq!(best.u[0], 0.2, epsilon = 0.01);
    let resized = fitter.resized(&mut outcome, &nominal, best).unwrap();
    approx::assert_relative_eq!(resized.u[0], 0.578, epsilon = 0.01);
    assert!(outcome.best.effects.is_empty(), "what is best is decided by the search");
}

#[test]
fn a_slack_is_not_resized_as_if_what_is_beside_it_were_not_there() {
    // Something of either remains.
    let effects = [("backlash", [1, 0]), ("missed-counts", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [slack, missed] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        tips(|k| k.sin() * (1.0 - slack) + k.cos() * (2.0 - missed) + (2.0 * k).sin())
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let [slack, missed] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let mut start = nominal.u.clone();
    coordinates.of(slack).for_each(|c| start[c] = 0.5);
    outcome.best = fitter.fit(&[slack, missed], &start, Some(&nominal)).unwrap().unwrap();
    assert!(fitter.leftover(&outcome.best).remains());
    assert!(!fitter.slack_resized(&mut outcome, &nominal).unwrap());
    assert!(!outcome.fitted.contains_key(&vec![slack]));
    outcome.best = fitter.fit(&[slack], &start, Some(&nominal)).unwrap().unwrap();
    fitter.slack_resized(&mut outcome, &nominal).unwrap();
    assert!(outcome.fitted.contains_key(&vec![slack]));
}

#[test]
fn a_loop_that_is_sharper_than_its_fit_came_to_is_found_before_others_make_up_for_it() {
    // Settled links say nothing of how sharp it is, and rolled-out ones only near what it is.
    let effects = [("hysteresis", [1, 0]), ("payload", [0, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [half_loop, straightness] = numbers[0].map_or([0.0; 2], |u| [u[0], u[2]]);
        let payload = numbers[1].map_or(0.0, |u| u[0]);
        let sharper = if links == Links::RolledOut && straightness > 1.2 { 2.0 - straightness } else { 0.8 };
        let missed = [1.0 - half_loop, sharper - payload];
        let row = |k: usize| SEEN * std::f64::consts::SQRT_2 * (missed[0] * (k as f64).sin() + missed[1] * (k as f64).cos());
        (0..ROWS).map(row).collect()
    });
    assert_eq!(rows.named(), ["hysteresis"]);
}

#[test]
fn a_fit_that_stopped_short_goes_on_from_where_one_came_to_with_a_strained_number_more() {
    // A hard stop that is nine of its tolerances off is worth four nats, and a payload's fit had stopped some nats short without it.
    let effects = [("joint-offset", [0, 0]), ("payload", [0, 0])];
    let nothing = Seen::new(&effects[..1], |_: &[Option<&[f64]>], _| vec![0.0; ROWS]);
    let off = 9.0 * Coordinates::new(&nothing.robot, &nothing).all[0].spike.unwrap();
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [offset, loaded] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let row = |k: f64| k.sin() * (1.0 - loaded) + 0.054 * (2.0 * k).sin() * (1.0 - offset / off);
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [offset, payload] = effects.map(|(id, _)| coordinates.sited.iter().position(|sited| sited.effect.id == id).unwrap());
    let fitted = |effects: &[usize]| fitter.fit(effects, &fitter.nowhere(), None).unwrap().unwrap();
    let [whole, better] = [fitted(&[payload]), fitted(&[offset, payload])];
    let mut stopped = whole.clone();
    let [offset_at, payload_at] = [offset, payload].map(|effect| coordinates.of(effect).next().unwrap());
    stopped.u[payload_at] -= 0.1;
    stopped.residuals = fitter.exact(&stopped.u).unwrap();
    stopped.evidence -= 0.5 * (dot(&stopped.residuals, &stopped.residuals) - dot(&whole.residuals, &whole.residuals));
    assert!(better.evidence > stopped.evidence + 5.0 && better.u[offset_at] > 0.5 * off);
    let again = fitter.fitted_as(&stopped, &better).unwrap().unwrap();
    approx::assert_relative_eq!(again.evidence, whole.evidence, epsilon = 0.01);
}

#[test]
fn what_motion_left_at_its_most_does_not_keep_others_from_what_they_promise() {
    // A loop that had lagged by all of it as the recording began. A fit would have it lag by more, beyond which nothing changes.
    let rows = Seen::new(&[("hysteresis", [1, 0])], |numbers: &[Option<&[f64]>], _| {
        let [half_loop, lagged] = numbers[0].map_or([0.0; 2], |u| [u[0], (0.7 * u[3]).clamp(-1.0, 1.0)]);
        let row = |k: f64| k.sin() * (1.0 - half_loop.sqrt()) + k.cos() * (1.2 + lagged);
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitted = Fitter::new(&rows, &coordinates).fit(&[0], &[0.5, 0.0, 0.0, -1.0], None).unwrap().unwrap();
    approx::assert_relative_eq!(fitted.u[0], 1.0, epsilon = 0.01);
}

#[test]
fn friction_that_holds_all_it_can_does_not_keep_others_from_what_they_promise() {
    // A joint that is held more firmly than by all of its friction, and whose friction fades more slowly than the steepest slope has it.
    let rows = Seen::new(&[("link-coulomb-friction", [1, 0])], |numbers: &[Option<&[f64]>], _| {
        let [friction, slope, held] = numbers[0].map_or([0.0; 3], |u| [u[0], (0.7 * u[1]).exp().min(2.0), u[2].abs().min(1.0)]);
        let row = |k: f64| k.sin() * (1.0 - friction.abs().sqrt()) + k.cos() * (1.2 - held) + (2.0 * k).sin() * (2.2 - slope);
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitted = Fitter::new(&rows, &coordinates).fit(&[0], &[0.5, 0.0, 0.2, 0.0], None).unwrap().unwrap();
    approx::assert_relative_eq!(fitted.u[0], 1.0, epsilon = 0.01);
}

#[test]
fn what_a_cables_stiffness_does_is_looked_at_again_beside_what_creeps() {
    // What creeps is fourteen times what stretches, of which slopes without the creep know nothing.
    let effects = [("creep", [2, 0]), ("cable-stretch", [2, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [crept, soft] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let row = |k: f64| k.sin() * (1.0 - crept) + k.cos() * (1.0 + 13.0 * crept) * (0.03 - soft);
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [creep, stretch] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let nominal = fitter.at_nominal().unwrap().unwrap();
    let crept = fitter.taking(&nominal.u, &[creep], &vec![0.9; nominal.u.len()]);
    let fitted = fitter.fit(&[creep], &crept, Some(&nominal)).unwrap().unwrap();
    let softer = coordinates.of(stretch).next().unwrap();
    approx::assert_relative_eq!(fitted.u[softer], 0.03, epsilon = 1e-3);
    assert!(dot(&fitted.residuals, &fitted.residuals) < 0.1, "{}", dot(&fitted.residuals, &fitted.residuals));
}

#[test]
fn what_is_left_without_an_effect_goes_on_from_where_that_came_to() {
    // A payload whose fit had stopped short; with a rolling shutter, which does nothing, it had not.
    let effects = [("payload", [0, 0]), ("rolling-shutter", [0, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let loaded = numbers[0].map_or(0.0, |u| u[0]);
        (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * (k as f64).sin() * (1.0 - loaded)).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let [payload, shutter] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let [alone, both] = [&[payload][..], &[payload, shutter]].map(|effects| fitter.fit(effects, &nominal.u, None).unwrap().unwrap());
    let mut stopped = fitter.at(&[payload], alone.u.iter().map(|u| 0.9 * u).collect()).unwrap().unwrap();
    stopped.evidence = alone.evidence - 0.5 * dot(&stopped.residuals, &stopped.residuals);
    assert!(stopped.evidence < both.evidence - 3.0, "{} {}", stopped.evidence, both.evidence);
    outcome.keep(&stopped);
    let rest = fitter.rest(&outcome, &both, &[shutter]).unwrap().unwrap();
    approx::assert_relative_eq!(rest.evidence, alone.evidence, epsilon = 0.1);
}

#[test]
fn what_the_nominal_model_tolerates_of_an_effect_is_left_without_it() {
    // A hard stop that is off by little more than its tolerance, which settled links have the wrong way round.
    let effects = [("joint-offset", [0, 0]), ("payload", [0, 0])];
    let nothing = Seen::new(&effects[..1], |_: &[Option<&[f64]>], _| vec![0.0; ROWS]);
    let off = 1.2 * Coordinates::new(&nothing.robot, &nothing).all[0].spike.unwrap();
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [offset, loaded] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let turned = if links == Links::RolledOut { offset } else { -offset };
        tips(|k: f64| k.sin() * (1.0 - loaded) + 0.1 * (2.0 * k).sin() * (1.0 - turned / off))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let [offset, payload] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let stopped = fitter.fit(&[payload], &nominal.u, None).unwrap().unwrap();
    let mut u = stopped.u.clone();
    let offset_at = coordinates.of(offset).next().unwrap();
    u[offset_at] = off;
    let both = fitter.at(&[offset, payload], u).unwrap().unwrap();
    outcome.keep(&stopped);
    let rest = fitter.rest(&outcome, &both, &[offset]).unwrap().unwrap();
    approx::assert_relative_eq!(rest.u[offset_at], off);
}

#[test]
fn a_loop_is_followed_closely_though_it_leaves_nothing() {
    // Settled links have the damper of its joint the wrong way round, which noise would hide.
    let effects = [("hysteresis", [1, 0]), ("cable-damping", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [half_loop, damper] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let swings = if links == Links::RolledOut { damper } else { -damper };
        let row = |k: f64| k.sin() * (1.0 - half_loop) + k.cos() * (0.1 - swings);
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let best = fitter.fit(&[rows.effect(&coordinates, 0)], &nominal.u, None).unwrap().unwrap();
    assert!(!fitter.leftover(&best).remains());
    let closely = fitter.followed_closely(&mut outcome, best.clone()).unwrap();
    assert!(closely.evidence > best.evidence + 5.0, "{} {}", closely.evidence, best.evidence);
}
