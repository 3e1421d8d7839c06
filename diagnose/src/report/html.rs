//! The page as HTML.

use raven::plot::page::document;
use raven::plot::svg::{escape, figure};

use super::{Candidate, Page, bars, traces};
use crate::attribution::{EVIDENCE_IS, NONE, SET_ASIDE_IS};
use crate::gap::{LONG_HORIZONS, MotorMotion, driven_by};

/// Candidates listed.
const CANDIDATES: usize = 10;
/// The place of what belongs to no joint.
const WHOLE: &str = "whole set-up";

/// What the table of tolerances has.
const TOLERANCES_ARE: &str =
    "The part of what the robot file says its numbers may be off by that counts, as the other recordings of the rig show it.";

const STYLE: &str = include_str!("style.css");

/// The page as one HTML document that needs nothing else.
#[must_use]
pub fn html(page: &Page) -> String {
    let has_after = page.gaps.iter().any(|gap| gap.after.is_some()) || page.traces.iter().any(|trace| !trace.after.is_empty());
    let body = [
        header(page),
        section("The gap", &legend(has_after, "noise floor"), page.gaps.is_empty(), || figure_of(&bars::gaps(&page.gaps))),
        section("What causes it", "", page.candidates.is_empty(), || candidates(&page.candidates)),
        section("Where it lies", "", page.places.is_empty(), || list("ul", &page.places)),
        section("Motors driven by their torque", "", page.motors.is_empty(), || motors(page)),
        section("Residuals by phase", &legend(has_after, "noise floor"), page.phases.is_empty(), || phases(page)),
        section("Residuals over time", &legend(has_after, "two deviations of the noise"), page.traces.is_empty(), || {
            page.traces.iter().enumerate().map(|(k, trace)| figure_of(&traces::trace(k, trace))).collect()
        }),
        section("What cannot be told apart", "", page.ties.is_empty(), || list("ul", &page.ties)),
        section(file_numbers_are(page), "", page.file_numbers.is_empty(), || list("ul", &page.file_numbers)),
        section("What counts of the file's tolerances", "", page.tolerance_parts.is_empty(), || tolerance_parts(&page.tolerance_parts)),
        section("What to do next", "", page.next_steps.is_empty(), || list("ol", &page.next_steps)),
        section("What could have been seen", "", page.detectable.is_empty() && page.not_observable.is_empty(), || sensitivity(page)),
        section("Recordings", "", page.recordings.is_empty(), || list("ul class=\"files\"", &page.recordings)),
    ]
    .concat();
    document(&format!("{} - diagnosis", page.title), STYLE, &body)
}

fn file_numbers_are(page: &Page) -> &'static str {
    if page.is_against { "What robot and simulation have apart" } else { "What the robot file has wrong" }
}

fn header(page: &Page) -> String {
    let word = if page.verdict.is_empty() { String::new() } else { format!(" <span class=\"tag\">{}</span>", escape(&page.verdict)) };
    let remarks: String = page.remarks.iter().map(|remark| format!("<p>{}</p>\n", escape(remark))).collect();
    format!(
        "<header>\n<p class=\"over\">Sim-to-real diagnosis of {}{word}</p>\n<h1>{}</h1>\n{remarks}</header>\n",
        escape(&page.title),
        escape(&page.verdict_sentence)
    )
}

fn section(heading: &str, aside: &str, empty: bool, content: impl FnOnce() -> String) -> String {
    if empty {
        return String::new();
    }
    format!("<section>\n<h2>{}{aside}</h2>\n{}\n</section>\n", escape(heading), content())
}

fn legend(has_after: bool, noise: &str) -> String {
    let (before, after) = if has_after { ("before", "<span class=\"key k-after\"></span>after") } else { ("error", "") };
    let noise_class = if noise == "noise floor" { "k-floor" } else { "k-band" };
    format!(
        "<span class=\"legend\"><span class=\"key k-before\"></span>{before}{after}<span class=\"key {noise_class}\"></span>{}</span>",
        escape(noise)
    )
}

fn figure_of(svg: &str) -> String {
    format!("<figure>{svg}</figure>\n")
}

fn list(tag: &str, items: &[String]) -> String {
    let name = tag.split(' ').next().unwrap_or(tag);
    let items: String = items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
    format!("<{tag}>\n{items}</{name}>")
}

