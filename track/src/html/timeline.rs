//! Why the marker was seen or not, over time: of each short time the parts of the frames by what decided about them.

use raven::plot::svg::{frame, line, rectangle, text, tick, ticks};

use crate::reason::Reason;

/// Width of the drawing, height of the bars, room for the axis [px of the page].
const WIDTH: f64 = 912.0;
const HEIGHT: f64 = 64.0;
const AXIS: f64 = 24.0;
/// Bars at most; few frames make fewer.
const BARS: usize = 228;

/// Class of a reason's colour on the page.
#[must_use]
pub const fn class(reason: Reason) -> &'static str {
    match reason {
        Reason::Seen => "r-seen",
        Reason::NoMotor => "r-motor",
        Reason::OutOfView => "r-view",
        Reason::NoColour => "r-colour",
        Reason::NoBall => "r-ball",
        Reason::Alone => "r-alone",
        Reason::RaysMiss => "r-rays",
        Reason::Elsewhere => "r-else",
    }
}

/// The reasons of one camera's frames, given with their times [s], over `[0, end_s]`.
#[must_use]
pub fn timeline(id: &str, title: &str, reasons: &[(f64, Reason)], end_s: f64) -> String {
    let end_s = end_s.max(1e-3);
    let bars = BARS.min(reasons.len()).max(1);
    let mut counts = vec![[0_usize; Reason::ALL.len()]; bars];
    for (time_s, reason) in reasons {
        let bar = ((time_s / end_s * bars as f64).max(0.0) as usize).min(bars - 1);
        if let Some(place) = Reason::ALL.iter().position(|one| one == reason) {
            counts[bar][place] += 1;
        }
    }
    let width = WIDTH / bars as f64;
    let mut inside = String::new();
    for (bar, counts) in counts.iter().enumerate() {
        let all = counts.iter().sum::<usize>() as f64;
        let mut below = HEIGHT;
        for (reason, &count) in Reason::ALL.iter().zip(counts).filter(|(_, count)| **count > 0) {
            let height = HEIGHT * count as f64 / all;
            below -= height;
            // A little wider, as bars of fractions of a pixel leave seams.
            inside += &rectangle([bar as f64 * width, below, width + 0.2, height], class(*reason));
        }
    }
    inside += &line([0.0, HEIGHT, WIDTH, HEIGHT], "axis");
    for time_s in ticks(0.0, end_s, 10) {
        let x = WIDTH * time_s / end_s;
        inside += &line([x, HEIGHT, x, HEIGHT + 4.0], "axis");
        let anchor = if x < 10.0 {
            "s"
        } else if x > WIDTH - 20.0 {
            "s e"
        } else {
            "s m"
        };
        inside += &text(x, HEIGHT + 18.0, anchor, &tick(time_s));
    }
    let seen = reasons.iter().filter(|(_, reason)| *reason == Reason::Seen).count();
    let description = format!("Of {} frames over {end_s:.1} s, {seen} show the marker.", reasons.len());
    frame(id, [WIDTH, HEIGHT + AXIS], title, &description, &inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_have_the_height_of_their_part_of_the_frames() {
        let reasons: Vec<(f64, Reason)> =
            (0..2000).map(|i| (f64::from(i) / 20.0, if i % 4 == 0 { Reason::NoBall } else { Reason::Seen })).collect();
        let svg = timeline("t", "left", &reasons, 100.0);
        assert!(svg.contains("500 show") || svg.contains("1500 show"), "{svg}");
        let heights: Vec<f64> = svg
            .split("<rect ")
            .filter(|rect| rect.contains("r-ball"))
            .filter_map(|rect| rect.split("height=\"").nth(1)?.split('"').next()?.parse().ok())
            .collect();
        let mean = heights.iter().sum::<f64>() / heights.len() as f64;
        assert!(heights.len() == 228 && (mean - 16.0).abs() < 0.5, "{mean}");
        assert!(!timeline("t", "no frames", &[], 0.0).contains("NaN"));
    }
}
