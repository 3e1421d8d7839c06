//! Verdicts against labels.

use std::collections::BTreeMap;

use raven::effects::at_place;
use raven::simulation::Label;
use serde::Serialize;

use super::cause::{Cause, Names, is_outside};
use super::estimates::Sizes;
use super::metrics::{Claim, Share, brier, calibration_error};
use super::verdict::{ChannelGap, Told, Verdict};
use crate::attribution::Word;

/// Evidence from which an effect shows in a recording [nat]: "strong" by Kass and Raftery 1995.
pub const SHOWS_NATS: f64 = 3.0;

/// Part of a channel's gap that an effect has to close to show there.
const SHOWS_PART: f64 = 0.1;

/// What a diagnosis said of one recording.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Name of the recording.
    pub name: String,
    /// The verdict, or why there is none.
    pub verdict: Result<Verdict, String>,
    /// What it took [s].
    pub seconds: f64,
    /// Of a diagnosis that was told the effects, where there are any.
    pub told: Option<Told>,
}

/// The score, `raven-check/1`.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Score {
    format: &'static str,
    /// Recordings.
    pub recordings: usize,
    /// Those on which the diagnosis failed; they count as wrong.
    pub failed: usize,
    /// Single effects whose first answer is right.
    pub top1: Share,
    /// Those of them that the recording can show: told of them, a fit beats that of no effect by 3 nats.
    pub top1_shown: Share,
    /// Right among the first two answers.
    pub top2: Share,
    /// Single effects that alone are blamed.
    pub single_exact: Share,
    /// First answers by effect.
    pub by_effect: BTreeMap<String, Share>,
    /// Recordings without an effect whose verdict is anything but `none`.
    pub false_alarms: Share,
    /// Several effects, all and no other blamed.
    pub pairs_exact: Share,
    /// Those of them that the recording can show: told of them, a fit of all beats that without any one of them by 3 nats.
    pub pairs_shown: Share,
    /// Causes outside the library on which the verdict is `unexplained` or `partly-explained`.
    pub outside_recall: Share,
    /// Statements with a probability: every blamed effect, or that there is none.
    pub claims: usize,
    /// Expected calibration error.
    pub ece: Option<f64>,
    /// Brier score.
    pub brier: Option<f64>,
    /// Sizes of the effects named rightly.
    pub sizes: Sizes,
    /// Gap closed over what is closed when the effects are told, over the recordings that hide effects of the library.
    pub gap_closed_of_oracle: Option<f64>,
    /// The same with the file's own numbers moved against their tolerances as well.
    pub gap_closed_of_oracle_retuned: Option<f64>,
    /// Mean time per recording [s].
    pub seconds_mean: Option<f64>,
    /// Longest time [s].
    pub seconds_longest: Option<f64>,
    /// The recording that took it.
    pub slowest: Option<String>,
    /// Answers by what is true.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Recordings answered wrongly: name, truth, answer.
    pub wrong: Vec<[String; 3]>,
}

