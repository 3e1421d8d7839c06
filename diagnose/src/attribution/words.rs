//! An attribution in words, for a terminal and for the page.

use std::collections::BTreeMap;
use std::fmt::Write;

use raven::plot::svg::figure;
use raven::robot::with_unit;

use super::{Attribution, Blamed, Candidate, Closure, Detectable, Estimate, FileNumber, Side, Tied, Word};

/// Candidates that a terminal shows.
const SHOWN: usize = 5;

/// Probability of a cause outside the library from which on it is spoken of where nothing remains.
const WORTH_A_WORD: f64 = 0.1;

/// Part of the gap below which effects are hardly seen in it.
const HARDLY_SEEN: f64 = 0.1;
/// Shares from here to the whole are said to be over this [%].
const NEARLY_ALL: f64 = 99.9;

/// The verdict in a sentence.
#[must_use]
pub fn sentence(attribution: &Attribution) -> String {
    let causes: Vec<String> = attribution.effects.iter().map(|effect| cause(effect, attribution)).collect();
    match attribution.verdict {
        Word::None => format!(
            "No effect is needed: the {} explains these recordings within the tolerances of its numbers.{} That there is one all the same, too \
             small to show here, has probability {:.2}.",
            held_against(attribution),
            attribution.leading().map_or_else(String::new, leads),
            attribution.probability_too_small
        ),
        Word::Explained => {
            let doubt = if attribution.probability_outside > WORTH_A_WORD {
                format!(" That takes so many effects that what is named {}.", may_stand_in(attribution))
            } else {
                String::new()
            };
            let hardly = hardly_seen(attribution);
            let whose = whose(attribution);
            format!("The gap is explained by {}{whose}; what is left looks like noise.{hardly}{doubt}", causes.join(" and "))
        }
        Word::PartlyExplained => format!(
            "The gap is explained in part by {}{}, {} of the misfit; something reproducible remains, and what is named {}.{}",
            causes.join(" and "),
            whose(attribution),
            short_of_all(attribution.misfit_accounted.unwrap_or(0.0)),
            may_stand_in(attribution),
            hardly_seen(attribution)
        ),
        Word::Unexplained => {
            let file = attribution.file_numbers.first().map_or_else(String::new, |worst| {
                let count = attribution.file_numbers.len();
                let what = at(worst.id, worst.joint.as_deref());
                let numbers = match attribution.side {
                    None => "The file has numbers that are off by more than it allows",
                    Some(_) => "Robot and simulation would have numbers further apart than the file allows",
                };
                format!(" {numbers}, {count} of them; {what} is by {:.0} tolerances.", worst.tolerances.abs())
            });
            format!("There is a gap that nothing in the library accounts for.{file}")
        }
    }
}

/// What recordings are held against.
fn held_against(attribution: &Attribution) -> &'static str {
    attribution.side.map_or("model", |_| "simulation")
}

/// Which of robot and simulation has what is named.
fn whose(attribution: &Attribution) -> &'static str {
    match attribution.side {
        None => "",
        Some(Side::Robot) => ", which the robot has and the simulation lacks",
        Some(Side::Simulation) => ", which the simulation has and the robot lacks",
    }
}

fn may_stand_in(attribution: &Attribution) -> String {
    format!("may stand in for a cause that the library does not have (probability {:.2})", attribution.probability_outside)
}

/// A share that is not the whole, and is not rounded to it either.
fn short_of_all(share: f64) -> String {
    let percent = 100.0 * share;
    match percent {
        _ if percent > NEARLY_ALL => format!("over {NEARLY_ALL} %"),
        _ if percent >= 99.5 => format!("{percent:.1} %"),
        _ => format!("{percent:.0} %"),
    }
}

