//! What is believed of the number of effects before a recording is looked at.
//!
//! Who asks where a gap comes from has one more often than not: one recording in four holds nothing. More effects are less probable than
//! fewer, and all sets of one size are equally so.

/// Probability of none, one, two and three effects.
const OF_COUNT: [f64; 4] = [0.25, 0.52, 0.19, 0.04];

/// Probability that what is named stands in for a cause that the library does not have, by how many effects it takes at one place: none, one,
/// two, three. The more, the likelier. Of the effects that were named in recordings of the virtual lab and left nothing, 464 of 474 were there where
/// one was named at a place (760 recordings, but for those that a tie has a part of), 107 of 113 and 4 of 15 where two or three were (640).
const OUTSIDE: [f64; 4] = [0.0, 0.02, 0.06, 0.7];
/// The same where something reproducible remains: in 840 recordings 32 of 41, 22 of 47 and 7 of 36 were there. Where none was named, 45 of 49
/// causes were not in the library.
const OUTSIDE_IF_REMAINS: [f64; 4] = [0.9, 0.2, 0.53, 0.8];

/// Odds of an effect that is beyond its scatter over what its evidence alone gives it, which takes torque to err by one per cent for a fifth of a
/// second. Of six recordings of the virtual lab where one had 2 to 4 nats beside none five held it, and one where it had less held nothing.
const BEYOND_SCATTER: f64 = 10.0;

/// Probability that a cause is not in the library where it takes so many effects `at_one_place` and something remains beside them, or not.
#[must_use]
pub fn outside(at_one_place: usize, remains: bool) -> f64 {
    let by_count = if remains { OUTSIDE_IF_REMAINS } else { OUTSIDE };
    by_count[at_one_place.min(by_count.len() - 1)]
}

/// Logarithm of the prior probability of one set of `count` effects out of `effects`.
#[must_use]
pub fn log(count: usize, effects: usize) -> f64 {
    let sets: f64 = (0..count).map(|k| (effects.saturating_sub(k)) as f64 / (k + 1) as f64).product();
    OF_COUNT.get(count).map_or(f64::NEG_INFINITY, |p| p.ln() - sets.max(1.0).ln())
}

/// The same of effects that are all beyond their scatter.
#[must_use]
pub fn log_beyond_scatter(count: usize, effects: usize) -> f64 {
    log(count, effects) + count as f64 * BEYOND_SCATTER.ln()
}

/// Probabilities of hypotheses from their evidence with the logarithm of their prior [nat], most probable first.
#[must_use]
pub fn probabilities(all: impl Iterator<Item = (Vec<usize>, f64)>) -> Vec<(Vec<usize>, f64)> {
    let mut all: Vec<(Vec<usize>, f64)> = all.collect();
    let highest = all.iter().map(|(_, l)| *l).fold(f64::NEG_INFINITY, f64::max);
    all.iter_mut().for_each(|(_, l)| *l = (*l - highest).exp());
    let sum: f64 = all.iter().map(|(_, p)| p).sum();
    all.iter_mut().for_each(|(_, p)| *p /= sum);
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all
}

/// Odds that there are effects, all of them too small to show, against that there are none. `part_unseen` is the part of an effect's sizes
/// that is too small, on average over the effects.
#[must_use]
pub fn odds_unseen(part_unseen: f64) -> f64 {
    let [none, some @ ..] = OF_COUNT;
    some.iter().rev().fold(0.0, |sum, p| (sum + p) * part_unseen) / none
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sets_of_all_sizes_sum_to_one() {
        let n = 12;
        let sets = [1.0, 12.0, 66.0, 220.0];
        let sum: f64 = sets.iter().enumerate().map(|(k, sets)| sets * log(k, n).exp()).sum();
        approx::assert_relative_eq!(sum, 1.0, epsilon = 1e-12);
    }

    #[test]
    fn what_cannot_show_stays_as_probable_as_it_was() {
        approx::assert_relative_eq!(odds_unseen(1.0), 3.0, epsilon = 1e-12);
        approx::assert_relative_eq!(odds_unseen(0.5), (0.52 * 0.5 + 0.19 * 0.25 + 0.04 * 0.125) / 0.25, epsilon = 1e-12);
        assert_eq!(odds_unseen(0.0), 0.0);
    }
}
