//! Room among the hypotheses that were looked at for what was not: effects too small to show, and causes outside the library.

use std::collections::BTreeMap;

use raven::effects::Sited;

use super::verdict::Word;
use crate::evidence::numbers::prior;

/// Of hypotheses by their effects.
pub(super) fn probability_of_none(probabilities: &[(Vec<usize>, f64)]) -> f64 {
    probabilities.iter().find(|(effects, _)| effects.is_empty()).map_or(0.0, |(_, p)| *p)
}

/// Makes room for effects that are too small to show; returns their probability. `parts_unseen` are the parts of the effects' sizes that are,
/// `of_all` that of them together, `effects` how many effects there are at their places. Such an effect leaves the evidence as it is
/// without: so much of the probability of each alone is among them already.
pub(super) fn with_unseen(
    probabilities: &mut [(Vec<usize>, f64)],
    parts_unseen: &BTreeMap<usize, f64>,
    of_all: f64,
    effects: usize,
) -> f64 {
    let none = probability_of_none(probabilities);
    let of_one = none * (prior::log(1, effects) - prior::log(0, effects)).exp();
    for (set, probability) in probabilities.iter_mut() {
        if let [effect] = set[..] {
            *probability = (*probability - of_one * parts_unseen.get(&effect).unwrap_or(&0.0)).max(0.0);
        }
    }
    let unseen = none * prior::odds_unseen(of_all);
    let sum = unseen + probabilities.iter().map(|(_, p)| p).sum::<f64>();
    probabilities.iter_mut().for_each(|(_, p)| *p /= sum);
    unseen / sum
}

/// Makes room for causes that are not in the library, where the effects that are `blamed` stand in for them; returns their probability.
pub(super) fn with_outside(probabilities: &mut [(Vec<usize>, f64)], verdict: Word, blamed: &[Sited]) -> f64 {
    let beside = |one: &Sited| blamed.iter().filter(|other| one.shows_where(other)).count();
    let outside = prior::outside(blamed.iter().map(beside).max().unwrap_or(0), verdict.remains());
    probabilities.iter_mut().for_each(|(_, p)| *p *= 1.0 - outside);
    outside
}

#[cfg(test)]
mod tests {
    use super::*;
    use raven::robot::nominal;

    #[test]
    fn recordings_that_say_nothing_leave_none_as_probable_as_it_was() {
        // Two effects, of which no size can show: the evidence of each is that of none.
        let mut probabilities =
            prior::probabilities([vec![], vec![0], vec![1]].map(|set: Vec<usize>| (set.clone(), prior::log(set.len(), 2))).into_iter());
        let unseen = with_unseen(&mut probabilities, &BTreeMap::from([(0, 1.0), (1, 1.0)]), 1.0, 2);
        approx::assert_relative_eq!(probability_of_none(&probabilities), prior::log(0, 2).exp(), epsilon = 1e-9);
        approx::assert_relative_eq!(unseen, 1.0 - prior::log(0, 2).exp(), epsilon = 1e-9);
    }

    #[test]
    fn an_effect_that_shows_stays_as_it_is() {
        let mut probabilities = prior::probabilities([(vec![], 0.0), (vec![0], 20.0 + prior::log(1, 80))].into_iter());
        with_unseen(&mut probabilities, &BTreeMap::from([(0, 0.3)]), 0.3, 80);
        assert!(probabilities[0].0 == [0] && probabilities[0].1 > 0.999_99, "{probabilities:?}");
        let sited = |id, joint| Sited::at(&nominal::gold(), id, joint).unwrap();
        assert!(with_outside(&mut probabilities, Word::Explained, &[sited("payload", None)]) < 0.05);
        assert!(probabilities[0].1 > 0.95);
    }

    #[test]
    fn effects_of_other_joints_do_not_stand_in_for_one_cause() {
        let friction = |joint| Sited::at(&nominal::gold(), "motor-coulomb-friction", Some(joint)).unwrap();
        let [shoulder, elbow] = ["shoulder", "elbow"].map(friction);
        let ripple = Sited::at(&nominal::gold(), "torque-ripple", Some("elbow")).unwrap();
        let outside = |blamed: &[Sited]| with_outside(&mut [], Word::PartlyExplained, blamed);
        assert_eq!(outside(&[shoulder, elbow]), outside(&[shoulder]));
        assert!(outside(&[shoulder, elbow, ripple]) > outside(&[shoulder]));
    }
}
