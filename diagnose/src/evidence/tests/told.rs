//! Fits that are told which effects there are.

use super::*;

#[test]
fn what_others_came_to_before_an_effect_was_told_is_not_lost() {
    // A shutter does half of what a payload could do alone; slopes there say the contrary of what it does.
    let effects = [("payload", [0, 0]), ("rolling-shutter", [0, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [loaded, shutter] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let loads = if links == Links::Settled && (loaded - 0.5).abs() < 0.2 { -loaded } else { loaded };
        let lacks_load = (1.0 - 4.0 * loaded).max(0.0);
        tips(|k: f64| k.sin() * (1.0 - loads - shutter) + 0.04 * k.cos() * (0.5 - shutter) + (2.0 * k).sin() * lacks_load)
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let [payload, shutter] = [0, 1].map(|n| rows.effect(&coordinates, n));
    let (_, gain) = Fitter::new(&rows, &coordinates).told(&[payload, shutter]).unwrap().unwrap();
    assert!(gain < 5.0, "{gain}");
}

#[test]
fn what_a_fit_by_settled_links_stops_short_of_is_no_gain_of_what_is_told() {
    // Friction within its tolerance does what a payload would; settled links have it the wrong way round.
    let effects = [("payload", [0, 0]), ("link-coulomb-friction", [1, 0])];
    let rows = Seen::new(&effects, |numbers: &[Option<&[f64]>], links| {
        let [loaded, rubs] = [0, 1].map(|n| numbers[n].map_or(0.0, |u| u[0]));
        let rubs = if links == Links::RolledOut { rubs } else { -rubs };
        tips(|k| k.sin() * (0.1 - rubs - loaded))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let fitter = Fitter::new(&rows, &coordinates);
    let payload = rows.effect(&coordinates, 0);
    let none = fitter.fit(&[], &fitter.nowhere(), None).unwrap().unwrap();
    let told = fitter.fit(&[payload], &fitter.nowhere(), Some(&none)).unwrap().unwrap();
    assert!(told.evidence - none.evidence > 3.0, "{} and {}", told.evidence, none.evidence);
    let (_, gain) = fitter.told(&[payload]).unwrap().unwrap();
    assert!(gain < 0.5, "{gain}");
}

#[test]
fn what_is_told_is_looked_for_from_every_start() {
    // A cable that is straight but for a stiffening of one and a half slabs, and elsewhere nothing leads there.
    let rows = Seen::new(&[("cable-stiffening", [1, 0])], |numbers: &[Option<&[f64]>], _| {
        let found = numbers[0].map_or(0.0, |u| (-((u[0] - 1.4) / 0.2).powi(2)).exp());
        tips(|k| k.sin() * (1.0 - found))
    });
    let coordinates = Coordinates::new(&rows.robot, &rows);
    let (told, gain) = Fitter::new(&rows, &coordinates).told(&[0]).unwrap().unwrap();
    approx::assert_relative_eq!(told.u[0], 1.4, epsilon = 0.05);
    assert!(gain > 100.0, "{gain}");
}
