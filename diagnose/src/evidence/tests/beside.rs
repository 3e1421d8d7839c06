//! What other recordings of a rig say of its tolerances.

use super::*;
use crate::evidence::numbers::spread::{Departures, Spread};

/// A coupling, and others that do nothing: an effect out of so many takes evidence.
const LIBRARY: [(&str, [usize; 2]); 9] = [
    ("cable-coupling", [0, 1]),
    ("cable-coupling", [0, 2]),
    ("cable-coupling", [1, 2]),
    ("pulley-radius", [0, 0]),
    ("pulley-radius", [1, 0]),
    ("pulley-radius", [2, 0]),
    ("joint-offset", [0, 0]),
    ("joint-offset", [1, 0]),
    ("joint-offset", [2, 0]),
];

/// What is found where a coupling is off by so many of the file's tolerances, by recordings that spread: the kinds of effects, and what it says of others.
fn found(tolerances: f64, spread: &Spread) -> (Vec<&'static str>, Departures) {
    let seen = |off: f64| Seen::new(&LIBRARY, moved_by(|u| u[0], off, f64::NEG_INFINITY));
    let nothing = seen(0.0);
    let stated = Coordinates::new(&nothing.robot, &nothing);
    let coupling = stated.of(nothing.effect(&stated, 0)).next().unwrap();
    let rows = seen(tolerances * stated.all[coupling].spike.unwrap());
    let coordinates = Coordinates::new(&rows.robot, &rows).with_spread(spread);
    let fitter = Fitter::new(&rows, &coordinates);
    let outcome = fitter.search(|| {}).unwrap().unwrap();
    let departures = fitter.departures(&outcome.best, &fitter.deviations(&outcome.best)).unwrap();
    (outcome.best.effects.iter().map(|&effect| coordinates.sited[effect].effect.id).collect(), departures)
}

#[test]
fn what_is_within_its_tolerance_stands_out_where_the_rig_is_exact() {
    let (effects, exact) = found(0.0, &Spread::default());
    assert!(effects.is_empty());
    let spread = Spread::of(&[&exact; 20]);
    // What is stated against twenty that are exact; nothing shows of the other two couplings.
    approx::assert_relative_eq!(spread.part("cable-coupling"), 21.0_f64.powf(-0.5) / 0.7, max_relative = 0.15);
    let off = 1.5;
    assert!(found(off, &Spread::default()).0.is_empty());
    assert_eq!(found(off, &spread).0, ["cable-coupling"]);
    assert!(found(0.2, &spread).0.is_empty());
}

#[test]
fn what_is_off_by_its_tolerance_in_every_recording_is_no_effect_beside_them() {
    let (effects, off) = found(1.5, &Spread::default());
    assert!(effects.is_empty());
    let spread = Spread::of(&[&off; 20]);
    assert_eq!(spread.part("cable-coupling"), 1.0);
    assert!(found(1.5, &spread).0.is_empty());
}

#[test]
fn a_number_that_an_effect_is_about_says_nothing_of_the_others() {
    let (effects, effect) = found(15.0, &Spread::default());
    assert_eq!(effects, ["cable-coupling"]);
    // Of what the other couplings are nothing shows.
    assert!(Spread::of(&[&effect; 20]).parts().all(|(_, part)| part > 0.999));
}
