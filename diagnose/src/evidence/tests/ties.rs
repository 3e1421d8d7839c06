//! Effects that do about the same, held against each other.

use super::*;
use crate::evidence::fit::slopes::Following;

#[test]
fn a_slack_joint_that_lies_on_one_side_is_found_where_an_offset_stands_in_for_it() {
    // Settled links know nothing of a slack of 0.8 slabs; an offset of half its width does most of it, and leaves no more than noise.
    let places = [("joint-offset", [0, 0]), ("backlash", [0, 0])];
    let robot = nominal::gold();
    let all = Sited::all(&robot);
    let sited = places.map(|(id, [joint, _])| *all.iter().find(|s| s.effect.id == id && s.place.first == joint).unwrap());
    let [half, width] = [0.5, 1.0].map(|part| part * sited[1].values(&[0.8])[0]);
    let rows = Seen::new(&places, |numbers: &[Option<&[f64]>], links| {
        let offset = numbers[0].map_or(0.0, |u| sited[0].values(u)[0]);
        let slack = numbers[1].filter(|_| links == Links::RolledOut).map_or(0.0, |u| sited[1].values(u)[0]);
        let [lies, turns] = [1.0 - offset / half - slack / width, 1.0 - slack / width];
        (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * ((k as f64).sin() * lies + (k as f64).cos() * 0.1 * turns)).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let effect = |n: usize| rows.effect(&coordinates, n);
    outcome.best = fitter.fit(&[effect(0)], &nominal.u, Some(&nominal)).unwrap().unwrap();
    assert!(!fitter.leftover(&outcome.best).remains());
    assert!(fitter.found_again(&mut outcome, &nominal).unwrap());
    assert_eq!(outcome.best.effects, [effect(1)]);
    approx::assert_relative_eq!(coordinates.values(effect(1), &outcome.best.u)[0], width, max_relative = 0.02);
}

#[test]
fn a_fit_that_stopped_short_is_not_taken_for_another_cause() {
    // A payload. Beside it settled links have the elbow's cable the wrong way round, and its fit stops where the cable is nominal; a rolling shutter
    // does nearly all of the payload's, and its fit does not stop.
    let effects = [("payload", [0, 0]), ("rolling-shutter", [0, 0]), ("cable-stretch", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [loaded, shutter, soft] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let followed = if links == Links::RolledOut || numbers[1].is_some() { soft } else { -soft };
        let row = |k: f64| k.sin() * (1.0 - loaded - shutter) + k.cos() * (0.05 - 1.5 * followed) + (2.0 * k).sin() * 0.05 * shutter;
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let effect = |n: usize| rows.effect(&coordinates, n);
    let [payload, shutter] = [0, 1].map(|n| fitter.fit(&[effect(n)], &nominal.u, None).unwrap().unwrap());
    assert!(
        payload.evidence > shutter.evidence - 10.0 && payload.evidence < shutter.evidence - 3.0,
        "{} {}",
        payload.evidence,
        shutter.evidence
    );
    outcome.keep(&payload);
    outcome.keep(&shutter);
    outcome.best = shutter;
    fitter.hold_against_rivals(&mut outcome).unwrap();
    assert_eq!(outcome.best.effects, payload.effects);
    assert!(outcome.best.evidence > payload.evidence + 5.0, "{} {}", outcome.best.evidence, payload.evidence);
}

#[test]
fn a_tie_that_stopped_short_beside_another_effect_is_not_taken_for_another_cause() {
    // A hard stop, and rotated cameras, which the library ties to it, both beside a payload. A rolling shutter, which it does not tie, is left as it is.
    let effects = [
        ("joint-offset", [0, 0]),
        ("camera-rotation", [0, 0]),
        ("rolling-shutter", [0, 0]),
        ("payload", [0, 0]),
        ("cable-stretch", [1, 0]),
    ];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [stop, rotated, shutter, loaded, soft] = [0, 1, 2, 3, 4].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let goes_on = links == Links::RolledOut || rotated > 0.5;
        let row = |k: f64| {
            let seen = k.sin() * (1.0 - stop - rotated - shutter) + (3.0 * k).sin() * (1.0 - loaded);
            seen + k.cos() * (0.05 - 1.5 * if goes_on { soft } else { -soft }) + (2.0 * k).sin() * 0.05 * rotated
        };
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let [stop, rotated, shutter] =
        [0, 1, 2].map(|n| fitter.fit(&[rows.effect(&coordinates, n), rows.effect(&coordinates, 3)], &nominal.u, None).unwrap().unwrap());
    assert!(stop.evidence > rotated.evidence - 10.0 && stop.evidence < rotated.evidence - 3.0, "{} {}", stop.evidence, rotated.evidence);
    [&stop, &rotated, &shutter].into_iter().for_each(|hypothesis| outcome.keep(hypothesis));
    outcome.best = rotated;
    fitter.hold_against_rivals(&mut outcome).unwrap();
    assert_eq!(outcome.best.effects, stop.effects);
    assert!(outcome.best.evidence > stop.evidence + 5.0, "{} {}", outcome.best.evidence, stop.evidence);
    assert_eq!(outcome.fitted[&shutter.effects].0.evidence, shutter.evidence);
}

#[test]
fn a_tie_is_held_against_what_was_found_where_the_nominal_model_hides_it() {
    // A hard stop, and creep does as well. Without either, a coupling of eight tolerances makes up for half of it, and there the hard stop has no slope.
    let effects = [("creep", [0, 0]), ("joint-offset", [0, 0]), ("cable-coupling", [0, 1])];
    let nothing = Seen::new(&effects[2..], |_: &[Option<&[f64]>], _| vec![0.0; ROWS]);
    let far = 8.0 * Coordinates::new(&nothing.robot, &nothing).all[0].spike.unwrap();
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [crept, offset, coupled] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let hidden = (coupled / far).clamp(0.0, 1.0);
        (0..ROWS).map(|k| SEEN * (k as f64).sin() * (1.0 - crept - 0.5 * hidden - offset * (1.0 - hidden))).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let effect = |n: usize| rows.effect(&coordinates, n);
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let creep = fitter.fit(&[effect(0)], &nominal.u, None).unwrap().unwrap();
    let promised = fitter.screen_some(&outcome.none, outcome.none.evidence, &[effect(1)]).unwrap();
    assert!(promised.iter().all(|candidate| candidate.evidence < creep.evidence - 20.0), "{promised:?}");
    outcome.keep(&creep);
    outcome.best = creep.clone();
    fitter.hold_against_ties(&mut outcome).unwrap();
    let (offset, _) = &outcome.fitted[&vec![effect(1)]];
    approx::assert_relative_eq!(offset.evidence, creep.evidence, epsilon = 3.0);
    // Once: a second search, of the same best, does not do so again.
    for (compared, is_held) in [(None, true), (Some(offset.effects.clone()), true), (Some(creep.effects.clone()), false)] {
        let (_, mut again) = fitter.begun().unwrap().unwrap();
        again.keep(&creep);
        (again.best, again.compared) = (creep.clone(), compared);
        fitter.decide(&mut again).unwrap();
        assert_eq!(again.fitted.contains_key(&offset.effects), is_held);
    }
}

#[test]
fn a_tie_that_stopped_far_behind_is_fitted_on() {
    // A hard stop, and creep does as well. Either needs a softer cable, at which the hard stop's fit did not arrive.
    let effects = [("creep", [0, 0]), ("joint-offset", [0, 0]), ("cable-stretch", [1, 0])];
    let seen = |numbers: &[Option<&[f64]>], follows: bool| {
        let [crept, offset, soft] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let soft = if follows { soft } else { 0.0 };
        tips(|k| k.sin() * (1.0 - crept - offset) + k.cos() * (0.05 - soft) * 3.5)
    };
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| seen(numbers, true));
    let deaf = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| seen(numbers, false));
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [creep, offset] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let found = fitter.fit(&[creep], &nominal.u, None).unwrap().unwrap();
    let stopped = Fitter::new(&deaf, &coordinates).fit(&[offset], &nominal.u, None).unwrap().unwrap();
    let behind = found.evidence - stopped.evidence;
    assert!(
        behind > 30.0 && behind < 0.4 * (found.evidence - outcome.none.evidence),
        "{behind} of {}",
        found.evidence - outcome.none.evidence
    );
    [&found, &stopped].into_iter().for_each(|hypothesis| outcome.keep(hypothesis));
    outcome.best = found;
    fitter.hold_against_ties(&mut outcome).unwrap();
    let (arrived, _) = &outcome.fitted[&vec![offset]];
    assert!(arrived.evidence > stopped.evidence + behind - 3.0, "{} {}", arrived.evidence, stopped.evidence);
}

#[test]
fn what_was_found_is_fitted_on_from_where_it_is_without_one_of_its_effects() {
    // A payload and a hard stop beside a softer cable, at which the fit of both did not arrive and that of the payload alone did.
    let effects = [("payload", [0, 0]), ("joint-offset", [0, 0]), ("cable-stretch", [1, 0])];
    let seen = |numbers: &[Option<&[f64]>], follows: bool| {
        let [loaded, offset, soft] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let soft = if follows { soft } else { 0.0 };
        tips(|k| k.sin() * (1.0 - loaded) + (2.0 * k).sin() * (0.5 - offset) + k.cos() * (0.05 - soft) * 3.5)
    };
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| seen(numbers, true));
    let deaf = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| seen(numbers, false));
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let both = [0, 1].map(|n| rows.effect(&coordinates, n));
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    let arrives = fitter.fit(&both, &nominal.u, None).unwrap().unwrap();
    let stopped = Fitter::new(&deaf, &coordinates).fit(&both, &nominal.u, None).unwrap().unwrap();
    assert!(stopped.evidence < arrives.evidence - 30.0, "{} {}", stopped.evidence, arrives.evidence);
    outcome.keep(&stopped);
    outcome.best = stopped;
    fitter.hold_against_ties(&mut outcome).unwrap();
    assert_eq!(outcome.best.effects, arrives.effects);
    assert!(outcome.best.evidence > arrives.evidence - 3.0, "{} {}", outcome.best.evidence, arrives.evidence);
}

