//! Everything that a search looked at, and where it ended.

use std::collections::{BTreeMap, BTreeSet};

use crate::evidence::fit::Hypothesis;
use crate::evidence::numbers::prior;
use crate::evidence::search::screen::Candidate;
use crate::evidence::weighing::leftover::Leftover;

/// Everything that was looked at, and where it ended.
pub struct Outcome {
    /// The hypothesis without effects.
    pub none: Hypothesis,
    /// The most probable hypothesis.
    pub best: Hypothesis,
    /// What the best hypothesis leaves; by so much the evidence of all is tempered.
    pub leftover: Leftover,
    /// Every hypothesis that was fitted, by its effects, with its tempered evidence [nat].
    pub fitted: BTreeMap<Vec<usize>, (Hypothesis, f64)>,
    /// Tempered evidence [nat] of those that were fitted and hold an effect that is not worth naming, or only to tell what another one is worth.
    pub spurious: BTreeMap<Vec<usize>, f64>,
    /// Tempered evidence, at most, of those that the screen gave up [nat].
    pub screened: BTreeMap<Vec<usize>, f64>,
    /// What the screen said of the whole library from each hypothesis that effects were added to.
    pub(super) screens: BTreeMap<Vec<usize>, Vec<Candidate>>,
    /// From where each hypothesis was fitted after a screen.
    starts: BTreeMap<Vec<usize>, Vec<Vec<f64>>>,
    /// Effects of the best hypothesis after it was held against its ties and rivals. A second search, where rows have other weights, fits those anew
    /// that came near, and does not look for them again.
    pub(super) compared: Option<Vec<usize>>,
    /// Effects that were lost in scatter, and left out: not to be added again.
    pub(super) shed: BTreeSet<Vec<usize>>,
    /// Effects at their places in the library.
    pub(super) effects: usize,
}

impl Outcome {
    /// With the hypothesis without effects, out of so many.
    pub(crate) fn begun(none: Hypothesis, effects: usize) -> Self {
        let mut outcome = Self {
            best: none.clone(),
            none: none.clone(),
            leftover: Leftover::none(),
            fitted: BTreeMap::new(),
            spurious: BTreeMap::new(),
            screened: BTreeMap::new(),
            screens: BTreeMap::new(),
            starts: BTreeMap::new(),
            compared: None,
            shed: BTreeSet::new(),
            effects,
        };
        outcome.keep(&none);
        outcome
    }

    /// Probability of every hypothesis looked at, most probable first. Of those that were fitted the ones with an effect that is lost in scatter
    /// are among the spurious.
    #[must_use]
    pub fn probabilities(&self) -> Vec<(Vec<usize>, f64)> {
        let prior = |effects: &Vec<usize>| {
            let of = if self.fitted.contains_key(effects) { prior::log_beyond_scatter } else { prior::log };
            of(effects.len(), self.effects)
        };
        prior::probabilities(self.known().map(|(effects, evidence)| (effects.clone(), evidence + prior(effects))))
    }

    /// Evidence of a hypothesis whose effects are beyond their scatter, with its prior [nat].
    pub(crate) fn score(&self, hypothesis: &Hypothesis, evidence: f64) -> f64 {
        evidence + prior::log_beyond_scatter(hypothesis.effects.len(), self.effects)
    }

    /// Every hypothesis looked at, with its evidence [nat].
    pub fn known(&self) -> impl Iterator<Item = (&Vec<usize>, f64)> {
        let screened = self.screened.iter().filter(|(effects, _)| !self.fitted.contains_key(*effects));
        self.fitted
            .iter()
            .map(|(effects, (_, evidence))| (effects, *evidence))
            .chain(screened.map(|(effects, evidence)| (effects, *evidence)))
    }

    /// What is known of a candidate that was fitted from the same start before.
    pub(super) fn known_from(&self, candidate: &Candidate) -> Option<&Hypothesis> {
        let was_begun_there = self.starts.get(&candidate.effects)?.contains(&candidate.start);
        self.fitted.get(&candidate.effects).filter(|_| was_begun_there).map(|(hypothesis, _)| hypothesis)
    }

    /// That a candidate was fitted.
    pub(super) fn remember(&mut self, candidate: &Candidate) {
        let starts = self.starts.entry(candidate.effects.clone()).or_default();
        if !starts.contains(&candidate.start) {
            starts.push(candidate.start.clone());
        }
    }

    /// Goes on with the most probable hypothesis.
    pub(super) fn choose(&mut self) {
        if let Some((best, _)) = self.fitted.values().max_by(|a, b| self.score(&a.0, a.1).total_cmp(&self.score(&b.0, b.1))) {
            self.best = best.clone();
        }
    }

    /// Takes in a hypothesis that supersedes what is known with the same effects.
    pub(crate) fn keep(&mut self, hypothesis: &Hypothesis) {
        let known = self.fitted.get(&hypothesis.effects).map(|(known, _)| known);
        if known.is_none_or(|known| hypothesis.supersedes(known)) {
            self.replace(hypothesis);
        }
    }

    /// Puts a hypothesis in the place of what is known with the same effects, the best one's as well.
    pub(crate) fn put(&mut self, hypothesis: &Hypothesis) {
        if hypothesis.effects == self.best.effects {
            self.best = hypothesis.clone();
        }
        self.replace(hypothesis);
    }

    fn replace(&mut self, hypothesis: &Hypothesis) {
        if hypothesis.effects.is_empty() {
            self.none = hypothesis.clone();
        }
        self.fitted.insert(hypothesis.effects.clone(), (hypothesis.clone(), hypothesis.evidence));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::tests::fitted;

    #[test]
    fn effects_beyond_their_scatter_are_there_unless_the_evidence_says_little() {
        for (evidence, is_there) in [(3.0, true), (0.5, false)] {
            let none = fitted(Vec::new(), 0.0);
            let mut outcome = Outcome::begun(none, 80);
            outcome.keep(&fitted(vec![0], evidence));
            outcome.screened.insert(vec![1], 0.0);
            assert!(prior::log(0, 80) > prior::log(1, 80) + evidence);
            let probabilities = outcome.probabilities();
            assert_eq!(probabilities[0].0 == [0], is_there, "{probabilities:?}");
            approx::assert_relative_eq!(probabilities.iter().map(|(_, p)| p).sum::<f64>(), 1.0, epsilon = 1e-12);
        }
    }
}
