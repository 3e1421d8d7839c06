//! From the hypotheses that were looked at to what a report says: the verdict, the causes, what ties with them, what could not show.

mod channels;
mod closure;
mod detectable;
mod file_numbers;
mod fitness;
mod information;
mod remaining;
mod ties;
mod unknown;
mod verdict;
mod words;

pub use closure::{Closure, Retuned, Share};
pub use detectable::Detectable;
pub use file_numbers::FileNumber;
pub(crate) use fitness::moves;
pub use fitness::{check_bench_fitness, check_fitness};
pub use remaining::{Remaining, Run};
pub use ties::Tied;
pub use verdict::Word;
pub use words::{at, number, off, sentence, size, tied, together, words};

use raven::Result;
use raven::camera::Cameras;
use raven::effects::{Scale, Sited};
use raven::log::Recording;
use raven::robot::{KinematicsKind, Robot};
use serde::Serialize;

use self::channels::Sampled;
use self::unknown::probability_of_none;
use crate::evidence::fit::linear::dot;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::coordinates::Coordinates;
use crate::evidence::numbers::spread::{Departures, Spread};
use crate::evidence::outcome::Outcome;
use crate::evidence::recorded::bench::Bench;
use crate::evidence::recorded::data::Data;
use crate::evidence::recorded::rows::{ALL, Links, Observed, Rows, Setting};

/// The nominal model: what recordings are held against.
#[derive(Debug, Clone)]
pub struct Nominal<'a> {
    /// Its numbers, and their tolerances.
    pub robot: &'a Robot,
    /// Those the tips were tracked with.
    pub cameras: Option<&'a Cameras>,
    /// By what part of those they are off, as other recordings of the rig show.
    pub spread: Spread,
}

impl<'a> Nominal<'a> {
    /// Whose numbers are off by their tolerances, as nothing else is known of them.
    #[must_use]
    pub fn new(robot: &'a Robot, cameras: Option<&'a Cameras>) -> Self {
        Self { robot, cameras, spread: Spread::default() }
    }
}

/// What the recordings say of causes.
#[derive(Debug, Clone, Serialize)]
pub struct Attribution {
    /// In a word.
    pub verdict: Word,
    /// Causes, the surest first.
    pub effects: Vec<Blamed>,
    /// Part of the misfit that they account for; nothing without effects.
    pub misfit_accounted: Option<f64>,
    /// Every effect looked at, and none: the most probable first.
    pub candidates: Vec<Candidate>,
    /// Effects that these recordings cannot show.
    pub not_observable: Vec<NotObservable>,
    /// Smallest sizes that they could have shown.
    pub minimum_detectable: Vec<Detectable>,
    /// Probability that there are effects, all of them too small to show.
    pub probability_too_small: f64,
    /// Probability that the cause is not in the library, and that what is named stands in for it.
    pub probability_outside: f64,
    /// Numbers of the robot file that are off by more than it allows them, beside the effects.
    pub file_numbers: Vec<FileNumber>,
    /// What part of its tolerances counted, by kind of effect; empty where no other recording says.
    pub tolerance_parts: Spread,
    /// How far these recordings take its numbers to be off; nothing where they hold something that is not explained.
    #[serde(skip)]
    pub departures: Option<Departures>,
    /// How far the gap closes.
    pub gap: Vec<Closure>,
    /// What is left over time, before and after the effects; empty without effects.
    #[serde(skip)]
    pub remaining: Vec<Remaining>,
    /// What else there is to say.
    pub remarks: Vec<String>,
    /// Where recordings were held against a simulation, which of the two has the effects.
    #[serde(skip)]
    pub side: Option<Side>,
    /// Where the search ended, for another one to be held against.
    #[serde(skip)]
    pub point: Point,
}

/// Where the numbers of a model are best, with the effects that are named.
#[derive(Debug, Clone, Default)]
pub struct Point {
    settings: Vec<Setting>,
    /// Evidence with the prior of so many effects, but for the misfit [nat].
    beside_misfit_nats: f64,
}

/// Which of a robot and its simulation has what the other lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// The robot.
    Robot,
    /// The simulation.
    Simulation,
}

/// A cause.
#[derive(Debug, Clone, Serialize)]
pub struct Blamed {
    /// Identifier.
    pub id: &'static str,
    /// Joint, `from->to`, `12` or `23`; nothing for the whole.
    pub joint: Option<String>,
    /// That it is there, or what no recording of motors and tip can tell from it.
    pub probability: f64,
    /// What the evidence loses without it [nat].
    pub evidence_nats: f64,
    /// Its numbers.
    pub parameters: Vec<Estimate>,
    /// What cannot be told from it, or hardly.
    pub ties: Vec<Tied>,
}

impl Blamed {
    /// Its numbers as sentences have them.
    #[must_use]
    pub fn numbers(&self) -> Vec<String> {
        self.parameters.iter().filter(|estimate| !estimate.aside).map(number).collect()
    }
}

