//! The search on recordings made of nothing but what is tested.

use std::sync::atomic::{AtomicUsize, Ordering};

use raven::Result;
use raven::effects::{Channel, Sited};
use raven::robot::{Robot, nominal};

use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::coordinates::Coordinates;
use crate::evidence::recorded::rows::{Links, Observed};
use crate::evidence::recorded::settings::Setting;

mod beside;
mod lost;
mod small;
mod ties;
mod told;

/// Tips that see some effects at their places, and nothing else that could be off.
#[derive(Clone)]
pub(crate) struct Seen<R> {
    pub(crate) robot: Robot,
    effects: Vec<(&'static str, [usize; 2])>,
    /// Of the effects' numbers in units of their slabs, `None` of one that is not there, and how links are taken.
    residuals: R,
}

const ROWS: usize = 300;
/// Rows that stick otherwise, and by how many deviations.
const STUCK: usize = 8;
const STICKS: f64 = 2.0;
/// Deviations by which tips are moved by 1, in the mean.
const SEEN: f64 = 3.0;

/// Tips that are `moved`, which one effect does as `moves` says. Rolled-out links stick elsewhere where it moves them by less than
/// `sticks_below`; settled ones know nothing of it.
fn moved_by(moves: fn(&[f64]) -> f64, moved: f64, sticks_below: f64) -> impl Fn(&[Option<&[f64]>], Links) -> Vec<f64> + Sync {
    move |numbers, links| {
        let so_far = numbers[0].map_or(0.0, moves);
        let sticks = links == Links::RolledOut && so_far < sticks_below;
        let row = |k: usize| {
            let off = SEEN * (k as f64).sin() * std::f64::consts::SQRT_2 * (moved - so_far);
            off + if sticks && k < STUCK { STICKS } else { 0.0 }
        };
        (0..ROWS).map(row).collect()
    }
}

/// A hypothesis of which nothing is known but its evidence [nat].
pub(crate) fn fitted(effects: Vec<usize>, evidence: f64) -> Hypothesis {
    let covariance = nalgebra::DMatrix::zeros(0, 0);
    Hypothesis {
        effects,
        u: Vec::new(),
        free: Vec::new(),
        covariance,
        cost: -evidence,
        evidence,
        raised: 0.0,
        is_close: false,
        residuals: Vec::new(),
        columns: Vec::new(),
    }
}

/// Tips that are off as a row of sines says by its number; by one of them they are off by [`SEEN`] in the mean.
pub(crate) fn tips(row: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * row(k as f64)).collect()
}

impl<R: Fn(&[Option<&[f64]>], Links) -> Vec<f64> + Sync> Seen<R> {
    pub(crate) fn new(effects: &[(&'static str, [usize; 2])], residuals: R) -> Self {
        Self { robot: nominal::gold(), effects: effects.to_vec(), residuals }
    }

    fn number(&self, sited: &Sited) -> Option<usize> {
        self.effects.iter().position(|&(id, place)| sited.effect.id == id && [sited.place.first, sited.place.second] == place)
    }

    /// Where the coordinates have the effect of a number.
    pub(crate) fn effect(&self, coordinates: &Coordinates, number: usize) -> usize {
        coordinates.sited.iter().position(|sited| self.number(sited) == Some(number)).unwrap()
    }

    /// The effects that a search names, by the alphabet.
    fn named(&self) -> Vec<&'static str> {
        let coordinates = Coordinates::new(&self.robot, self);
        let outcome = Fitter::new(self, &coordinates).search(|| {}).unwrap().unwrap();
        let mut named: Vec<_> = outcome.best.effects.iter().map(|&effect| coordinates.sited[effect].effect.id).collect();
        named.sort_unstable();
        named
    }

    /// Whether the effect is beyond its scatter where it was found, alone, and its first number in deviations.
    fn is_beyond_scatter(&self) -> (bool, f64) {
        let coordinates = Coordinates::new(&self.robot, self);
        assert_eq!(coordinates.sited.len(), 1);
        let fitter = Fitter::new(self, &coordinates);
        let outcome = fitter.search(|| {}).unwrap().unwrap();
        let point = fitter.at_nominal().unwrap().unwrap();
        let candidate = fitter.screen(&point, 0.0).unwrap().remove(0);
        let found = fitter.fit(&candidate.effects, &candidate.start, None).unwrap().unwrap();
        (fitter.lost_in_scatter(&outcome, &found).is_none(), found.u[0].abs() / fitter.deviations(&found)[0])
    }
}

impl<R: Fn(&[Option<&[f64]>], Links) -> Vec<f64> + Sync> Observed for Seen<R> {
    fn robot(&self) -> &Robot {
        &self.robot
    }