fn phases(page: &Page) -> String {
    let one = |(k, of_channel): (usize, &super::PhaseBars)| {
        format!("<figure><figcaption>{}</figcaption>{}</figure>\n", escape(&of_channel.channel), bars::phases(k, of_channel))
    };
    format!("<div class=\"grid\">\n{}</div>", page.phases.iter().enumerate().map(one).collect::<String>())
}

fn candidates(candidates: &[Candidate]) -> String {
    let row = |c: &Candidate| {
        let percent = 100.0 * c.probability.clamp(0.0, 1.0);
        let shown = if percent > 0.0 && percent < 0.1 { "&lt; 0.1 %".to_owned() } else { format!("{percent:.1} %") };
        format!(
            "<tr{}><td class=\"name\">{}</td><td class=\"name\">{}</td><td class=\"bar\"><span style=\"width:{percent:.1}%\"></span></td>\
             <td class=\"n\">{shown}</td><td class=\"n\">{:.1}</td><td>{}</td></tr>\n",
            if c.chosen { " class=\"chosen\"" } else { "" },
            escape(&c.effect),
            escape(c.joint.as_deref().unwrap_or(if c.effect == NONE { "" } else { WHOLE })),
            c.evidence_nats,
            if c.set_aside {
                "set aside".to_owned()
            } else {
                escape(&c.parameters.iter().chain(&c.together).map(String::as_str).collect::<Vec<_>>().join(", "))
            }
        )
    };
    let rows: String = candidates.iter().take(CANDIDATES).map(row).collect();
    let rest = candidates.len().saturating_sub(CANDIDATES);
    let aside = if candidates.iter().take(CANDIDATES).any(|c| c.set_aside) { format!(" {SET_ASIDE_IS}") } else { String::new() };
    let more = if rest > 0 { format!("<p class=\"small\">{rest} more are less likely.</p>") } else { String::new() };
    format!(
        "<table>\n<thead><tr><th scope=\"col\">effect</th><th scope=\"col\">joint</th><th scope=\"col\" colspan=\"2\">probability</th>\
         <th scope=\"col\" class=\"n\">evidence [nat]</th><th scope=\"col\">numbers</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>{more}\n\
         <p class=\"small\">{EVIDENCE_IS}{aside}</p>"
    )
}

/// A line per joint, a column per horizon.
fn motors(page: &Page) -> String {
    let torque = driven_by(page.is_against);
    let of_joints: Vec<&[MotorMotion]> = page.motors.chunk_by(|a, b| a.joint == b.joint).collect();
    let heads =
        |first: &&[MotorMotion]| first.iter().map(|m| format!("<th scope=\"col\" class=\"n\">after {} s</th>", m.horizon_s)).collect();
    // A short recording has no long horizons.
    let heads: String = of_joints.iter().max_by_key(|of_joint| of_joint.len()).map_or_else(String::new, heads);
    let row = |of_joint: &[MotorMotion]| {
        let numbers: String = of_joint.iter().map(|m| format!("<td class=\"n\">{}</td>", figure(m.rms))).collect();
        of_joint.first().map(|m| format!("<tr><td>{}</td><td>{}</td>{numbers}</tr>\n", escape(&m.joint), escape(m.unit)))
    };
    let rows: String = of_joints.into_iter().filter_map(row).collect();
    format!(
        "<table class=\"narrow\">\n<thead><tr><th scope=\"col\">joint</th><th scope=\"col\">unit</th>{heads}</tr></thead>\n<tbody>\n{rows}</tbody>\n\
         </table>\n<p class=\"small\">How far motors that {torque} drives through the model come from where they were recorded (rms, at the joint). \
         {LONG_HORIZONS}</p>"
    )
}

fn tolerance_parts(parts: &[(String, f64)]) -> String {
    let row = |(kind, part): &(String, f64)| format!("<tr><td>{}</td><td class=\"n\">{:.0} %</td></tr>\n", escape(kind), 100.0 * part);
    let rows: String = parts.iter().map(row).collect();
    format!(
        "<table class=\"narrow\">\n<thead><tr><th scope=\"col\">numbers about</th><th scope=\"col\" class=\"n\">counts</th></tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n<p class=\"small\">{TOLERANCES_ARE}</p>"
    )
}

