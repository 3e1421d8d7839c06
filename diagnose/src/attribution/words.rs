//! An attribution in words, for a terminal and for the page.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{Attribution, Blamed, Candidate, Closure, Estimate, FileNumber, Tied, Word};

/// Candidates that a terminal shows.
const SHOWN: usize = 5;

/// Probability of a cause outside the library from which on it is spoken of where nothing remains.
const WORTH_A_WORD: f64 = 0.1;

/// The verdict in a sentence.
#[must_use]
pub fn sentence(attribution: &Attribution) -> String {
    let causes: Vec<String> = attribution.effects.iter().map(cause).collect();
    match attribution.verdict {
        Word::None => format!(
            "No effect is needed: the model explains these recordings within the tolerances of its numbers.{} That there is one all the same, too \
             small to show here, has probability {:.2}.",
            attribution.leading().map_or_else(String::new, leads),
            attribution.probability_too_small
        ),
        Word::Explained => {
            let doubt = if attribution.probability_outside > WORTH_A_WORD {
                format!(" That takes so many effects that what is named {}.", may_stand_in(attribution))
            } else {
                String::new()
            };
            format!("The gap is explained by {}; what is left looks like noise.{doubt}", causes.join(" and "))
        }
        Word::PartlyExplained => format!(
            "The gap is explained in part by {}, {:.0} % of the misfit; something reproducible remains, and what is named {}.",
            causes.join(" and "),
            100.0 * attribution.misfit_accounted.unwrap_or(0.0),
            may_stand_in(attribution)
        ),
        Word::Unexplained => {
            let file = attribution.file_numbers.first().map_or_else(String::new, |worst| {
                let count = attribution.file_numbers.len();
                let what = at(worst.id, worst.joint.as_deref());
                format!(
                    " The file has numbers that are off by more than it allows, {count} of them; {what} is by {:.0} tolerances.",
                    worst.tolerances.abs()
                )
            });
            format!("There is a gap that nothing in the library accounts for.{file}")
        }
    }
}

fn may_stand_in(attribution: &Attribution) -> String {
    format!("may stand in for a cause that the library does not have (probability {:.2})", attribution.probability_outside)
}

fn leads(candidate: &Candidate) -> String {
    let what = at(candidate.id, candidate.joint.as_deref());
    format!(" Of all effects {what} comes nearest, with probability {:.2}: too little to blame it.", candidate.probability)
}

/// `pulley-radius at the shoulder (relative_error -0.0518 +- 0.0004; probability 0.99)`.
fn cause(blamed: &Blamed) -> String {
    let what = at(blamed.id, blamed.joint.as_deref());
    format!("{what} ({}; probability {:.2})", blamed.numbers().join(", "), blamed.probability)
}

/// What is tied with a cause: `joint-offset at the insertion cannot be told from it`.
#[must_use]
pub fn tied(tie: &Tied) -> String {
    let does = match tie.gap_nats {
        _ if tie.exact => "cannot be told from it".to_owned(),
        gap if gap > 0.0 => format!("does nearly as well ({gap:.1} nats less)"),
        _ => "does as well".to_owned(),
    };
    format!("{} {does}", at(tie.id, tie.joint.as_deref()))
}

/// An effect at its place: `pulley-radius at the shoulder`, `link-angle 12`.
#[must_use]
pub fn at(id: &str, joint: Option<&str>) -> String {
    let is_number = |place: &str| place.bytes().all(|byte| byte.is_ascii_digit());
    match joint {
        None => id.to_owned(),
        Some(place) if is_number(place) => format!("{id} {place}"),
        Some(joint) => format!("{id} at the {joint}"),
    }
}

/// `motor-coulomb-friction at the elbow: factor 0.62 +- 0.05`.
#[must_use]
pub fn off(of: &FileNumber) -> String {
    format!("{}: {}", at(of.id, of.joint.as_deref()), number(&of.estimate))
}

/// A number with as many digits as its deviation gives meaning to.
#[must_use]
pub fn number(estimate: &Estimate) -> String {
    let Estimate { name, value, std, unit, .. } = estimate;
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let digits = if *std > 0.0 { (1.0 - std.log10().floor()).clamp(0.0, 9.0) as usize } else { 4 };
    format!("{name} {value:.digits$} +- {std:.digits$}{unit}")
}

