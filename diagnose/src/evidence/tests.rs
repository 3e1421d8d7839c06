//! The search on recordings made of nothing but what is tested.

use raven::Result;
use raven::effects::{Channel, Sited};
use raven::robot::{Robot, nominal};

use super::coordinates::Coordinates;
use super::fit::Fitter;
use super::rows::{Links, Observed, Setting};

/// Tips that see one effect at one place, and nothing else that could be off.
struct Seen {
    robot: Robot,
    id: &'static str,
    place: [usize; 2],
    /// How far tips are moved by what, by its numbers in units of their slabs.
    moves: fn(&[f64]) -> f64,
    /// How far they are.
    moved: f64,
    /// Rolled-out links stick elsewhere where the effect moves tips by less; settled ones know nothing of it.
    sticks_below: f64,
}

const ROWS: usize = 300;
/// Rows that stick otherwise, and by how many deviations.
const STUCK: usize = 8;
const STICKS: f64 = 2.0;
/// Deviations by which tips are moved by 1, in the mean.
const SEEN: f64 = 3.0;

impl Seen {
    fn new(id: &'static str, place: [usize; 2], moves: fn(&[f64]) -> f64, moved: f64) -> Self {
        Self { robot: nominal::gold(), id, place, moves, moved, sticks_below: f64::NEG_INFINITY }
    }

    fn is_seen(&self, sited: &Sited) -> bool {
        sited.effect.id == self.id && [sited.place.first, sited.place.second] == self.place
    }

    /// Whether the effect is beyond its scatter where it was found, alone, and its first number in deviations.
    fn is_beyond_scatter(&self) -> (bool, f64) {
        let coordinates = Coordinates::new(&self.robot, self);
        assert_eq!(coordinates.sited.len(), 1);
        let fitter = Fitter { rows: self, coordinates: &coordinates };
        let outcome = fitter.search(|| {}).unwrap().unwrap();
        let point = fitter.at_nominal().unwrap().unwrap();
        let candidate = fitter.screen(&point, 0.0).unwrap().remove(0);
        let found = fitter.fit(&candidate.effects, &candidate.start, None).unwrap().unwrap();
        (fitter.lost_in_scatter(&outcome, &found).is_none(), found.u[0].abs() / fitter.deviations(&found)[0])
    }
}

impl Observed for Seen {
    fn robot(&self) -> &Robot {
        &self.robot
    }

    fn tip_rows(&self) -> usize {
        ROWS
    }

    fn torque_rows(&self) -> usize {
        0
    }

    fn has_cameras(&self) -> bool {
        true
    }

    fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
        (!self.is_seen(sited)).then_some("it is not there")
    }

    fn residuals(&self, settings: &[Setting], links: Links, _: &[Channel]) -> Result<Vec<f64>> {
        let moved = settings.iter().find(|(sited, _)| self.is_seen(sited)).map_or(0.0, |(_, u)| (self.moves)(u));
        let sticks = links == Links::RolledOut && moved < self.sticks_below;
        let row = |k: usize| {
            let off = SEEN * (k as f64).sin() * std::f64::consts::SQRT_2 * (self.moved - moved);
            off + if sticks && k < STUCK { STICKS } else { 0.0 }
        };
        Ok((0..ROWS).map(row).collect())
    }
}

#[test]
fn where_joints_happen_to_stick_is_no_evidence_for_an_effect() {
    // The tolerance pulls the nominal model a little further back than an effect, and there the elbow sticks.
    let rows = Seen { sticks_below: 1.198, ..Seen::new("cable-coupling", [0, 1], |u| u[0], 1.2) };
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter { rows: &rows, coordinates: &coordinates };
    let outcome = fitter.search(|| {}).unwrap().unwrap();
    let (coupled, _) = &outcome.fitted[&vec![0]];
    let strain = 0.5 * (coupled.u[0] / coordinates.all[0].spike.unwrap()).powi(2);
    let gained = coupled.evidence - outcome.none.evidence;
    assert!(coupled.u[0] > rows.sticks_below, "{:?}", coupled.u);
    assert!(gained < strain, "{gained} nats for a strain of {strain}");
}

#[test]
fn a_size_that_trades_with_its_shape_is_beyond_scatter() {
    // Of creep that has only begun nothing shows but the ratio over the time.
    let (is_beyond, deviations) = Seen::new("creep", [0, 0], |u| u[0] * (-0.7 * u[1]).exp(), 1.0).is_beyond_scatter();
    assert!(is_beyond && deviations < 3.0, "{deviations}");
}

#[test]
fn a_shape_that_nothing_is_known_of_is_no_effect() {
    for (moved, is_there) in [(0.5, true), (0.0, false)] {
        let stiffened = Seen::new("cable-stiffening", [0, 0], |u| (-2.0 * u[0]).exp(), moved);
        assert_eq!(stiffened.is_beyond_scatter().0, is_there, "moved by {moved}");
    }
}

/// Tips that see a hard stop of the shoulder, and an elbow that settled links follow softly while rolled-out ones stick.
struct Sticking {
    robot: Robot,
}

impl Sticking {
    fn number(sited: &Sited) -> Option<usize> {
        match (sited.effect.id, sited.place.first) {
            ("joint-offset", 0) => Some(0),
            ("cable-stretch", 1) => Some(1),
            _ => None,
        }
    }
}

impl Observed for Sticking {
    fn robot(&self) -> &Robot {
        &self.robot
    }

    fn tip_rows(&self) -> usize {
        ROWS
    }

    fn torque_rows(&self) -> usize {
        0
    }

    fn has_cameras(&self) -> bool {
        true
    }

    fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
        Self::number(sited).is_none().then_some("it is not there")
    }

    fn residuals(&self, settings: &[Setting], links: Links, _: &[Channel]) -> Result<Vec<f64>> {
        let mut u = [0.0; 2];
        settings.iter().for_each(|(sited, values)| Self::number(sited).into_iter().for_each(|n| u[n] = values[0]));
        let [offset, soft] = u;
        let missed = [1.0 - offset, if links == Links::RolledOut { 0.5 + 100.0 * soft.abs() } else { 0.5 - soft }];
        let row = |k: usize| SEEN * std::f64::consts::SQRT_2 * (missed[0] * (k as f64).sin() + missed[1] * (k as f64).cos());
        Ok((0..ROWS).map(row).collect())
    }
}

#[test]
fn a_joint_that_does_not_do_what_slopes_promise_does_not_keep_others_from_theirs() {
    let rows = Sticking { robot: nominal::gold() };
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter { rows: &rows, coordinates: &coordinates };
    let effect = |n: usize| (0..2).find(|&effect| Sticking::number(&coordinates.sited[effect]) == Some(n)).unwrap();
    let fitted = fitter.fit(&[effect(1)], &fitter.nowhere(), None).unwrap().unwrap();
    let [offset, soft] = [0, 1].map(|n| fitted.u[coordinates.sizes(effect(n)).next().unwrap()]);
    // The hard stop is known to a tolerance.
    assert!(offset > 0.8 && soft.abs() < 1e-3, "{offset} {soft}");
}