/// That evidence may be large where the rms gap hardly moves, as where numbers of the file make nearly all of it, or where there is none; nothing
/// where it does move.
fn hardly_seen(attribution: &Attribution) -> String {
    let mut closed = attribution.gap.iter().filter_map(|gap| gap.closed).peekable();
    if closed.peek().is_none() && !attribution.gap.is_empty() {
        let them = if attribution.effects.len() > 1 { "them" } else { "it" };
        return format!(" But no channel has an rms gap above its noise floor: a simulation with {them} will not be seen to come closer.");
    }
    if closed.any(|closed| closed >= HARDLY_SEEN) {
        return String::new();
    }
    let retuned =
        attribution.gap.iter().filter_map(|gap| Some((&gap.channel, gap.retuned.closed.filter(|closed| *closed >= HARDLY_SEEN)?)));
    let retuned: Vec<String> = retuned.map(|(channel, closed)| format!("{:.0} % at the {channel}", 100.0 * closed)).collect();
    let (it, accounts, closes) = if attribution.effects.len() > 1 { ("they", "account", "close") } else { ("it", "accounts", "closes") };
    let retuned = if retuned.is_empty() { "no more".to_owned() } else { retuned.join(", ") };
    format!(
        " What {it} {accounts} for is hardly seen in the rms gap, of which {it} {closes} less than a tenth in every channel; with the file's numbers \
         retuned as well the gap closes by {retuned}."
    )
}

fn leads(candidate: &Candidate) -> String {
    let what = at(candidate.id, candidate.joint.as_deref());
    format!(" Of all effects {what} comes nearest, with probability {:.2}: too little to blame it.", candidate.probability)
}

/// `pulley-radius at the shoulder (relative_error -0.0518 +- 0.0004; probability 0.99)`.
fn cause(blamed: &Blamed, attribution: &Attribution) -> String {
    let what = at(blamed.id, blamed.joint.as_deref());
    let probability = together(blamed, attribution).unwrap_or_else(|| format!("{:.2}", blamed.probability));
    format!("{what} ({}; probability {probability})", blamed.numbers().join(", "))
}