impl Score {
    /// Scores answers; recordings without a label are left out.
    #[must_use]
    pub fn of(answers: &[Answer], labels: &BTreeMap<String, Label>, names: &Names) -> Self {
        let mut score = Self { format: "raven-check/1", ..Self::default() };
        let mut claims = Vec::new();
        let mut closed: [Vec<[f64; 2]>; 2] = Default::default();
        let mut taken: Vec<(f64, &str)> = Vec::new();
        for answer in answers {
            let Some(label) = labels.get(&answer.name) else { continue };
            score.recordings += 1;
            taken.push((answer.seconds, &answer.name));
            let case = Case { label, truth: label.effects.iter().map(|effect| names.labelled(effect)).collect(), names };
            let verdict = answer.verdict.as_ref().ok();
            score.failed += usize::from(verdict.is_none());
            let right = score.count(&case, verdict, answer.told.as_ref());
            let (truth, said) = (case.truth_name(), verdict.map_or_else(|| "failed".to_owned(), |verdict| case.answer_name(verdict)));
            if !right {
                let seen = answer.told.as_ref().map(|told| format!(" ({:.1} nats)", told.evidence_nats)).unwrap_or_default();
                score.wrong.push([
                    answer.name.clone(),
                    case.truth_text() + &seen,
                    verdict.map_or("failed".to_owned(), |v| said_text(v, names)),
                ]);
            }
            *score.confusion.entry(truth).or_default().entry(said).or_default() += 1;
            let Some(verdict) = verdict else { continue };
            claims.extend(case.claims(verdict));
            for blamed in &verdict.effects {
                let cause = names.blamed(blamed);
                if let Some(at) = case.truth.iter().position(|truth| *truth == cause) {
                    score.sizes.compare(&label.effects[at], blamed);
                }
            }
            if let Some(told) = &answer.told {
                for (closed, of) in closed.iter_mut().zip(CLOSED) {
                    closed.extend(closed_by_both(&verdict.gap, &told.gap, of));
                }
            }
        }
        score.claims = claims.len();
        score.ece = calibration_error(&claims);
        score.brier = brier(&claims);
        [score.gap_closed_of_oracle, score.gap_closed_of_oracle_retuned] = closed.map(|closed| {
            let [by_verdict, when_told] = [0, 1].map(|side| closed.iter().map(|pair| pair[side]).sum::<f64>());
            (when_told > 0.0).then(|| by_verdict / when_told)
        });
        score.seconds_mean = (!taken.is_empty()).then(|| taken.iter().map(|(seconds, _)| seconds).sum::<f64>() / taken.len() as f64);
        if let Some((seconds, name)) = taken.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)) {
            (score.seconds_longest, score.slowest) = (Some(seconds), Some(name.to_owned()));
        }
        score
    }

    /// Counts one recording; tells whether the answer is right.
    fn count(&mut self, case: &Case<'_>, verdict: Option<&Verdict>, told: Option<&Told>) -> bool {
        let word = verdict.map(|verdict| verdict.verdict);
        if is_outside(case.label) {
            let told = matches!(word, Some(Word::Unexplained | Word::PartlyExplained));
            self.outside_recall.count(told);
            return told;
        }
        let shows = told.is_some_and(|told| told.evidence_nats >= SHOWS_NATS);
        match &case.truth[..] {
            [] => {
                let quiet = word == Some(Word::None);
                self.false_alarms.count(!quiet);
                quiet
            }
            [only] => {
                let answers = verdict.map(|verdict| case.names.answers(verdict)).unwrap_or_default();
                let among = |first: usize| answers.iter().take(first).any(|answer| answer.as_ref() == Some(only));
                self.top1.count(among(1));
                if shows {
                    self.top1_shown.count(among(1));
                }
                self.top2.count(among(2));
                self.by_effect.entry(case.label.effects[0].id.clone()).or_default().count(among(1));
                let exact = verdict.is_some_and(|verdict| case.exact(verdict));
                self.single_exact.count(exact);
                exact
            }
            _ => {
                let exact = verdict.is_some_and(|verdict| case.exact(verdict));
                self.pairs_exact.count(exact);
                if shows {
                    self.pairs_shown.count(exact);
                }
                exact
            }
        }
    }
}

/// A recording with its label.
struct Case<'a> {
    label: &'a Label,
    truth: Vec<Cause>,
    names: &'a Names,
}