fn sensitivity(page: &Page) -> String {
    let mut content = String::new();
    if !page.detectable.is_empty() {
        let row = |d: &super::Detectable| {
            let joint = d.joint.as_deref().unwrap_or(WHOLE);
            format!("<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td></tr>\n", escape(&d.effect), escape(joint), escape(&d.size))
        };
        let rows: String = page.detectable.iter().map(row).collect();
        content += &format!(
            "<table class=\"narrow\">\n<thead><tr><th scope=\"col\">effect</th><th scope=\"col\">joint</th>\
             <th scope=\"col\" class=\"n\">shows from</th></tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n"
        );
    }
    if !page.not_observable.is_empty() {
        let items: String =
            page.not_observable.iter().map(|(id, because)| format!("<li><b>{}</b>: {}</li>\n", escape(id), escape(because))).collect();
        content += &format!("<p>Not observable here:</p>\n<ul>\n{items}</ul>");
    }
    content
}

#[cfg(test)]
mod tests {
    use super::super::sample::sample;
    use super::*;

    #[test]
    fn the_page_holds_every_part_and_needs_nothing_else() {
        let page = html(&sample());
        for part in [
            "pulley-radius",
            "What to do next",
            "Residuals over time",
            "95 %: 95 to 98 %",
            "class=\"chosen\"",
            "shows from",
            "sign was turned",
            "0.996 together with capstan-radius",
            "after 0.2 s</th>",
            "<td>shoulder</td><td>deg</td><td class=\"n\">0.00412</td>",
            "torque integrated twice",
            "<td>tool-length</td><td class=\"n\">31 %</td>",
        ] {
            assert!(page.contains(part), "{part}");
        }
        // The name space of SVG is a name, not a place.
        let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!elsewhere.contains("http") && !elsewhere.contains("url(") && !page.contains("<script") && !page.contains("NaN"));
        assert_eq!(page.matches("<svg").count(), page.matches("</desc>").count());
        let ids: Vec<&str> = page.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        let distinct: std::collections::BTreeSet<&str> = ids.iter().copied().collect();
        assert_eq!(ids.len(), distinct.len(), "{ids:?}");
        if let Some(folder) = std::env::var_os("RAVEN_SAMPLE_DIR") {
            std::fs::write(std::path::Path::new(&folder).join("report.html"), page).unwrap();
        }
    }

    #[test]
    fn text_from_files_stays_text() {
        let mut page = sample();
        let bad = "<img src=x onerror=\"alert(1)\">".to_owned();
        page.title.clone_from(&bad);
        page.verdict.clone_from(&bad);
        page.verdict_sentence.clone_from(&bad);
        page.recordings = vec![bad.clone()];
        page.places = vec![bad.clone()];
        page.ties = vec![bad.clone()];
        page.next_steps = vec![bad.clone()];
        page.file_numbers = vec![bad.clone()];
        page.tolerance_parts = vec![(bad.clone(), 1.0)];
        page.not_observable = vec![(bad.clone(), bad.clone())];
        for gap in &mut page.gaps {
            (gap.channel, gap.unit) = (bad.clone(), bad.clone());
        }
        for candidate in &mut page.candidates {
            (candidate.effect, candidate.joint, candidate.parameters) = (bad.clone(), Some(bad.clone()), vec![bad.clone()]);
        }
        for trace in &mut page.traces {
            (trace.channel, trace.unit) = (bad.clone(), bad.clone());
        }
        for phases in &mut page.phases {
            (phases.channel, phases.unit) = (bad.clone(), bad.clone());
            phases.phases.iter_mut().for_each(|p| p.phase.clone_from(&bad));
        }
        page.candidates.iter_mut().for_each(|candidate| candidate.together = Some(bad.clone()));
        page.motors.iter_mut().for_each(|m| m.joint.clone_from(&bad));
        page.remarks = vec![bad.clone()];
        for d in &mut page.detectable {
            (d.effect, d.joint, d.size) = (bad.clone(), Some(bad.clone()), bad.clone());
        }
        assert!(!html(&page).contains("<img"));
    }

    #[test]
    fn what_is_empty_is_left_out() {
        let page = html(&Page { title: "raven".to_owned(), verdict_sentence: "No effect is needed.".to_owned(), ..Page::default() });
        assert!(page.contains("No effect is needed.") && !page.contains("<section") && !page.contains("<svg"));
    }
}