/// The probability of a cause with those of the candidates that no recording can tell from it, `0.90 together with tool-length, which is the same`;
/// `None` where it has all of it alone.
#[must_use]
pub fn together(blamed: &Blamed, attribution: &Attribution) -> Option<String> {
    let candidate = |id: &str, joint: &Option<String>| attribution.candidates.iter().find(|of| of.id == id && of.joint == *joint);
    let own = candidate(blamed.id, &blamed.joint)?.probability;
    let same = blamed.ties.iter().filter(|tie| tie.exact && candidate(tie.id, &tie.joint).is_some());
    let same: Vec<String> = same.map(|tie| at(tie.id, tie.joint.as_deref())).collect();
    let is = if same.len() == 1 { "which is" } else { "which are" };
    let differs = format!("{own:.2}") != format!("{:.2}", blamed.probability);
    (differs && !same.is_empty()).then(|| format!("{:.2} together with {}, {is} the same", blamed.probability, same.join(" and ")))
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

/// A number with as many digits as its deviation gives meaning to; angles in degrees and lengths in millimetres, as gaps are.
#[must_use]
pub fn number(estimate: &Estimate) -> String {
    let Estimate { name, value, std, unit, whole, .. } = estimate;
    let (unit, scale) = displayed(unit);
    let (value, std) = (scale * value, scale * std);
    if *whole {
        return with_unit(&format!("{name} {value:.0}"), unit);
    }
    let digits = if std > 0.0 { (1.0 - std.log10().floor()).clamp(0.0, 9.0) as usize } else { 4 };
    with_unit(&format!("{name} {value:.digits$} +- {std:.digits$}"), unit)
}

/// What the evidence of a candidate is.
pub const EVIDENCE_IS: &str = "Evidence is that of the best hypothesis with the candidate, whatever else it holds, beyond none's.";

/// What it means that a candidate is set aside.
pub const SET_ASIDE_IS: &str = "What is set aside explains no more than comes about by chance, or nothing that matters beside the others.";

/// The smallest size of an effect that would have been named: `0.62 %`, `0.12 deg`, `factor 1.8`.
#[must_use]
pub fn size(least: &Detectable) -> String {
    let mut shown = least.clone();
    let (unit, scale) = displayed(&least.unit);
    (shown.unit, shown.size) = (unit.to_owned(), scale * least.size);
    let words = shown.words();
    // What is several times as large as what it is measured by, as creep may be, is no percentage.
    if least.size >= 1.0 && words.ends_with('%') { figure(least.size) } else { words }
}

/// The unit that people are shown for one of SI, and what takes the one to the other.
fn displayed(unit: &str) -> (&str, f64) {
    match unit {
        "rad" => ("deg", 180.0 / std::f64::consts::PI),
        "m" => ("mm", 1e3),
        other => (other, 1.0),
    }
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
        let aside = if candidate.set_aside { "  set aside" } else { "" };
        let _ = writeln!(text, "{:<24} {joint:<20} {:>11.3} {:>13.1}{aside}", candidate.id, candidate.probability, candidate.evidence_nats);
    }
    if attribution.candidates.iter().take(SHOWN).any(|candidate| candidate.set_aside) {
        let _ = writeln!(text, "{SET_ASIDE_IS}");
    }
    if attribution.effects.len() > 1 {
        let lost = |blamed: &Blamed| format!("{:.1} without {}", blamed.evidence_nats, at(blamed.id, blamed.joint.as_deref()));
        let lost: Vec<String> = attribution.effects.iter().map(lost).collect();
        let _ = writeln!(text, "{EVIDENCE_IS} Of what all that are named have, {} are lost.", lost.join(", "));
    }
    if !attribution.gap.is_empty() {
        let effects = if attribution.effects.is_empty() { "" } else { ", with the effects" };
        let _ = writeln!(
            text,
            "\nThe {}{effects}, and retuned: with the file's own numbers moved against their tolerances as well; each as found on other parts \
             of the recordings (rms; what is closed is part of the squared gap above the noise floor)",
            if attribution.side.is_some() { "simulation" } else { "model with the file" }
        );
        let _ = writeln!(
            text,
            "{:<17} {:>4} {:>12} {:>8} {:>8} {:>20} {:>8}",
            "channel", "unit", "noise floor", "before", "after", "closed", "retuned"
        );
        attribution.gap.iter().for_each(|gap| row(&mut text, gap));
        let worse: Vec<&str> = attribution.gap.iter().filter(|gap| grows(gap)).map(|gap| gap.channel.as_str()).collect();
        if !worse.is_empty() {
            let then = match attribution.side {
                None => " Put right what is named, and then identify the file's numbers beside it (`raven-identify`).",
                Some(_) => "",
            };
            let _ = writeln!(
                text,
                "At the {}, numbers of the file make up for what is named: with it alone the gap grows.{then}",
                worse.join(" and the ")
            );
        }
    }
    if !attribution.file_numbers.is_empty() {
        let numbers = match attribution.side {
            None => "Numbers of the file that are off by more than it allows",
            Some(_) => "Numbers that robot and simulation have apart by more than the file allows",
        };
        let _ = writeln!(text, "\n{numbers}, and by how many of their tolerances");
    }
    attribution.file_numbers.iter().for_each(|of| {
        let _ = writeln!(text, "{:>6.1}  {}", of.tolerances, off(of));
    });
    if let Some(sentence) = spread(attribution) {
        let _ = writeln!(text, "\n{sentence}");
    }
    if attribution.verdict == Word::None {
        text += &could_have_shown(attribution);
    }
    attribution.remarks.iter().for_each(|remark| {
        let _ = writeln!(text, "{remark}");
    });
    text
}

/// What part of the file's tolerances counted, where other recordings of the rig say.
fn spread(attribution: &Attribution) -> Option<String> {
    let parts: Vec<String> = attribution.tolerance_parts.parts().map(|(kind, part)| format!("{kind} {part:.2}")).collect();
    let parts = (!parts.is_empty()).then(|| parts.join(", "))?;
    Some(format!("By the other recordings of the rig, these parts of the file's tolerances count: {parts}."))
}

