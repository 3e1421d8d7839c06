//! An attribution in words, for a terminal and for the page.

use std::fmt::Write;

use super::{Attribution, Blamed, Candidate, Closure, Estimate, Word};

/// Ties, candidates and sizes that a terminal shows.
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
            let doubt = if attribution.probability_outside > WORTH_A_WORD { stands_in(attribution) } else { String::new() };
            format!("The gap is explained by {}; what is left looks like noise.{doubt}", causes.join(" and "))
        }
        Word::PartlyExplained => format!(
            "The gap is explained in part by {}, {:.0} % of the misfit; something reproducible remains, and what is named may stand in for a \
             cause that the library does not have (probability {:.2}).",
            causes.join(" and "),
            100.0 * attribution.misfit_accounted.unwrap_or(0.0),
            attribution.probability_outside
        ),
        Word::Unexplained => "There is a gap that nothing in the library accounts for.".to_owned(),
    }
}

fn stands_in(attribution: &Attribution) -> String {
    let probability = attribution.probability_outside;
    format!(" That takes so many effects that they may stand in for a cause that the library does not have (probability {probability:.2}).")
}

fn leads(candidate: &Candidate) -> String {
    let what = at(candidate.id, candidate.joint.as_deref());
    format!(" {what} would explain them a little better and has probability {:.2}: too little to blame it.", candidate.probability)
}

/// `pulley-radius at the shoulder (relative_error -0.0518 +- 0.0004)`.
fn cause(blamed: &Blamed) -> String {
    format!("{} ({})", at(blamed.id, blamed.joint.as_deref()), blamed.numbers().join(", "))
}

/// An effect at its place: `pulley-radius at the shoulder`.
#[must_use]
pub fn at(id: &str, joint: Option<&str>) -> String {
    joint.map_or_else(|| id.to_owned(), |joint| format!("{id} at the {joint}"))
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
            let what = if tie.exact { "cannot be told from it" } else { "does nearly as well" };
            let _ = writeln!(
                text,
                "  {} {what} ({:.1} nats less); to tell them apart: {}.",
                at(tie.id, tie.joint.as_deref()),
                tie.gap_nats,
                tie.separate_by
            );
        }
    }
    let _ = writeln!(text, "\n{:<24} {:<20} {:>11} {:>13}", "candidate", "joint", "probability", "evidence/nats");
    for candidate in attribution.candidates.iter().take(SHOWN) {
        let joint = candidate.joint.as_deref().unwrap_or("");
        let _ = writeln!(text, "{:<24} {joint:<20} {:>11.3} {:>13.1}", candidate.id, candidate.probability, candidate.evidence_nats);
    }
    if attribution.gap.iter().any(|gap| gap.held_out) {
        let _ = writeln!(text, "\nThe model with the file, and with the effects as found on other parts of the recordings (rms)");
        let _ = writeln!(text, "{:<17} {:>4} {:>12} {:>8} {:>8}  closed", "channel", "unit", "noise floor", "before", "after");
        attribution.gap.iter().for_each(|gap| row(&mut text, gap));
    }
    attribution.remarks.iter().for_each(|remark| {
        let _ = writeln!(text, "{remark}");
    });
    text
}

fn row(text: &mut String, gap: &Closure) {
    let Closure { channel, unit, noise_floor, before, after, closed, closed_ci95, .. } = gap;
    let closed = closed.map_or_else(
        || "no gap".to_owned(),
        |closed| {
            let interval = closed_ci95.map_or_else(String::new, |[low, high]| format!(" ({:.0} to {:.0})", 100.0 * low, 100.0 * high));
            format!("{:.0} %{interval}", 100.0 * closed)
        },
    );
    let _ = writeln!(text, "{channel:<17} {unit:>4} {noise_floor:>12.3} {before:>8.3} {after:>8.3}  {closed}");
}