/// A number of a cause.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// Name.
    pub name: &'static str,
    /// In `unit`.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// SI.
    pub unit: String,
    /// Whether it belongs to the law and says nothing of whether the effect is there: left out of sentences.
    #[serde(skip)]
    pub aside: bool,
    /// Whether it is one of the whole numbers, which has no deviation.
    #[serde(skip)]
    pub whole: bool,
}

impl Attribution {
    /// The effect that is looked at first if there should be one after all, where that is probable enough to be said.
    #[must_use]
    pub fn leading(&self) -> Option<&Candidate> {
        let first = self.candidates.iter().find(|candidate| candidate.id != NONE)?;
        (self.effects.is_empty() && first.probability > LEADING_MIN).then_some(first)
    }
}

/// The candidate that there is no effect.
pub const NONE: &str = "none";

/// An effect that was looked at.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Identifier; [`NONE`] for no effect.
    pub id: &'static str,
    /// As of a cause.
    pub joint: Option<String>,
    /// That it is there, alone or with others.
    pub probability: f64,
    /// The best evidence with it, above that of no effect [nat].
    pub evidence_nats: f64,
}

/// An effect that cannot show.
#[derive(Debug, Clone, Serialize)]
pub struct NotObservable {
    /// Identifier.
    pub id: &'static str,
    /// Why.
    pub because: String,
}

/// Probability from which on the leading candidate is spoken of where none is named, and an effect is named beside others.
const LEADING_MIN: f64 = 0.05;

/// What recordings of an arm say, as far as it weighs anything.
fn data(recordings: &[Recording], cameras: Option<&Cameras>) -> Result<Vec<Data>> {
    recordings.iter().map(|recording| Ok(Data::new(recording, cameras)?.weighed())).collect()
}

/// Says what causes the gap of recordings of an arm or a bench. `each` hears of every step.
///
/// # Errors
/// If the recordings cannot carry a diagnosis.
pub fn attribute(nominal: &Nominal, recordings: &[Recording], each: impl FnMut()) -> Result<Attribution> {
    let Nominal { robot, cameras, spread } = nominal;
    if matches!(robot.kinematics, KinematicsKind::Bench) {
        let bench = Bench::new(robot, recordings)?;
        check_bench_fitness(robot, &bench)?;
        let remarks = bench.remarks().into_iter().map(str::to_owned).collect();
        return Ok(Attribution { remarks, ..attributed(&bench, spread, each)? });
    }
    let data = data(recordings, *cameras)?;
    check_fitness(robot, &data)?;
    attributed(&Rows::new(robot, *cameras, &data)?, spread, each)
}

/// What causes the gap of recordings of either kind, and how far it closes.
fn attributed(rows: &dyn Sampled, spread: &Spread, mut each: impl FnMut()) -> Result<Attribution> {
    let coordinates = Coordinates::new(rows.robot(), rows).spread(spread);
    let fitter = Fitter::new(rows, &coordinates);
    let outcome = followed(rows, fitter.search(&mut each)?)?;
    // Friction that was found makes samples near rest doubtful that were not: the likely hypotheses are judged anew.
    let Some(rows) = rows.reweighted(&coordinates.settings(&fitter.effects_alone(&outcome.best)))? else {
        return concluded(rows, &coordinates, &outcome);
    };
    let fitter = Fitter::new(&*rows, &coordinates);
    let outcome = followed(&*rows, fitter.search_again(&outcome, each)?)?;
    concluded(&*rows, &coordinates, &outcome)
}

fn followed(rows: &dyn Sampled, outcome: Option<Outcome>) -> Result<Outcome> {
    outcome.ok_or_else(|| {
        raven::Error::Data(format!(
            "robot `{}`: the model does not follow the recorded motors; check that file and recordings belong together.",
            rows.robot().name
        ))
    })
}

fn concluded(rows: &dyn Sampled, coordinates: &Coordinates, outcome: &Outcome) -> Result<Attribution> {
    let (mut attribution, closing) = attribution(&Fitter::new(rows, coordinates), outcome)?;
    (attribution.gap, attribution.remaining) = closure::closures(rows, coordinates, closing)?;
    Ok(attribution)
}

/// What a diagnosis that knows the effects makes of recordings.
#[derive(Debug, Clone, Default)]
pub struct Told {
    /// How far the gap closes.
    pub gap: Vec<Closure>,
    /// Evidence that each effect adds beside the others, at least [nat].
    pub evidence_nats: f64,
}

