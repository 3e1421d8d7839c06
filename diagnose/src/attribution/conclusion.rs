//! From the hypotheses that were looked at to what is said of them: which effects are named, how probable each is, what else might be there.

use raven::Result;
use raven::effects::{Scale, Sited};

use super::findings::{Attribution, Blamed, Candidate, Estimate, LEADING_MIN, NONE, NotObservable, Point};
use super::unknown::probability_of_none;
use super::verdict::Word;
use super::{detectable, file_numbers, ties, unknown, verdict};
use crate::evidence::fit::linear::dot;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::outcome::Outcome;

/// The hypothesis whose effects are named: the most probable with any, together with those that no recording can tell from it, where effects that
/// show are more probable together than none. That their sizes are beyond what sizes scatter by, family-wise, has been asked of them besides.
fn named<'a>(outcome: &'a Outcome, sited: &[Sited], probabilities: &[(Vec<usize>, f64)]) -> Option<&'a Hypothesis> {
    let with_any = || probabilities.iter().filter(|(effects, _)| !effects.is_empty());
    let shown: f64 = with_any().map(|(_, p)| p).sum();
    let of_cause = |(effects, own): &(Vec<usize>, f64)| {
        let (hypothesis, _) = outcome.fitted.get(effects)?;
        Some((hypothesis, [ties::probability_of_all(probabilities, sited, effects), *own]))
    };
    let most = with_any().filter_map(of_cause).max_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let most = most.map(|(hypothesis, _)| hypothesis).filter(|_| shown > probability_of_none(probabilities))?;
    Some(without_the_improbable(outcome, sited, probabilities, most))
}

/// A hypothesis, or what is left of it: many effects may do about as well beside the others, and none of them is probable then.
fn without_the_improbable<'a>(
    outcome: &'a Outcome,
    sited: &[Sited],
    probabilities: &[(Vec<usize>, f64)],
    mut hypothesis: &'a Hypothesis,
) -> &'a Hypothesis {
    let probability = |&effect: &usize| ties::probability(probabilities, sited, effect);
    while hypothesis.effects.len() > 1
        && let Some(least) = hypothesis.effects.iter().min_by(|a, b| probability(a).total_cmp(&probability(b)))
        && probability(least) < LEADING_MIN
        && let Some((rest, _)) = outcome.fitted.get(&hypothesis.all_but(*least))
    {
        hypothesis = rest;
    }
    hypothesis
}

/// What hypotheses say, without the gap, and the hypothesis that closes it: where the verdict blames no effect, that without.
pub(super) fn attribution<'a>(fitter: &Fitter, outcome: &'a Outcome) -> Result<(Attribution, &'a Hypothesis)> {
    let smallest = detectable::smallest(fitter, outcome)?;
    let mut probabilities = outcome.probabilities();
    let parts_unseen = smallest.iter().map(|smallest| (smallest.effect, smallest.part_unseen)).collect();
    let of_all = detectable::part_unseen_of_all(&smallest, &fitter.coordinates.sited);
    let too_small = unknown::with_unseen(&mut probabilities, &parts_unseen, of_all, fitter.coordinates.sited.len());
    let named = named(outcome, &fitter.coordinates.sited, &probabilities);
    let verdict::Judgement { word, accounted } = verdict::judge(fitter, outcome, named);
    let blamed = named.filter(|_| word != Word::Unexplained);
    let closing = blamed.unwrap_or(&outcome.none);
    let deviations = fitter.deviations(closing);
    let sited: Vec<Sited> = blamed.iter().flat_map(|best| &best.effects).map(|&effect| fitter.coordinates.sited[effect]).collect();
    let probability_outside = unknown::with_outside(&mut probabilities, word, &sited);
    // Folded from zero: the sum of none is -0, which sorts and prints as less.
    let with = |effect: usize| probabilities.iter().filter(|(set, _)| set.contains(&effect)).map(|(_, p)| p).fold(0.0, |sum, p| sum + p);
    let mut effects = Vec::new();
    if let Some(best) = blamed {
        for &effect in &best.effects {
            let ties = ties::ties(fitter, outcome, best, effect);
            let probability = ties::probability(&probabilities, &fitter.coordinates.sited, effect);
            effects.push(Blamed { probability, ties, ..cause(fitter, outcome, best, &deviations, effect)? });
        }
        effects.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.evidence_nats.total_cmp(&a.evidence_nats)));
    }
    let (minimum_detectable, unseen): (Vec<_>, Vec<_>) =
        smallest.iter().map(|smallest| smallest.detectable(fitter)).partition(Result::is_ok);
    let not_observable = fitter.coordinates.not_observable.iter();
    let not_observable = not_observable.map(|(effect, because)| NotObservable { id: effect.id, because: (*because).to_owned() });
    let attribution = Attribution {
        verdict: word,
        effects,
        misfit_accounted: accounted,
        candidates: candidates(fitter, outcome, &probabilities, &with),
        not_observable: not_observable.chain(unseen.into_iter().filter_map(Result::err)).collect(),
        minimum_detectable: minimum_detectable.into_iter().flatten().collect(),
        probability_too_small: too_small * (1.0 - probability_outside),
        probability_outside,
        file_numbers: file_numbers::file_numbers(fitter, closing, &deviations),
        tolerance_parts: fitter.coordinates.spread.clone(),
        departures: fitter.departures(closing, &deviations).filter(|_| !word.remains()),
        gap: Vec::new(),
        remaining: Vec::new(),
        remarks: Vec::new(),
        side: None,
        point: Point {
            settings: fitter.coordinates.settings(&closing.u),
            beside_misfit_nats: outcome.score(closing, closing.evidence) + 0.5 * dot(&closing.residuals, &closing.residuals),
        },
    };
    Ok((attribution, closing))
}

