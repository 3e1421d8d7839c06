//! What a tracking run is worth, in sentences.

use raven::log::TipStatus;
use raven::stats::median;

use super::Page;
use crate::report::{Missing, Report};

/// The verdict.
#[must_use]
pub fn heading(report: &Report) -> String {
    let share = 100.0 * report.seen as f64 / report.pairs.max(1) as f64;
    if report.seen == 0 {
        return format!("The tip was never seen in {} frames", report.pairs);
    }
    let rest: Vec<String> = [(report.occluded, "hidden"), (report.jumped, "rejected")]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, word)| format!("{word} in {count}"))
        .collect();
    let rest = if rest.is_empty() { String::new() } else { format!(", {}", rest.join(", ")) };
    format!("The tip was seen in {} of {} frames ({share:.1} %){rest}", report.seen, report.pairs)
}

/// What the verdict means, and whether each sentence is a warning.
#[must_use]
pub fn sentences(page: &Page<'_>) -> Vec<(String, bool)> {
    let report = page.report;
    let mut all = Vec::new();
    if report.seen == 0 {
        let advice = "Look at the pictures below: a marker without a yellow outline has another colour than --hue, --min-saturation and \
                      --min-value say; one with an outline has another size than --marker-radius; a region beside the marker means a wrong \
                      registration or robot file.";
        all.push((advice.to_owned(), true));
    }
    if let Some(sentence) = known(page) {
        all.push((sentence, false));
    }
    if let Some((seconds, from_s)) = longest_without(page).filter(|_| report.seen > 0) {
        all.push((
            format!("The longest time without a tip is {seconds:.2} s, from {from_s:.2} s on: a filter has only the motors then."),
            false,
        ));
    }
    if report.occluded > 0 {
        let sentence = format!(
            "In {} frames at least one camera did not show the whole marker: something was before it, or it had left the image.",
            report.occluded
        );
        all.push((sentence, false));
    }
    if report.jumped > 0 {
        let sentence = format!(
            "In {} frames a ball was found where the marker cannot be, and was not used. Where the rejected pictures show the marker itself, \
             registration, latency or robot file are off; where they show something else, cover it.",
            report.jumped
        );
        all.push((sentence, true));
    }
    for (count, what) in [
        (report.frames_undecodable, "were cut off or could not be decoded"),
        (report.frames_other_size, "have another size than was calibrated"),
        (report.frames_out_of_order, "have a stamp that is not after that of the frame before"),
        (report.frames_without_motor, "have no motor angles at their time"),
        (report.frames_out_of_view, "have the tip out of the camera's view, by the motors and the registration"),
    ] {
        if count > 0 {
            all.push((format!("{count} frames {what}."), true));
        }
    }
    for Missing { camera, from_s, seconds } in &report.missing {
        all.push((format!("The {} camera sent nothing for {seconds:.1} s, from {from_s:.1} s on.", camera.name()), true));
    }
    all.extend(report.unusable.iter().map(|sentence| (sentence.clone(), true)));
    all
}

/// How well a tip is known, by itself and with what all of them share.
fn known(page: &Page<'_>) -> Option<String> {
    let of = |axis: usize| {
        let stds: Vec<f64> =
            page.tips.iter().filter(|tip| tip.status == TipStatus::Seen).map(|tip| 1e3 * tip.covariance_m2[(axis, axis)].sqrt()).collect();
        median(&stds)
    };
    let [x, y, z] = [of(0)?, of(1)?, of(2)?];
    let alone = format!("A tip is known to ({x:.2}, {y:.2}, {z:.2}) mm in the median, one deviation along the axes of frame 0");
    Some(match page.shared_m2 {
        Some(shared) => {
            let [x, y, z] = [0, 1, 2].map(|axis| 1e3 * shared[(axis, axis)].sqrt());
            format!(
                "{alone}, from what differs between frames; calibration and registration, which all tips share, add ({x:.2}, {y:.2}, {z:.2}) mm."
            )
        }
        None => format!("{alone}."),
    })
}

/// Length and beginning of the longest time between two tips that were seen, or one of them and an end of the recording [s].
fn longest_without(page: &Page<'_>) -> Option<(f64, f64)> {
    let (first, last) = (page.tips.first()?, page.tips.last()?);
    let seen = page.tips.iter().filter(|tip| tip.status == TipStatus::Seen);
    let times: Vec<f64> = [first].into_iter().chain(seen).chain([last]).map(|tip| page.album.seconds(tip.stamp)).collect();
    times.windows(2).map(|pair| (pair[1] - pair[0], pair[0])).max_by(|a, b| a.0.total_cmp(&b.0))
}