/// What recordings of an arm say when it is told which effects there are, by identifier and place; `None` where the model cannot be fitted, or an
/// effect is not in the library or cannot show in the recordings.
///
/// # Errors
/// As [`attribute`].
pub fn when_told(nominal: &Nominal, recordings: &[Recording], effects: &[(&str, Option<&str>)]) -> Result<Option<Told>> {
    let Nominal { robot, cameras, spread } = nominal;
    let data = data(recordings, *cameras)?;
    let rows = Rows::new(robot, *cameras, &data)?;
    let coordinates = Coordinates::new(robot, &rows).spread(spread);
    let of_name = |&(id, joint): &(&str, Option<&str>)| {
        coordinates.sited.iter().position(|sited| sited.effect.id == id && sited.joint(robot).as_deref() == joint)
    };
    let Some(told) = effects.iter().map(of_name).collect::<Option<Vec<usize>>>() else { return Ok(None) };
    let fitter = Fitter::new(&rows, &coordinates);
    let fitted = |rows: &Rows| Fitter::new(rows, &coordinates).told(&told);
    let closed = |rows: &Rows, (hypothesis, evidence_nats): (Hypothesis, f64)| {
        Ok(Told { gap: closure::closures(rows, &coordinates, &hypothesis)?.0, evidence_nats })
    };
    let Some(first) = fitted(&rows)? else { return Ok(None) };
    let Some(reweighted) = rows.reweighted(&coordinates.settings(&fitter.effects_alone(&first.0)))? else {
        return closed(&rows, first).map(Some);
    };
    fitted(&reweighted)?.map(|again| closed(&reweighted, again)).transpose()
}

/// Evidence, with their priors, of two searches that each had their own readings of an arm on the same path [nat]. Samples count the same for both: those
/// near rest as the one with more friction has them.
///
/// # Errors
/// As [`attribute`].
pub fn evidence_of_both(nominal: &Nominal, both: [(&[Recording], &Point); 2]) -> Result<[f64; 2]> {
    let Nominal { robot, cameras, .. } = nominal;
    let evidence = |(recordings, own): (&[Recording], &Point)| {
        let data = data(recordings, *cameras)?;
        let mut rows = Rows::new(robot, *cameras, &data)?;
        for (_, point) in both {
            rows = rows.reweighted(&point.settings)?.unwrap_or(rows);
        }
        let left = rows.residuals(&own.settings, Links::RolledOut, &ALL)?;
        Ok(own.beside_misfit_nats - 0.5 * dot(&left, &left))
    };
    let [one, other] = both;
    Ok([evidence(one)?, evidence(other)?])
}

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
fn attribution<'a>(fitter: &Fitter, outcome: &'a Outcome) -> Result<(Attribution, &'a Hypothesis)> {
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
    let with = |effect: usize| probabilities.iter().filter(|(set, _)| set.contains(&effect)).map(|(_, p)| p).sum::<f64>();
    let mut effects = Vec::new();
    if let Some(best) = blamed {
        for &effect in &best.effects {
            let ties = ties::ties(fitter, outcome, best, effect);
            let probability = ties::probability(&probabilities, &fitter.coordinates.sited, effect);
            effects.push(Blamed { probability, ties, ..cause(fitter, outcome, best, &deviations, effect) });
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

/// An effect of the best hypothesis, the deviations of whose free coordinates are given.
fn cause(fitter: &Fitter, outcome: &Outcome, best: &Hypothesis, deviations: &[f64], effect: usize) -> Blamed {
    let coordinates = fitter.coordinates;
    let sited = coordinates.sited[effect];
    let std = |c: usize| best.free.iter().position(|&free| free == c).map_or(0.0, |k| deviations[k]);
    let evidence = |effects: &[usize]| {
        let fitted = outcome.fitted.get(effects).map(|(_, evidence)| *evidence);
        fitted.or_else(|| outcome.spurious.get(effects).copied()).unwrap_or(f64::NEG_INFINITY)
    };
    Blamed {
        id: sited.effect.id,
        joint: sited.joint(fitter.rows.robot()),
        probability: 0.0,
        evidence_nats: evidence(&best.effects) - evidence(&best.all_but(effect)),
        parameters: coordinates.of(effect).map(|c| estimate(fitter, best, c, std(c))).collect(),
        ties: Vec::new(),
    }
}

/// A coordinate of a hypothesis with its deviation as a number in its unit.
fn estimate(fitter: &Fitter, hypothesis: &Hypothesis, c: usize, std: f64) -> Estimate {
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
    let best_with = |effect: usize| {
        let with = outcome.known().chain(spurious()).filter(|(set, _)| set.contains(&effect));
        with.map(|(_, evidence)| evidence).fold(f64::NEG_INFINITY, f64::max)
    };
    let of_effect = |(effect, sited): (usize, &Sited)| {
        let evidence_nats = best_with(effect) - none;
        let candidate =
            Candidate { id: sited.effect.id, joint: sited.joint(fitter.rows.robot()), probability: with(effect), evidence_nats };
        evidence_nats.is_finite().then_some(candidate)
    };
    let mut all: Vec<Candidate> = fitter.coordinates.sited.iter().enumerate().filter_map(of_effect).collect();
    all.push(Candidate { id: NONE, joint: None, probability: probability_of_none(probabilities), evidence_nats: 0.0 });
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
