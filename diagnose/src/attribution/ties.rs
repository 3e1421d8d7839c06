//! What cannot be told from a cause, or hardly.

use raven::effects::Sited;
use serde::Serialize;

use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::outcome::Outcome;
use crate::evidence::search::tied::{TIED_NATS, has};

/// Another effect that would do as well.
#[derive(Debug, Clone, Serialize)]
pub struct Tied {
    /// Identifier.
    pub id: &'static str,
    /// As of a cause.
    pub joint: Option<String>,
    /// Whether no recording of motors and tip can tell them apart.
    pub exact: bool,
    /// What the evidence loses with it instead [nat].
    pub gap_nats: f64,
    /// The motion that tells them apart, or what to measure where none does.
    pub separate_by: &'static str,
}

/// Effects that could stand in for one of a hypothesis.
pub(super) fn ties(fitter: &Fitter, outcome: &Outcome, best: &Hypothesis, effect: usize) -> Vec<Tied> {
    let sited = &fitter.coordinates.sited;
    let joint = |effect: usize| sited[effect].joint(fitter.rows.robot());
    let reached = outcome.fitted.get(&best.effects).map_or(best.evidence, |(_, evidence)| *evidence);
    let stands_in = |other: usize| {
        let mut effects: Vec<usize> = best.effects.iter().map(|&e| if e == effect { other } else { e }).collect();
        effects.sort_unstable();
        let (_, evidence) = outcome.fitted.get(&effects)?;
        let (gap_nats, exact) = (reached - evidence, sited[effect].exact_tie(&sited[other]));
        (gap_nats < TIED_NATS || exact.is_some()).then(|| Tied {
            id: sited[other].effect.id,
            joint: joint(other),
            exact: exact.is_some(),
            gap_nats,
            separate_by: exact.unwrap_or(sited[effect].effect.separated_by),
        })
    };
    let same = |(id, separate_by)| Tied { id, joint: joint(effect), exact: true, gap_nats: 0.0, separate_by };
    let of_library = (0..sited.len()).filter(|other| !best.effects.contains(other)).filter_map(stands_in);
    let mut ties: Vec<Tied> = sited[effect].effect.other_names().map(same).chain(of_library).collect();
    ties.sort_by(|a, b| a.gap_nats.total_cmp(&b.gap_nats));
    ties
}

/// Probability that an effect is there, or one that no recording can tell from it.
pub(super) fn probability(probabilities: &[(Vec<usize>, f64)], sited: &[Sited], effect: usize) -> f64 {
    probabilities.iter().filter(|(effects, _)| has(sited, effects, effect)).map(|(_, p)| p).sum()
}

/// Probability that some effects are there and no others, or those that no recording can tell from them.
pub(super) fn probability_of_all(probabilities: &[(Vec<usize>, f64)], sited: &[Sited], effects: &[usize]) -> f64 {
    let are_they = |others: &[usize]| others.len() == effects.len() && effects.iter().all(|&effect| has(sited, others, effect));
    probabilities.iter().filter(|(others, _)| are_they(others)).map(|(_, p)| p).sum()
}

#[cfg(test)]
mod tests {
    use raven::robot::nominal;

    use super::*;

    #[test]
    fn what_cannot_be_told_apart_is_one_cause() {
        let robot = nominal::gold();
        let named = [("tool-length", None), ("joint-offset", Some("insertion")), ("joint-offset", Some("shoulder"))];
        let sited = named.map(|(id, place)| Sited::at(&robot, id, place).unwrap());
        let probabilities = [(vec![0], 0.4), (vec![1], 0.3), (vec![0, 2], 0.1), (vec![1, 2], 0.05), (vec![2], 0.06), (Vec::new(), 0.09)];
        for (effect, expected, alone) in [(0, 0.85, 0.7), (1, 0.85, 0.7), (2, 0.21, 0.06)] {
            approx::assert_relative_eq!(probability(&probabilities, &sited, effect), expected, epsilon = 1e-12);
            approx::assert_relative_eq!(probability_of_all(&probabilities, &sited, &[effect]), alone, epsilon = 1e-12);
        }
        approx::assert_relative_eq!(probability_of_all(&probabilities, &sited, &[1, 2]), 0.15, epsilon = 1e-12);
    }
}