#[test]
fn a_tie_is_not_held_against_what_was_found_beside_what_is_the_same() {
    // A tool's length and a rotation of the cameras, in whose place the offset of the insertion, which is the tool's length, would do as well.
    let effects = [("camera-rotation", [0, 0]), ("tool-length", [0, 0]), ("joint-offset", [2, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [rotated, longer, offset] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        tips(|k| k.sin() * (1.0 - longer - offset) + k.cos() * (1.0 - rotated - offset))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [rotation, length, offset] = [0, 1, 2].map(|n| rows.effect(&coordinates, n));
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    for effects in [vec![rotation], vec![length], vec![offset], vec![rotation.min(length), rotation.max(length)]] {
        outcome.keep(&fitter.fit(&effects, &nominal.u, None).unwrap().unwrap());
        outcome.best = outcome.fitted[&effects].0.clone();
    }
    fitter.hold_against_ties(&mut outcome).unwrap();
    let twice = outcome.fitted.keys().find(|effects| effects.contains(&length) && effects.contains(&offset));
    assert_eq!(twice, None);
}

#[test]
fn nor_does_it_stand_in_for_another_effect_beside_what_is_the_same() {
    // Slip of the insertion, which may stand in for an offset, beside a tool's length.
    let effects = [("cable-slip", [2, 0]), ("tool-length", [0, 0]), ("joint-offset", [2, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [slipped, longer, offset] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        tips(|k| k.sin() * (1.0 - longer - offset) + k.cos() * (1.0 - slipped))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [slip, length, offset] = [0, 1, 2].map(|n| rows.effect(&coordinates, n));
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    outcome.best = fitter.fit(&[slip, length], &nominal.u, None).unwrap().unwrap();
    fitter.found_again(&mut outcome, &nominal).unwrap();
    let twice = outcome.fitted.keys().find(|effects| effects.contains(&length) && effects.contains(&offset));
    assert_eq!(twice, None);
}

#[test]
fn what_stands_in_for_an_effect_that_is_beyond_its_scatter_is_not_lost_in_its_own() {
    // A slack does nearly what the offset does, which is small; of some sizes one is beyond its scatter alone.
    let is_kept_for_the_other = |off: f64| {
        let residuals = move |numbers: &[Option<&[f64]>], _: Links| {
            let [offset, slack] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
            tips(|k| k.sin() * (off - offset - 0.95 * slack) - 0.3 * slack * (2.0 * k).sin())
        };
        let rows = Seen::new(&[("joint-offset", [2, 0]), ("backlash", [2, 0])], residuals);
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let outcome = fitter.search(|| {}).unwrap().unwrap();
        let is_lost = |n: usize| {
            let (hypothesis, _) = outcome.fitted.get(&vec![rows.effect(&coordinates, n)])?;
            Some(fitter.lost_in_scatter(&outcome, hypothesis).is_some())
        };
        [is_lost(0), is_lost(1)] == [Some(false), Some(true)]
    };
    assert!((1..60).any(|step| is_kept_for_the_other(0.01 * f64::from(step))));
}

#[test]
fn which_of_two_that_leave_the_same_is_likelier_does_not_go_by_where_joints_stick() {
    // An offset, and a slack that lies on one side all the time. Rows that stick go by the slack's size, each in its own way, and fast.
    let likelier = |rows_stick: f64, phase: f64| {
        let rows = Seen::new(&[("backlash", [2, 0]), ("joint-offset", [2, 0])], move |numbers: &[Option<&[f64]>], links| {
            let [slack, offset] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
            let mut seen = tips(|k| k.sin() * (1.0 - slack - offset));
            let stuck = |k: usize| (phase + (100.0 + 40.0 * k as f64) * slack).sin();
            seen.iter_mut()
                .take(STUCK)
                .enumerate()
                .filter(|_| links == Links::RolledOut)
                .for_each(|(k, row)| *row += rows_stick * stuck(k));
            seen
        });
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let [slack, offset] = [0, 1].map(|n| vec![rows.effect(&coordinates, n)]);
        let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
        for effects in [&slack, &offset] {
            outcome.best = fitter.fit(effects, &nominal.u, None).unwrap().unwrap();
            outcome.keep(&outcome.best.clone());
        }
        let closely = [&slack, &offset].map(|effects| {
            let start = &outcome.fitted[effects].0.u;
            fitter.fit_with(effects, start, None, Following::AllRolledOut).unwrap().unwrap().evidence
        });
        fitter.hold_against_rivals(&mut outcome).unwrap();
        let levelled = [&slack, &offset].map(|effects| outcome.fitted[effects].0.evidence);
        [closely, levelled].map(|[slack, offset]| slack - offset)
    };
    let [_, smooth] = likelier(0.0, 0.0);
    for rows_stick in [0.1, 0.3] {
        let off = (0..12).map(|phase| likelier(rows_stick, f64::from(phase)).map(|by| (by - smooth).abs()));
        let [closely, levelled] = off.fold([0.0_f64; 2], |most, off| [0, 1].map(|k| most[k].max(off[k])));
        assert!(closely > 0.25 && levelled < 0.5 * closely, "{rows_stick}: {closely} closely, {levelled} levelled");
    }
}