impl Case<'_> {
    /// Whether what is blamed is what is true, no more and no less.
    fn exact(&self, verdict: &Verdict) -> bool {
        let sorted = |mut causes: Vec<Cause>| {
            causes.sort();
            causes.dedup();
            causes
        };
        sorted(verdict.effects.iter().map(|effect| self.names.blamed(effect)).collect()) == sorted(self.truth.clone())
    }

    /// What a verdict states with a probability. `unexplained` states nothing.
    fn claims(&self, verdict: &Verdict) -> Vec<Claim> {
        if verdict.verdict == Word::None && verdict.effects.is_empty() {
            let none = verdict.candidates.iter().find(|candidate| candidate.id == "none").map(|candidate| candidate.probability);
            let others: f64 = verdict.candidates.iter().map(|candidate| candidate.probability).sum();
            return vec![Claim { probability: none.unwrap_or(1.0 - others).clamp(0.0, 1.0), right: self.truth.is_empty() }];
        }
        let claim = |effect| self.truth.contains(&self.names.blamed(effect));
        verdict.effects.iter().map(|effect| Claim { probability: effect.probability.clamp(0.0, 1.0), right: claim(effect) }).collect()
    }

    /// Row of the confusion matrix.
    fn truth_name(&self) -> String {
        match &self.label.effects[..] {
            [] => "none".to_owned(),
            [only] if is_outside(self.label) => format!("outside: {}", only.id),
            [only] => only.id.clone(),
            _ if is_outside(self.label) => "outside".to_owned(),
            several => format!("{} effects", several.len()),
        }
    }

    /// Column of the confusion matrix.
    fn answer_name(&self, verdict: &Verdict) -> String {
        let Some(first) = verdict.effects.first() else { return verdict.verdict.name().to_owned() };
        if is_outside(self.label) {
            return format!("{}: {}", verdict.verdict.name(), first.id);
        }
        let cause = self.names.blamed(first);
        match &self.truth[..] {
            [] => first.id.clone(),
            [only] if *only == cause => self.label.effects[0].id.clone(),
            [only] if only.id == cause.id => format!("{} elsewhere", first.id),
            [_] => first.id.clone(),
            several => {
                let found = several.iter().filter(|truth| verdict.effects.iter().any(|e| self.names.blamed(e) == **truth)).count();
                let more = verdict.effects.len().saturating_sub(found);
                format!("{found} right, {more} wrong")
            }
        }
    }

    fn truth_text(&self) -> String {
        let texts: Vec<String> =
            self.label.effects.iter().map(|e| format!("{}={:?}", at_place(&e.id, e.joint.as_deref()), e.magnitude.values())).collect();
        if texts.is_empty() { "none".to_owned() } else { texts.join(" + ") }
    }
}

/// A verdict in a line, with the second answer where the first is alone.
fn said_text(verdict: &Verdict, names: &Names) -> String {
    let blamed: Vec<String> =
        verdict.effects.iter().map(|e| format!("{} ({:.2})", at_place(&e.id, e.joint.as_deref()), e.probability)).collect();
    let word = verdict.verdict.name();
    let mut text = if blamed.is_empty() { word.to_owned() } else { format!("{word}: {}", blamed.join(" + ")) };
    if let Some(Some(next)) = names.answers(verdict).get(blamed.len().max(1)) {
        text += &format!(", then {}", at_place(&next.id, next.joint.as_deref()));
    }
    text
}

/// Part of a channel's gap that is closed: by effects alone, and with the file's own numbers retuned.
const CLOSED: [fn(&ChannelGap) -> Option<f64>; 2] = [|gap| gap.closed, |gap| gap.retuned.closed];

/// Mean part closed by the verdict and when told, over the channels where what is true shows.
fn closed_by_both(verdict: &[ChannelGap], told: &[ChannelGap], of: fn(&ChannelGap) -> Option<f64>) -> Option<[f64; 2]> {
    let pairs: Vec<[f64; 2]> = told
        .iter()
        .filter_map(|told| {
            let same = verdict.iter().find(|gap| gap.channel == told.channel)?;
            Some([of(same).unwrap_or(0.0), of(told).filter(|closed| *closed >= SHOWS_PART)?])
        })
        .collect();
    let mean = |side: usize| pairs.iter().map(|pair| pair[side]).sum::<f64>() / pairs.len() as f64;
    (!pairs.is_empty()).then(|| [mean(0), mean(1)])
}