    fn recordings(&self) -> usize {
        1
    }

    fn tip_rows(&self) -> usize {
        ROWS
    }

    fn torque_rows(&self) -> usize {
        0
    }

    fn tip_block(&self) -> usize {
        90
    }

    fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
        self.number(sited).is_none().then_some("it is not there")
    }

    fn residuals(&self, settings: &[Setting], links: Links, _: &[Channel]) -> Result<Vec<f64>> {
        let mut numbers = vec![None; self.effects.len()];
        settings.iter().for_each(|(sited, u)| self.number(sited).into_iter().for_each(|n| numbers[n] = Some(u.as_slice())));
        Ok((self.residuals)(&numbers, links))
    }
}

#[test]
fn what_the_files_tolerances_bear_at_any_usual_size_is_not_named() {
    let named = |hard_stop: f64| {
        let mut rows = Seen::new(&[("joint-offset", [2, 0])], moved_by(|u| u[0], 1.2, f64::NEG_INFINITY));
        rows.robot.tolerances.hard_stop = hard_stop;
        rows.named()
    };
    assert_eq!(named(1e-4), ["joint-offset"]);
    // Of the insertion a third of it in metres, and twenty millimetres are eight times the usual size of an offset.
    assert!(named(0.06).is_empty());
}

#[test]
fn no_effect_is_looked_for_beside_itself_or_what_is_the_same() {
    // A tool's length is the offset of the insertion.
    let effects = [("tool-length", [0, 0]), ("joint-offset", [2, 0]), ("cable-coupling", [0, 1])];
    let rows = Seen::new(&effects, moved_by(|u| u[0], 1.2, f64::NEG_INFINITY));
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [length, offset, coupling] = [0, 1, 2].map(|n| rows.effect(&coordinates, n));
    let found = fitter.fit(&[length], &fitter.nowhere(), None).unwrap().unwrap();
    let beside = |hypothesis| {
        let candidates = fitter.screen_some(hypothesis, 0.0, &[length, offset, coupling]).unwrap();
        candidates.into_iter().map(|candidate| candidate.effects).collect::<std::collections::BTreeSet<_>>()
    };
    let sorted = |mut effects: Vec<usize>| {
        effects.sort_unstable();
        effects
    };
    assert_eq!(beside(&found), [sorted(vec![length, coupling])].into());
    assert_eq!(beside(&fitter.at_nominal().unwrap().unwrap()), [vec![length], vec![offset], vec![coupling]].into());
}

#[test]
fn where_joints_happen_to_stick_is_no_evidence_for_an_effect() {
    // The tolerance pulls the nominal model a little further back than an effect, and there the elbow sticks.
    let sticks_below = 1.198;
    let rows = Seen::new(&[("cable-coupling", [0, 1])], moved_by(|u| u[0], 1.2, sticks_below));
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let outcome = fitter.search(|| {}).unwrap().unwrap();
    let (coupled, _) = &outcome.fitted[&vec![0]];
    let strain = 0.5 * (coupled.u[0] / coordinates.all[0].spike.unwrap()).powi(2);
    let gained = coupled.evidence - outcome.none.evidence;
    assert!(coupled.u[0] > sticks_below, "{:?}", coupled.u);
    assert!(gained < strain, "{gained} nats for a strain of {strain}");
}

#[test]
fn a_size_that_trades_with_its_shape_is_beyond_scatter() {
    // Of creep that has only begun nothing shows but the ratio over the time.
    let creeping = moved_by(|u| u[0] * (-0.7 * u[1]).exp(), 1.0, f64::NEG_INFINITY);
    let (is_beyond, deviations) = Seen::new(&[("creep", [0, 0])], creeping).is_beyond_scatter();
    assert!(is_beyond && deviations < 3.0, "{deviations}");
}