/// An effect of the best hypothesis, the deviations of whose free coordinates are given. What it is worth is what that is beyond the hypothesis without
/// it, which is fitted if it has not been.
fn cause(fitter: &Fitter, outcome: &Outcome, best: &Hypothesis, deviations: &[f64], effect: usize) -> Result<Blamed> {
    let coordinates = fitter.coordinates;
    let sited = coordinates.sited[effect];
    let std = |c: usize| best.free.iter().position(|&free| free == c).map_or(0.0, |k| deviations[k]);
    let known = |effects: &[usize]| {
        let fitted = outcome.fitted.get(effects).map(|(_, evidence)| *evidence);
        fitted.or_else(|| outcome.spurious.get(effects).copied())
    };
    let without = match known(&best.all_but(effect)) {
        Some(evidence) => evidence,
        None => fitter.rest(outcome, best, &[effect])?.map_or(f64::NEG_INFINITY, |rest| fitter.tempered(&rest, &outcome.leftover)),
    };
    // What the motion before left is another number in each of several recordings, and none of the robot's.
    let is_of_all = |c: &usize| coordinates.all[*c].recording.is_none() || fitter.rows.recordings() == 1;
    Ok(Blamed {
        id: sited.effect.id,
        joint: sited.joint(fitter.rows.robot()),
        probability: 0.0,
        evidence_nats: known(&best.effects).unwrap_or(f64::NEG_INFINITY) - without,
        parameters: coordinates.of(effect).filter(is_of_all).map(|c| estimate(fitter, best, c, std(c))).collect(),
        ties: Vec::new(),
    })
}

/// A coordinate of a hypothesis with its deviation as a number in its unit.
pub(super) fn estimate(fitter: &Fitter, hypothesis: &Hypothesis, c: usize, std: f64) -> Estimate {
    let coordinates = fitter.coordinates;
    let (parameter, measure, u) = (coordinates.parameter(c), coordinates.sited[coordinates.all[c].effect].measure, hypothesis.u[c]);
    Estimate {
        aside: coordinates.all[c].is_unknown(),
        whole: matches!(parameter.scale, Scale::Whole { .. }),
        name: parameter.name,
        value: parameter.value(u, measure),
        std: parameter.std(u, std, measure),
        unit: parameter.unit_at(measure).to_owned(),
    }
}

fn candidates(fitter: &Fitter, outcome: &Outcome, probabilities: &[(Vec<usize>, f64)], with: &dyn Fn(usize) -> f64) -> Vec<Candidate> {
    // What was fitted and is not worth naming was looked at as well.
    let spurious = || outcome.spurious.iter().map(|(effects, evidence)| (effects, *evidence));
    let none = outcome.fitted.get([].as_slice()).map_or(0.0, |(_, evidence)| *evidence);
    let best = |all: &mut dyn Iterator<Item = (&Vec<usize>, f64)>, effect: usize| {
        let with = all.filter(|(set, _)| set.contains(&effect));
        with.map(|(_, evidence)| evidence - none).fold(f64::NEG_INFINITY, f64::max)
    };
    let of_effect = |(effect, sited): (usize, &Sited)| {
        let [known, aside] = [best(&mut outcome.known(), effect), best(&mut spurious(), effect)];
        let candidate = Candidate {
            id: sited.effect.id,
            joint: sited.joint(fitter.rows.robot()),
            probability: with(effect),
            evidence_nats: known.max(aside),
            set_aside: aside > known,
        };
        candidate.evidence_nats.is_finite().then_some(candidate)
    };
    let mut all: Vec<Candidate> = fitter.coordinates.sited.iter().enumerate().filter_map(of_effect).collect();
    all.push(Candidate { id: NONE, joint: None, probability: probability_of_none(probabilities), evidence_nats: 0.0, set_aside: false });
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(b.evidence_nats.total_cmp(&a.evidence_nats)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::tests::fitted;

    #[test]
    fn what_is_one_of_many_that_would_do_is_not_named_beside_what_is_sure() {
        let sited = Sited::all(&raven::robot::nominal::gold());
        let mut outcome = Outcome::begun(fitted(vec![], 0.0), sited.len());
        [(vec![0, 1], 40.0), (vec![0, 1, 2], 50.0)].into_iter().for_each(|(effects, evidence)| outcome.keep(&fitted(effects, evidence)));
        let of = |probabilities: &[(Vec<usize>, f64)]| named(&outcome, &sited, probabilities).unwrap().effects.clone();
        let rest = [(vec![], 0.01), (vec![0, 1], 0.01)];
        let spread = |p: f64, others: usize| {
            let others = (3..3 + others).map(|third| (vec![0, 1, third], p));
            rest.iter().cloned().chain([(vec![0, 1, 2], p)]).chain(others).collect::<Vec<_>>()
        };
        assert_eq!(of(&spread(0.49, 1)), [0, 1, 2]);
        assert_eq!(of(&spread(0.0245, 39)), [0, 1]);
    }
}
