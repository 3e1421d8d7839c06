//! The page with what the recordings say of causes.

use super::{Candidate, Detectable, GapBar, Page, remaining};
use crate::attribution::{Attribution, FileNumber, Remaining, at, off, sentence, tied};

/// A torque is drawn where the effects close at least this part of its gap: it is there in any case, and mostly tells nothing.
const TORQUE_CLOSED: f64 = 0.05;

/// Adds verdict, candidates, closure, ties and sizes to the page of a gap.
pub fn add_causes(page: &mut Page, attribution: &Attribution) {
    page.verdict = attribution.verdict.name().to_owned();
    page.verdict_sentence = sentence(attribution);
    page.remarks.extend(attribution.remarks.iter().cloned());
    page.gaps = attribution.gap.iter().map(bar).collect();
    if !attribution.effects.is_empty() {
        let shown = |remaining: &&Remaining| !remaining.of_drive || closes(attribution, &remaining.channel);
        let shown: Vec<&Remaining> = attribution.remaining.iter().filter(shown).collect();
        page.traces = shown.iter().map(|of_channel| remaining::trace(of_channel)).collect();
        page.phases = shown.iter().map(|of_channel| remaining::phases(of_channel)).collect();
    }
    let blamed = |candidate: &crate::attribution::Candidate| {
        attribution.effects.iter().find(|effect| effect.id == candidate.id && effect.joint == candidate.joint)
    };
    let shown = |candidate: &crate::attribution::Candidate| Candidate {
        effect: candidate.id.to_owned(),
        joint: candidate.joint.clone(),
        // Of one that is named, together with what no recording can tell from it.
        probability: blamed(candidate).map_or(candidate.probability, |effect| effect.probability),
        evidence_nats: candidate.evidence_nats,
        parameters: blamed(candidate).map_or_else(Vec::new, |effect| effect.numbers()),
        chosen: blamed(candidate).is_some(),
    };
    page.candidates = attribution.candidates.iter().map(shown).collect();
    for effect in &attribution.effects {
        for tie in &effect.ties {
            let (this, other) = (at(effect.id, effect.joint.as_deref()), at(tie.id, tie.joint.as_deref()));
            page.ties.push(format!("Beside {this}: {}.", tied(tie)));
            page.next_steps.push(format!("To tell {this} from {other}: {}.", tie.separate_by));
        }
        page.next_steps.push(format!(
            "Put {} into the robot file with `raven-identify --add-effect {}` and look again.",
            at(effect.id, effect.joint.as_deref()),
            raven::effects::at_place(effect.id, effect.joint.as_deref())
        ));
    }
    let file_number = |of: &FileNumber| format!("{}, {:.1} of its tolerances off.", off(of), of.tolerances.abs());
    page.file_numbers = attribution.file_numbers.iter().map(file_number).collect();
    let detectable = attribution
        .minimum_detectable
        .iter()
        .filter_map(|least| Some(Detectable { effect: least.id.to_owned(), joint: least.joint.clone(), size: least.words()? }));
    page.detectable = detectable.collect();
    page.not_observable = attribution.not_observable.iter().map(|none| (none.id.to_owned(), none.because.clone())).collect();
}

/// Whether the effects close part of a channel's gap, beyond chance.
fn closes(attribution: &Attribution, channel: &str) -> bool {
    let of_channel = attribution.gap.iter().find(|gap| gap.channel == channel);
    of_channel.and_then(|gap| gap.closed.zip(gap.closed_ci95)).is_some_and(|(closed, [low, _])| closed >= TORQUE_CLOSED && low > 0.0)
}

fn bar(gap: &crate::attribution::Closure) -> GapBar {
    GapBar {
        channel: gap.channel.clone(),
        unit: gap.unit.to_owned(),
        noise_floor: gap.noise_floor,
        before: gap.before,
        after: gap.held_out.then_some(gap.after),
        closed: gap.closed.zip(gap.closed_ci95),
        retuned: Some(gap.retuned.after),
    }
}
