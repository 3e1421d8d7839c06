//! Plots as SVG text: panels of lines and points over a shared layout, and grouped bars.

use plotters::prelude::*;

use crate::{Error, Result};

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Joined samples.
    Line,
    /// One dot per sample.
    Points,
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
/// A picture needs no more samples than it has columns; more only make the file heavy.
const SAMPLES_MAX: usize = 1500;

/// Panels below each other, as one SVG document.
///
/// # Errors
/// If a panel holds nothing finite.
pub fn panels(panels: &[Panel]) -> Result<String> {
    let mut svg = String::new();
    {
        let height = PANEL_SIZE.1 * u32::try_from(panels.len()).unwrap_or(1).max(1);
        let root = SVGBackend::with_string(&mut svg, (PANEL_SIZE.0, height)).into_drawing_area();
        root.fill(&WHITE).map_err(drawing)?;
        for (panel, area) in panels.iter().zip(root.split_evenly((panels.len(), 1))) {
            draw_panel(panel, &area)?;
        }
        root.present().map_err(drawing)?;
    }
    Ok(svg)
}

fn draw_panel(panel: &Panel, area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>) -> Result<()> {
    let finite = || panel.series.iter().flat_map(|s| &s.samples).filter(|(x, y)| x.is_finite() && y.is_finite());
    let (x, y) = finite()
        .fold(([f64::MAX, f64::MIN], [f64::MAX, f64::MIN]), |(x, y), s| ([x[0].min(s.0), x[1].max(s.0)], [y[0].min(s.1), y[1].max(s.1)]));
    if x[0] > x[1] {
        return Err(Error::Data(format!("the plot `{}` has nothing to show.", panel.title)));
    }
    let pad = |[low, high]: [f64; 2], share: f64| {
        let margin = if high > low { (high - low) * share } else { high.abs().max(1.0) * 0.1 };
        low - margin..high + margin
    };
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, ("sans-serif", 16))
        .margin(8)
        .x_label_area_size(34)
        .y_label_area_size(56)
        .build_cartesian_2d(pad(x, 0.0), pad(y, 0.06))
        .map_err(drawing)?;
    chart
        .configure_mesh()
        .x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()
        .map_err(drawing)?;
    for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
        let stride = series.samples.len().div_ceil(SAMPLES_MAX).max(1);
        let thinned = series.samples.iter().step_by(stride).copied();
        let drawn = match series.mark {
            Mark::Points => chart
                .draw_series(thinned.filter(|(x, y)| x.is_finite() && y.is_finite()).map(|at| Circle::new(at, 1, colour.filled())))
                .map_err(drawing)?,
            Mark::Line => {
                let samples: Vec<(f64, f64)> = thinned.collect();
                let runs = samples.split(|(x, y)| !x.is_finite() || !y.is_finite()).filter(|run| !run.is_empty());
                chart.draw_series(runs.map(|run| PathElement::new(run.to_vec(), colour.stroke_width(1)))).map_err(drawing)?
            }
        };
        drawn.label(&series.label).legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .border_style(RGBColor(200, 200, 200))
        .position(SeriesLabelPosition::UpperRight)
        .draw()
        .map_err(drawing)
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
            series: vec![series("motor", Mark::Line), series("camera", Mark::Points)],
        };
        let svg = panels(&[panel.clone(), panel]).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("error [deg]") && svg.contains("camera") && !svg.contains("NaN"));
        assert!(svg.len() < 2_000_000);
    }

    #[test]
    fn nothing_to_show_is_said() {
        let empty = Panel { title: "elbow".to_owned(), x_label: String::new(), y_label: String::new(), series: vec![] };
        assert!(panels(&[empty]).unwrap_err().to_string().contains("elbow"));
    }
}
