//! Plots as SVG text: panels of lines, points and bands below each other, histograms, box plots.

mod boxes;
mod histogram;
pub mod page;
pub mod svg;

pub use boxes::{Boxes, Spread, boxes};
pub use histogram::{Histogram, histograms};

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::{Error, Result};

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Joined samples.
    Line,
    /// One dot per sample.
    Points,
    /// The area that the samples run around; see [`Series::band`].
    Band,
}

/// Values over a common axis; samples that are not finite leave a hole.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend.
    pub label: String,
    /// Abscissa and ordinate.
    pub samples: Vec<(f64, f64)>,
    /// Line or points.
    pub mark: Mark,
}

impl Series {
    /// A shaded band from `low` to `high` over `x`; samples that are not finite are left out.
    #[must_use]
    pub fn band(label: &str, edges: &[(f64, f64, f64)]) -> Self {
        let stride = edges.len().div_ceil(LINE_MAX / 2).max(1);
        let finite = |edge: &&(f64, f64, f64)| edge.0.is_finite() && edge.1.is_finite() && edge.2.is_finite();
        let thinned: Vec<_> = edges.iter().step_by(stride).filter(finite).collect();
        let low = thinned.iter().map(|(x, low, _)| (*x, *low));
        let samples = low.chain(thinned.iter().rev().map(|(x, _, high)| (*x, *high))).collect();
        Self { label: label.to_owned(), samples, mark: Mark::Band }
    }
}

/// One pair of axes.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Heading.
    pub title: String,
    /// Label of the abscissa.
    pub x_label: String,
    /// Label of the ordinate.
    pub y_label: String,
    /// What is drawn, in the order of the colours.
    pub series: Vec<Series>,
}

const COLOURS: [RGBColor; 5] =
    [RGBColor(150, 150, 150), RGBColor(214, 120, 40), RGBColor(31, 96, 170), RGBColor(20, 20, 20), RGBColor(90, 150, 70)];
const PANEL_SIZE: (u32, u32) = (960, 280);
/// A picture needs no more samples than it has columns, and dots are told apart only so close; more only make the file heavy.
const LINE_MAX: usize = 1000;
const POINTS_MAX: usize = 400;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Panels below each other, as one SVG document.
///
/// # Errors
/// If a panel holds nothing finite.
pub fn panels(panels: &[Panel]) -> Result<String> {
    document(panels, draw_panel)
}

/// One document with an area of [`PANEL_SIZE`] for each of the `items`.
fn document<T>(items: &[T], draw: impl Fn(&T, &Area<'_>) -> Result<()>) -> Result<String> {
    let mut svg = String::new();
    {
        let height = PANEL_SIZE.1 * u32::try_from(items.len()).unwrap_or(1).max(1);
        let root = SVGBackend::with_string(&mut svg, (PANEL_SIZE.0, height)).into_drawing_area();
        root.fill(&WHITE).map_err(drawing)?;
        for (item, area) in items.iter().zip(root.split_evenly((items.len(), 1))) {
            draw(item, &area)?;
        }
        root.present().map_err(drawing)?;
    }
    Ok(svg)
}

fn nothing_to_show(title: &str) -> Error {
    Error::Data(format!("the plot `{title}` has nothing to show."))
}

/// A range with a margin of this share; one around a single value if it holds no other.
fn padded([low, high]: [f64; 2], share: f64) -> std::ops::Range<f64> {
    let margin = if high > low { (high - low) * share } else { high.abs().max(1.0) * 0.1 };
    low - margin..high + margin
}

/// Axes under a heading, over the whole of `area`.
fn axes<'a, 'b>(area: &'a Area<'b>, title: &str, x: std::ops::Range<f64>, y: std::ops::Range<f64>) -> Result<Chart<'a, 'b>> {
    ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(56)
        .build_cartesian_2d(x, y)
        .map_err(drawing)
}

/// The legend.
fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>) -> Result<()> {
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .border_style(RGBColor(200, 200, 200))
        .position(SeriesLabelPosition::UpperRight)
        .draw()
        .map_err(drawing)
}

fn draw_panel(panel: &Panel, area: &Area<'_>) -> Result<()> {
    let finite = || panel.series.iter().flat_map(|s| &s.samples).filter(|(x, y)| x.is_finite() && y.is_finite());
    let (x, y) = finite()
        .fold(([f64::MAX, f64::MIN], [f64::MAX, f64::MIN]), |(x, y), s| ([x[0].min(s.0), x[1].max(s.0)], [y[0].min(s.1), y[1].max(s.1)]));
    if x[0] > x[1] {
        return Err(nothing_to_show(&panel.title));
    }
    let mut chart = axes(area, &panel.title, padded(x, 0.0), padded(y, 0.06))?;
    chart
        .configure_mesh()
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()
        .map_err(drawing)?;
    for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
        let thinned = |most: usize| series.samples.iter().step_by(series.samples.len().div_ceil(most).max(1)).copied();
        let drawn = match series.mark {
            Mark::Points => chart
                .draw_series(
                    thinned(POINTS_MAX).filter(|(x, y)| x.is_finite() && y.is_finite()).map(|at| Circle::new(at, 1, colour.filled())),
                )
                .map_err(drawing)?,
            Mark::Line => {
                let samples: Vec<(f64, f64)> = thinned(LINE_MAX).collect();
                let runs = samples.split(|(x, y)| !x.is_finite() || !y.is_finite()).filter(|run| !run.is_empty());
                chart.draw_series(runs.map(|run| PathElement::new(run.to_vec(), colour.stroke_width(1)))).map_err(drawing)?
            }
            Mark::Band => {
                let outline: Vec<(f64, f64)> = series.samples.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
                chart.draw_series([Polygon::new(outline, colour.mix(0.25))]).map_err(drawing)?
            }
        };
        drawn.label(&series.label).legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    legend(&mut chart)
}

fn drawing(error: impl std::fmt::Display) -> Error {
    Error::Data(format!("a plot could not be drawn: {error}."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_is_an_svg_with_its_labels_and_holes() {
        let series = |label: &str, mark| Series {
            label: label.to_owned(),
            samples: (0..5000).map(|i| (f64::from(i), if i == 2500 { f64::NAN } else { f64::from(i).sin() })).collect(),
            mark,
        };
        let panel = Panel {
            title: "shoulder".to_owned(),
            x_label: "time [s]".to_owned(),
            y_label: "error [deg]".to_owned(),
            series: vec![
                series("motor", Mark::Line),
                series("camera", Mark::Points),
                Series::band("two sigma", &[(0.0, -0.1, 0.1), (2500.0, f64::NAN, 0.0), (5000.0, -0.3, 0.2)]),
            ],
        };
        let svg = panels(&[panel.clone(), panel]).unwrap();
        assert!(
            svg.starts_with("<svg")
                && svg.contains("error [deg]")
                && svg.contains("camera")
                && svg.contains("two sigma")
                && !svg.contains("NaN")
        );
        assert!(svg.len() < 200_000, "{}", svg.len());
    }

    #[test]
    fn nothing_to_show_is_said() {
        let empty = Panel { title: "elbow".to_owned(), x_label: String::new(), y_label: String::new(), series: vec![] };
        assert!(panels(&[empty]).unwrap_err().to_string().contains("elbow"));
    }
}