/// Verdict, causes with their ties, how far the gap closes, and what could have shown.
#[must_use]
pub fn words(attribution: &Attribution) -> String {
    let mut text = format!("Verdict: {}. {}\n", attribution.verdict.name(), sentence(attribution));
    for blamed in &attribution.effects {
        for tie in &blamed.ties {
            let _ = writeln!(text, "  {}; to tell them apart: {}.", tied(tie), tie.separate_by);
        }
    }
    let _ = writeln!(text, "\n{:<24} {:<20} {:>11} {:>13}", "candidate", "joint", "probability", "evidence/nats");
    for candidate in attribution.candidates.iter().take(SHOWN) {
        let joint = candidate.joint.as_deref().unwrap_or("");
        let _ = writeln!(text, "{:<24} {joint:<20} {:>11.3} {:>13.1}", candidate.id, candidate.probability, candidate.evidence_nats);
    }
    if !attribution.gap.is_empty() {
        let effects = if attribution.effects.is_empty() { "" } else { ", with the effects" };
        let _ = writeln!(
            text,
            "\nThe model with the file{effects}, and retuned: with the file's own numbers moved within their tolerances as well; each as found \
             on other parts of the recordings (rms)"
        );
        let _ = writeln!(
            text,
            "{:<17} {:>4} {:>12} {:>8} {:>8} {:>20} {:>8}",
            "channel", "unit", "noise floor", "before", "after", "closed", "retuned"
        );
        attribution.gap.iter().for_each(|gap| row(&mut text, gap));
        if let Some(worse) = attribution.gap.iter().find(|gap| grows(gap)) {
            let _ = writeln!(
                text,
                "At the {}, numbers of the file make up for what is named: with it alone the gap grows. Fit them together \
                 (`raven-identify --add-effect`).",
                worse.channel
            );
        }
    }
    if !attribution.file_numbers.is_empty() {
        let _ = writeln!(text, "\nNumbers of the file that are off by more than it allows, and by how many of their tolerances");
    }
    attribution.file_numbers.iter().for_each(|of| {
        let _ = writeln!(text, "{:>6.1}  {}", of.tolerances, off(of));
    });
    if attribution.verdict == Word::None {
        text += &could_have_shown(attribution);
    }
    attribution.remarks.iter().for_each(|remark| {
        let _ = writeln!(text, "{remark}");
    });
    text
}

/// The smallest size of each effect that would have been named, place by place, and what could not be seen at all.
fn could_have_shown(attribution: &Attribution) -> String {
    let mut text = "\nWhat would have shown, from this size on\n".to_owned();
    let mut of_effects: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for least in &attribution.minimum_detectable {
        let place = least.joint.as_deref().map_or_else(String::new, |joint| format!("{joint} "));
        let size = least.words().unwrap_or_else(|| "at no size".to_owned());
        of_effects.entry(least.id).or_default().push(format!("{place}{size}"));
    }
    of_effects.iter().for_each(|(id, sizes)| {
        let _ = writeln!(text, "{id:<24} {}", sizes.join(", "));
    });
    attribution.not_observable.iter().for_each(|of| {
        let _ = writeln!(text, "{:<24} not at all: {}", of.id, of.because);
    });
    text
}

/// Whether the effects alone make a channel's gap larger beyond doubt, and those with the file's numbers retuned do not.
fn grows(gap: &Closure) -> bool {
    gap.closed_ci95.is_some_and(|[_, high]| high < 0.0) && gap.retuned.after < gap.before
}

fn row(text: &mut String, gap: &Closure) {
    let Closure { channel, unit, noise_floor, before, retuned, .. } = gap;
    let (after, closed) = if gap.held_out { (format!("{:.3}", gap.after), closed(gap)) } else { (String::new(), String::new()) };
    let _ = writeln!(text, "{channel:<17} {unit:>4} {noise_floor:>12.3} {before:>8.3} {after:>8} {closed:>20} {:>8.3}", retuned.after);
}

fn closed(gap: &Closure) -> String {
    let Some(closed) = gap.closed else { return "no gap".to_owned() };
    let interval = gap.closed_ci95.map_or_else(String::new, |[low, high]| format!(" ({:.0} to {:.0})", 100.0 * low, 100.0 * high));
    format!("{:.0} %{interval}", 100.0 * closed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_named_as_they_are_called() {
        assert_eq!(at("pulley-radius", Some("shoulder")), "pulley-radius at the shoulder");
        assert_eq!(at("link-angle", Some("12")), "link-angle 12");
        assert_eq!(at("payload", None), "payload");
    }
}