/// The smallest size of each effect that would have been named, place by place, and what could not be seen at all.
fn could_have_shown(attribution: &Attribution) -> String {
    let mut text = "\nWhat would have shown, from this size on\n".to_owned();
    let mut of_effects: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for least in &attribution.minimum_detectable {
        let place = least.joint.as_deref().map_or_else(String::new, |joint| format!("{joint} "));
        of_effects.entry(least.id).or_default().push(format!("{place}{}", size(least)));
    }
    of_effects.iter().for_each(|(id, sizes)| {
        let _ = writeln!(text, "{id:<24} {}", sizes.join(", "));
    });
    attribution.not_observable.iter().for_each(|of| {
        let _ = writeln!(text, "{:<24} not at all: {}", of.id, of.because);
    });
    text
}

/// Growth of a gap, as a part of it, that is worth a word.
const GROWTH_MIN: f64 = 0.01;

/// Whether the effects alone make a channel's gap larger beyond doubt, and those with the file's numbers retuned do not.
fn grows(gap: &Closure) -> bool {
    gap.closed_ci95.is_some_and(|[_, high]| high < -GROWTH_MIN) && gap.retuned.after < gap.before
}

fn row(text: &mut String, gap: &Closure) {
    let Closure { channel, unit, noise_floor, before, retuned, .. } = gap;
    let (after, closed) = if gap.held_out { (figure(gap.after), closed(gap)) } else { (String::new(), String::new()) };
    let [noise_floor, before, retuned] = [*noise_floor, *before, retuned.after].map(figure);
    let _ = writeln!(text, "{channel:<17} {unit:>4} {noise_floor:>12} {before:>8} {after:>8} {closed:>20} {retuned:>8}");
}

fn closed(gap: &Closure) -> String {
    let Some(closed) = gap.closed else { return "no gap".to_owned() };
    let interval = gap.closed_ci95.map_or_else(String::new, |[low, high]| format!(" ({} to {})", percent(low), percent(high)));
    format!("{} %{interval}", percent(closed))
}

