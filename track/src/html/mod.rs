//! A tracking run on one page: what it is worth in sentences, tracks and reasons over time, how well tips are known, and pictures.

mod album;
mod sample;
mod summary;
mod tile;
mod timeline;

use nalgebra::Matrix3;
use raven::Result;
use raven::log::{Side, TipObservation};
use raven::plot::page::{document, grid, section, sentences};
use raven::plot::svg::escape;
use raven::plot::{Mark, Panel, Series, panels};

pub use album::Album;
use album::OfCamera;

use crate::reason::Reason;
use crate::report::Report;
use crate::tracker::{Record, Sighting};

const STYLE: &str = include_str!("page.css");

/// What the page shows.
pub struct Page<'a> {
    /// Name of the recording.
    pub recording: &'a str,
    /// What was counted.
    pub report: &'a Report,
    /// The observations.
    pub tips: &'a [TipObservation],
    /// What was seen in the frames of each camera.
    pub records: &'a [Vec<Record>; 2],
    /// Covariance that all observations share [m^2], if there are any.
    pub shared_m2: Option<Matrix3<f64>>,
    /// Pictures and reasons.
    pub album: Album,
}

/// The page as one HTML document that needs nothing else.
///
/// # Errors
/// If a plot cannot be drawn.
pub fn html(page: Page<'_>) -> Result<String> {
    let (records, report) = (page.records, page.report);
    let seconds = |record: &Record| page.album.seconds(record.stamp);
    let tracks = Side::BOTH.map(|side| track(side, &records[side as usize], &seconds));
    let known = page.tips.iter().map(|tip| (page.album.seconds(tip.stamp), tip.covariance_m2));
    let known = deviations(&known.collect::<Vec<_>>());
    let (heading, list) = (summary::heading(report), summary::sentences(&page));
    let end_s = records.iter().flatten().map(seconds).fold(0.0, f64::max);
    let cameras = page.album.into_cameras();
    let mut body = format!("<header>\n<h1>{}</h1>\n</header>\n", escape(&heading));
    body += &section("What it means", "", &sentences(list.iter().map(|(text, warning)| (text.as_str(), *warning))));
    body += &section("The numbers", "", &format!("<pre>{}</pre>", escape(&format!("{}\n\n{report}", page.recording))));
    body += &section("Where the marker was in the images", "A hole is a time in which it was not seen.", &plots(&tracks)?);
    body += &section(
        "Why it was seen or not",
        "Of all frames of a camera, over time [s], the parts by what decided about them.",
        &reasons(&cameras, end_s),
    );
    body += &section(
        "How well a tip is known",
        "One standard deviation along each axis of frame 0, from what differs between frames: centres and their times.",
        &plots(&[known])?,
    );
    for (side, camera) in Side::BOTH.into_iter().zip(cameras) {
        body += &section(
            &format!("What the {} camera saw", side.name()),
            "Dashed: the region that was searched. Yellow: outlines of all that has the marker's colour. Pink: centre and outline of the \
             ball that was taken, red of one that was rejected. Blue cross: where it was expected.",
            &sheets(side, camera),
        );
    }
    Ok(document(&format!("{} - tracking", page.recording), STYLE, &body))
}

/// Panels that have something to show, each as a figure.
fn plots(all: &[Panel]) -> Result<String> {
    let shown = |panel: &&Panel| panel.series.iter().flat_map(|s| &s.samples).any(|(x, y)| x.is_finite() && y.is_finite());
    let figures: Vec<String> = all
        .iter()
        .filter(shown)
        .map(|panel| Ok(format!("<figure class=\"plot\">{}</figure>\n", panels(std::slice::from_ref(panel))?)))
        .collect::<Result<_>>()?;
    Ok(if figures.is_empty() { "<p class=\"aside\">The marker was never seen.</p>".to_owned() } else { figures.concat() })
}