#[test]
fn a_size_that_does_ever_less_is_beyond_scatter() {
    // Hardly anything is known of the size but that it is not small.
    let saturates = moved_by(|u| 0.1 * (1.0 - (-5.0 * u[0]).exp()), 0.095, f64::NEG_INFINITY);
    let (is_beyond, deviations) = Seen::new(&[("payload", [0, 0])], saturates).is_beyond_scatter();
    assert!(is_beyond && deviations < 1.9, "{deviations}");
}

#[test]
fn a_shape_that_nothing_is_known_of_is_no_effect() {
    for (moved, is_there) in [(0.5, true), (0.0, false)] {
        let stiffened = moved_by(|u| (-2.0 * u[0]).exp(), moved, f64::NEG_INFINITY);
        let rows = Seen::new(&[("cable-stiffening", [0, 0])], stiffened);
        assert_eq!(rows.is_beyond_scatter().0, is_there, "moved by {moved}");
    }
}

#[test]
fn a_joint_that_does_not_do_what_slopes_promise_does_not_keep_others_from_theirs() {
    // A hard stop of the shoulder, and an elbow that settled links follow softly while rolled-out ones stick.
    let effects = [("joint-offset", [0, 0]), ("cable-stretch", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [offset, soft] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let missed = [1.0 - offset, if links == Links::RolledOut { 0.5 + 100.0 * soft.abs() } else { 0.5 - soft }];
        let row = |k: usize| SEEN * std::f64::consts::SQRT_2 * (missed[0] * (k as f64).sin() + missed[1] * (k as f64).cos());
        (0..ROWS).map(row).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let effect = |n: usize| rows.effect(&coordinates, n);
    let fitted = fitter.fit(&[effect(1)], &fitter.nowhere(), None).unwrap().unwrap();
    let [offset, soft] = [0, 1].map(|n| fitted.u[coordinates.sizes(effect(n)).next().unwrap()]);
    // The hard stop is known to a tolerance.
    assert!(offset > 0.8 && soft.abs() < 1e-3, "{offset} {soft}");
}

#[test]
fn where_friction_held_a_joint_is_found_once_it_is_known_to_hold() {
    // At first none of it holds, and where it does has no slope.
    let places = [("link-coulomb-friction", [1, 0])];
    let rows = Seen::new(&places, |numbers: &[Option<&[f64]>], _| {
        let [factor, held, lag] = [0, 2, 3].map(|n| numbers[0].map_or(0.0, |u| u[n]));
        let missed = [1.0 - factor, 0.9 - held, 0.8 - held * lag];
        let row = |k: f64| k.sin() * missed[0] + (2.0 * k).sin() * missed[1] + k.cos() * missed[2];
        tips(row)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let nominal = fitter.at_nominal().unwrap().unwrap();
    let fitted = fitter.fit(&[0], &nominal.u, Some(&nominal)).unwrap().unwrap();
    let left = fitted.residuals.iter().map(|r| r * r).sum::<f64>();
    assert!(fitted.u[3] > 0.7 && left < 10.0, "{left} at {:?}", fitted.u);
}

#[test]
fn what_slopes_of_settled_links_leave_out_is_no_evidence_for_an_effect() {
    // A tolerance of the cable's stiffness does all of it where links are rolled out, and nothing where they are settled; a coupling of eight of its
    // own does either way.
    let effects = [("cable-stretch", [1, 0]), ("cable-coupling", [0, 1])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [soft, coupled] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let moved = 0.066 * coupled + if links == Links::RolledOut { 1.5 * soft } else { 0.0 };
        (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * (k as f64).sin() * (0.105 - moved)).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let outcome = Fitter::new(&rows, &coordinates).search(|| {}).unwrap().unwrap();
    assert!(outcome.best.effects.is_empty(), "{:?}", outcome.best.effects);
    let missed = outcome.none.residuals.iter().map(|r| r * r).sum::<f64>();
    assert!(missed < 0.1 * (SEEN * 0.105).powi(2) * ROWS as f64, "{missed}");
}

#[test]
fn what_slopes_of_settled_links_leave_out_does_not_hide_an_effect() {
    // As above, and a hard stop is off. With the coupling that is one effect too many, and alone it was far behind.
    let effects = [("cable-stretch", [1, 0]), ("cable-coupling", [0, 1]), ("joint-offset", [0, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [soft, coupled, offset] = [0, 1, 2].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let moved = 0.066 * coupled + if links == Links::RolledOut { 1.5 * soft } else { 0.0 };
        let row = |k: usize| (k as f64).sin() * (0.12 - moved) + (k as f64).cos() * 0.085 * (1.0 - offset);
        (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * row(k)).collect()
    });
    assert_eq!(rows.named(), ["joint-offset"]);
}

#[test]
fn a_damper_that_settled_links_have_the_wrong_way_round_is_found() {
    let rows = Seen::new(&[("cable-damping", [1, 0])], |numbers: &[Option<&[f64]>], links| {
        let so_far = numbers[0].map_or(0.0, |u| u[0]);
        let shows = if links == Links::RolledOut { so_far } else { -so_far };
        (0..ROWS).map(|k| SEEN * std::f64::consts::SQRT_2 * (k as f64).sin() * (-1.1 - shows)).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let nominal = fitter.at_nominal().unwrap().unwrap();
    // The nominal model's own slope is that of settled links.
    for like in [None, Some(&nominal)] {
        let fitted = fitter.fit(&[0], &nominal.u, like).unwrap().unwrap();
        approx::assert_relative_eq!(fitted.u[0], -1.1, epsilon = 0.01);
    }
    let none = fitter.fit(&[], &nominal.u, None).unwrap().unwrap();
    let hopeful = fitter.screen(&nominal, none.evidence).unwrap().remove(0);
    assert!(hopeful.start[0] < -1.0, "{:?}", hopeful.start);
}

#[test]
fn a_fit_does_not_end_on_slopes_from_where_it_began() {
    // How far a stretch moves the tips goes by friction that another number brings, less than makes slopes be taken anew on the way.
    let effects = [("cable-stretch", [1, 0]), ("link-coulomb-friction", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [soft, rubs] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let row = |k: f64| k.sin() * (0.12 - rubs) + k.cos() * (0.03 - soft * (1.0 - rubs / 0.1));
        (0..ROWS).map(|k| 10.0 * SEEN * std::f64::consts::SQRT_2 * row(k as f64)).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let fitted = fitter.fit(&[], &fitter.nowhere(), None).unwrap().unwrap();
    let again = fitter.fit(&[], &fitted.u, None).unwrap().unwrap();
    assert!(again.evidence - fitted.evidence < 1.0, "{} then {}", fitted.evidence, again.evidence);
}

#[test]
fn a_large_effect_is_found_of_which_slopes_say_less_than_of_others() {
    // Beside a payload settled links have a rolling shutter mostly wrong: by slopes alone others, which do a little of the same, are ahead of
    // it by more than what the screen errs by where nothing else is left.
    let alike = [("lens-distortion", [0, 0]), ("stereo-desync", [0, 0]), ("load-dependent-friction", [0, 0])];
    let effects = [[("payload", [0, 0]), ("rolling-shutter", [0, 0])].as_slice(), &alike].concat();
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let number = |n: usize| numbers[n].map_or(0.0, |u| u[0]);
        let (shutter, otherwise) = if links == Links::RolledOut { (number(1), 0.0) } else { (0.15 * number(1), number(1)) };
        let row = |k: f64| {
            let others = (2..5).map(|n| number(n) * (0.22 * k.cos() + ((n as f64) * k).cos())).sum::<f64>();
            3.0 * k.sin() * (1.0 - number(0)) + k.cos() * (1.0 - shutter) - (2.0 * k).sin() * otherwise - others
        };
        tips(row)
    });
    assert_eq!(rows.named(), ["payload", "rolling-shutter"]);
}

#[test]
fn nothing_is_looked_for_beside_an_effect_that_accounts_for_hardly_any_of_very_much() {
    let effects = [("payload", [0, 0]), ("rolling-shutter", [0, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], _| {
        let [loaded, shutter] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        tips(|k: f64| 100.0 * k.cos() + 20.0 * k.sin() * (1.0 - loaded) + 15.0 * (2.0 * k).sin() * (1.0 - shutter))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let outcome = Fitter::new(&rows, &coordinates).search(|| {}).unwrap().unwrap();
    assert_eq!(outcome.best.effects.len(), 1);
    assert!(outcome.fitted.keys().all(|effects| effects.len() < 2));
}

#[test]
fn a_shape_is_found_by_a_first_look_without_all_slopes_at_every_start() {
    for force in [-1.0, 0.0, 1.0] {
        // Slip of one slab, whose force says how.
        let evaluated = AtomicUsize::new(0);
        let rows = Seen::new(&[("cable-slip", [1, 0])], |numbers: &[Option<&[f64]>], _| {
            evaluated.fetch_add(1, Ordering::Relaxed);
            let (found, size) = numbers[0].map_or((0.0, 0.0), |u| (u[0], u[1]));
            tips(|k| (k * (2.0 + force)).sin() - size * (k * (2.0 + found)).sin())
        });
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let point = fitter.at_nominal().unwrap().unwrap();
        let starts = fitter.starts(0, &point.u).len();
        evaluated.store(0, Ordering::Relaxed);
        let candidate = fitter.screen(&point, 0.0).unwrap().remove(0);
        approx::assert_relative_eq!(candidate.start[0], force, epsilon = 1e-3);
        // Each start once, and its four slopes at few.
        assert!(evaluated.into_inner() < 3 * starts);
    }
}

#[test]
fn slopes_to_one_side_are_those_to_both_where_nothing_bends() {
    let rows = Seen::new(&[("cable-slip", [1, 0])], |numbers: &[Option<&[f64]>], _| {
        let slip = numbers[0].map_or(0.0, |u| u.iter().zip([0.3, 1.0, -0.2, 0.5]).map(|(u, by)| u * by).sum::<f64>());
        tips(|k| k.cos() - slip * k.sin())
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let all: Vec<usize> = (0..coordinates.all.len()).collect();
    let u = fitter.placing(&fitter.nowhere(), 0, &[0.5, 1.0, -0.5, 0.3]);
    let here = rows.residuals(&coordinates.settings(&u), Links::Settled, &[Channel::Tip]).unwrap();
    let both = fitter.slopes(&u, &all, Links::Settled).unwrap();
    let one_side = fitter.slopes_beside(&u, &here, &all, Links::Settled).unwrap();
    for (one, both) in one_side.iter().zip(&both) {
        assert!(one.iter().any(|slope| slope.abs() > 0.1));
        one.iter().zip(both.iter()).for_each(|(one, both)| approx::assert_abs_diff_eq!(one, both, epsilon = 1e-9));
    }
}

#[test]
fn what_was_lost_in_scatter_is_not_added_again() {
    // Beside a payload a joint rubs under load, at times with its motion.
    const WAYS: [f64; 4] = [1.0, -1.0, 1.0, 1.0];
    let rows = Seen::new(&[("payload", [0, 0]), ("load-dependent-friction", [1, 0])], |numbers: &[Option<&[f64]>], _| {
        let [loaded, rubs] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let row = |k: usize| 3.0 * (2.0 * k as f64).sin() * (1.0 - loaded) + (k as f64).cos() * (1.2 * WAYS[(k / 90).min(3)] - 2.0 * rubs);
        (0..ROWS).map(row).collect()
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let [payload, rubs] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let (nominal, mut outcome) = fitter.begun().unwrap().unwrap();
    fitter.add_and_shed(&mut outcome, &nominal, || {}).unwrap();
    let mut both = vec![payload, rubs];
    both.sort_unstable();
    assert!(outcome.fitted[&both].0.evidence > outcome.fitted[&vec![payload]].0.evidence + 6.0);
    assert!(outcome.shed.contains(&both));
    assert_eq!(outcome.best.effects, [payload]);
}