/// A part in whole per cent; of what is nearly nothing, 0 without a sign.
#[must_use]
pub fn percent(part: f64) -> String {
    format!("{:.0}", (100.0 * part).round() + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attribution::closure::Retuned;
    use crate::attribution::detectable;
    use crate::evidence::fit::Fitter;
    use crate::evidence::numbers::coordinates::Coordinates;
    use crate::evidence::outcome::Outcome;
    use crate::evidence::tests::{Seen, tips};

    fn estimate(name: &'static str, value: f64, std: f64, unit: &str, whole: bool) -> Estimate {
        Estimate { name, value, std, unit: unit.to_owned(), aside: false, whole }
    }

    /// A wrong offset that a tool's length is the same as, and how far it closes a gap.
    fn offset(verdict: Word, closed: f64, retuned: f64) -> Attribution {
        let insertion = || Some("insertion".to_owned());
        let tie = Tied { id: "tool-length", joint: None, exact: true, gap_nats: 1.4, separate_by: "measure the tool" };
        let blamed = Blamed {
            id: "joint-offset",
            joint: insertion(),
            probability: 0.898,
            evidence_nats: 23.1,
            parameters: vec![estimate("offset", -0.00309, 0.00032, "m", false)],
            ties: vec![tie],
        };
        let candidate = |id, joint, probability| Candidate { id, joint, probability, evidence_nats: 20.0, set_aside: false };
        let gap = Closure {
            channel: "insertion torque".to_owned(),
            unit: "N m",
            noise_floor: 0.000_412,
            before: 0.002_34,
            after: 0.001_98,
            closed: Some(closed),
            closed_ci95: None,
            held_out: true,
            retuned: Retuned { after: 0.001_01, closed: Some(retuned) },
            shares: Vec::new(),
        };
        Attribution {
            effects: vec![blamed],
            misfit_accounted: Some(0.999_98),
            candidates: vec![candidate("joint-offset", insertion(), 0.72), candidate("tool-length", None, 0.178)],
            gap: vec![gap],
            ..Attribution::without_findings(verdict)
        }
    }

    #[test]
    fn effects_without_a_gap_are_said_to_close_none() {
        let mut found = offset(Word::Explained, 0.0, 0.0);
        found.gap[0].closed = None;
        assert!(sentence(&found).contains("But no channel has an rms gap above its noise floor"), "{}", sentence(&found));
    }

    #[test]
    fn the_probability_of_a_cause_is_said_with_what_is_the_same() {
        let mut found = offset(Word::Explained, 0.9, 0.9);
        assert!(sentence(&found).contains("probability 0.90 together with tool-length, which is the same)"), "{}", sentence(&found));
        found.effects[0].probability = found.candidates[0].probability;
        assert!(sentence(&found).contains("probability 0.72)"), "{}", sentence(&found));
    }

    #[test]
    fn effects_that_the_gap_hardly_shows_are_said_to_be_so() {
        let of = |closed, retuned| sentence(&offset(Word::Explained, closed, retuned));
        let said = "What it accounts for is hardly seen in the rms gap, of which it closes less than a tenth in every channel; with the file's \
                    numbers retuned as well the gap closes by 98 % at the insertion torque.";
        assert!(of(0.01, 0.98).ends_with(said), "{}", of(0.01, 0.98));
        assert!(of(-0.3, 0.02).contains("retuned as well the gap closes by no more."), "{}", of(-0.3, 0.02));
        assert!(!of(0.11, 0.98).contains("hardly"));
        let mut without_a_gap = offset(Word::PartlyExplained, 0.01, 0.98);
        assert!(sentence(&without_a_gap).contains("hardly seen"));
        without_a_gap.gap[0].closed = None;
        assert!(!sentence(&without_a_gap).contains("hardly seen"));
    }

    #[test]
    fn what_falls_short_of_all_is_not_rounded_to_it() {
        let said = sentence(&offset(Word::PartlyExplained, 0.9, 0.9));
        assert!(said.contains(", over 99.9 % of the misfit;"), "{said}");
        assert_eq!([0.72, 0.9951, 0.9994].map(short_of_all), ["72 %", "99.5 %", "over 99.9 %"]);
    }

    #[test]
    fn numbers_have_the_digits_and_units_that_say_something() {
        let text = words(&offset(Word::Explained, 0.9, 0.9));
        assert!(text.contains(" N m     0.000412  0.00234  0.00198                 90 %  0.00101\n"), "{text}");
        assert!(text.contains("moved against their tolerances"));
        assert_eq!(number(&estimate("offset", -0.00309, 0.00032, "m", false)), "offset -3.09 +- 0.32 mm");
        assert_eq!(number(&estimate("angle", 0.01, 0.001, "rad", false)), "angle 0.573 +- 0.057 deg");
        assert_eq!(number(&estimate("per_turn", 12.0, 0.0, "1", true)), "per_turn 12");
    }

    #[test]
    fn sizes_are_in_the_units_of_gaps() {
        let rows = Seen::new(&[("joint-offset", [0, 0])], |numbers: &[Option<&[f64]>], _| {
            tips(|k| k.sin() * (0.9 - numbers[0].map_or(0.0, |u| u[0])))
        });
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let none = fitter.fit(&[], &fitter.nowhere(), None).unwrap().unwrap();
        let mut least = detectable::smallest(&fitter, &Outcome::begun(none, 1)).unwrap()[0].detectable(&fitter).unwrap();
        let mut said = |value: f64, unit: &str| {
            (least.size, least.unit) = (value, unit.to_owned());
            size(&least)
        };
        assert_eq!(said(0.01, "rad"), "0.573 deg");
        assert_eq!(said(0.0018, "m"), "1.80 mm");
        assert_eq!(said(0.0062, "1"), "0.620 %");
        assert_eq!(said(6.35, "1"), "6.35");
    }

    #[test]
    fn places_are_named_as_they_are_called() {
        assert_eq!(at("pulley-radius", Some("shoulder")), "pulley-radius at the shoulder");
        assert_eq!(at("link-angle", Some("12")), "link-angle 12");
        assert_eq!(at("payload", None), "payload");
    }
}