fn track(side: Side, records: &[Record], seconds: &dyn Fn(&Record) -> f64) -> Panel {
    let of = |label: &str, axis: usize, mark: Mark, rejected: bool| {
        let sample = |record: &Record| {
            let centre = match record.sighting {
                Sighting::Seen(found) if !rejected => found.centre[axis],
                Sighting::Rejected(found) if rejected => found.centre[axis],
                _ => f64::NAN,
            };
            (seconds(record), centre)
        };
        Series { label: label.to_owned(), samples: records.iter().map(sample).collect(), mark }
    };
    let mut rejected = of("rejected u and v", 0, Mark::Points, true);
    rejected.samples.extend(of("", 1, Mark::Points, true).samples);
    // Few among many: thinning would lose them.
    rejected.samples.retain(|(_, pixel)| pixel.is_finite());
    Panel {
        title: format!("{} camera", side.name()),
        x_label: "time [s]".to_owned(),
        y_label: "pixel".to_owned(),
        series: vec![of("v, down", 1, Mark::Line, false), rejected, of("u, right", 0, Mark::Line, false)],
    }
}

/// Standard deviations of the tips along the axes of frame 0.
fn deviations(known: &[(f64, Matrix3<f64>)]) -> Panel {
    let of = |axis: usize| Series {
        label: ["x", "y", "z"][axis].to_owned(),
        samples: known.iter().map(|(time_s, covariance)| (*time_s, 1e3 * covariance[(axis, axis)].sqrt())).collect(),
        mark: Mark::Line,
    };
    Panel {
        title: "standard deviation of the tip".to_owned(),
        x_label: "time [s]".to_owned(),
        y_label: "[mm]".to_owned(),
        series: (0..3).map(of).collect(),
    }
}

fn reasons(cameras: &[OfCamera; 2], end_s: f64) -> String {
    let of = |side: Side, reason: Reason| cameras[side as usize].reasons.iter().filter(|(_, one)| *one == reason).count();
    let drawn = Side::BOTH.map(|side| {
        let title = format!("{} camera", side.name());
        let svg = timeline::timeline(&format!("reasons-{}", side.name()), &title, &cameras[side as usize].reasons, end_s);
        format!("<h3>{title}</h3>\n<figure>{svg}</figure>\n")
    });
    let row = |reason: Reason| {
        let [left, right] = Side::BOTH.map(|side| of(side, reason));
        format!(
            "<tr><td><span class=\"key {}\"></span>{}</td><td class=\"n\">{left}</td><td class=\"n\">{right}</td></tr>\n",
            timeline::class(reason),
            escape(reason.words())
        )
    };
    let met = Reason::ALL.into_iter().filter(|&reason| Side::BOTH.into_iter().any(|side| of(side, reason) > 0));
    format!(
        "<table>\n<tr><td>frames</td><td class=\"n\">left</td><td class=\"n\">right</td></tr>\n{}</table>\n{}",
        met.map(row).collect::<String>(),
        drawn.concat()
    )
}

/// The pictures of one camera, by kind.
fn sheets(side: Side, camera: OfCamera) -> String {
    let mut content = String::new();
    for (k, (name, of, tiles)) in camera.into_sheets().into_iter().enumerate() {
        if tiles.is_empty() {
            continue;
        }
        let figures = tiles.iter().enumerate().map(|(i, tile)| (tile.caption(), tile.svg(&format!("tile-{}-{k}-{i}", side.name()))));
        content += &format!("<h3>{}: {} of {of} frames</h3>\n{}\n", escape(name), tiles.len(), grid(figures));
    }
    if content.is_empty() { "<p class=\"aside\">None of its frames was searched.</p>".to_owned() } else { content }
}

/// A raw frame of an image.
#[cfg(test)]
fn as_frame(image: image::RgbImage) -> raven::log::CameraFrame {
    use raven::log::{CameraFrame, FrameData, Side, Stamp};
    let (width, height) = image.dimensions();
    let data = FrameData::Raw { encoding: "rgb8".to_owned(), width, height, step: 3 * width, data: image.into_raw() };
    CameraFrame { side: Side::Left, stamp: Stamp(0), log_time: Stamp(0), frame_id: String::new(), sequence: None, data }
}
