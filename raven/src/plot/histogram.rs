//! Histograms of several sets of values over each other, each scaled to a density.

use plotters::prelude::*;

use super::{Area, COLOURS, axes, document, drawing, legend, nothing_to_show};
use crate::Result;
use crate::stats::quantiles;

/// Bins over the range shown.
const BINS: usize = 80;

/// One pair of axes.
#[derive(Debug, Clone)]
pub struct Histogram {
    /// Heading.
    pub title: String,
    /// Label of the abscissa.
    pub x_label: String,
    /// Name in the legend, and values.
    pub series: Vec<(String, Vec<f64>)>,
}

/// Histograms below each other, as one SVG document. Each shows the range that holds all but a thousandth of every series at either end.
///
/// # Errors
/// If one has no finite values.
pub fn histograms(plots: &[Histogram]) -> Result<String> {
    document(plots, draw)
}

fn draw(plot: &Histogram, area: &Area<'_>) -> Result<()> {
    let ranges = plot.series.iter().filter_map(|(_, values)| quantiles(values, [0.001, 0.999]));
    let [low, high] = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).ok_or_else(|| nothing_to_show(&plot.title))?;
    let width = ((high - low) / BINS as f64).max(f64::MIN_POSITIVE);
    let densities: Vec<Vec<f64>> = plot.series.iter().map(|(_, values)| density(values, low, width)).collect();
    let top = densities.iter().flatten().fold(0.0_f64, |top, d| top.max(*d));
    let mut chart = axes(area, &plot.title, low..low + width * BINS as f64, 0.0..1.05 * top)?;
    chart
        .configure_mesh()
        .x_desc(&plot.x_label)
        .y_desc("density")
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()
        .map_err(drawing)?;
    for (((label, _), density), colour) in plot.series.iter().zip(&densities).zip(COLOURS.iter().cycle()) {
        let edge = |bin: usize| low + width * bin as f64;
        let steps = density.iter().enumerate().flat_map(|(bin, &d)| [(edge(bin), d), (edge(bin + 1), d)]);
        let outline: Vec<(f64, f64)> = [(low, 0.0)].into_iter().chain(steps).chain([(edge(BINS), 0.0)]).collect();
        chart.draw_series([Polygon::new(outline.clone(), colour.mix(0.2))]).map_err(drawing)?;
        let drawn = chart.draw_series([PathElement::new(outline, colour.stroke_width(1))]).map_err(drawing)?;
        drawn.label(label).legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(4)));
    }
    legend(&mut chart)
}

/// Density of `values` in each bin.
fn density(values: &[f64], low: f64, width: f64) -> Vec<f64> {
    let mut counts = vec![0.0; BINS];
    for value in values.iter().filter(|v| v.is_finite()) {
        let bin = ((value - low) / width).floor();
        if bin >= 0.0
            && let Some(count) = counts.get_mut(bin as usize)
        {
            *count += 1.0;
        }
    }
    let total = values.len().max(1) as f64 * width;
    counts.into_iter().map(|count| count / total).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_density_adds_up_to_one() {
        let values: Vec<f64> = (0..8000).map(|k| f64::from(k % 800) / 800.0).collect();
        let density = density(&values, 0.0, 1.0 / BINS as f64);
        assert!((density.iter().sum::<f64>() / BINS as f64 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn an_svg_with_both_names() {
        let values: Vec<f64> = (0..1000).map(|k| (f64::from(k) * 0.1).sin()).collect();
        let plot = |series| Histogram { title: "shoulder".to_owned(), x_label: "error [deg]".to_owned(), series };
        let svg = histograms(&[plot(vec![("filter".to_owned(), values.clone()), ("kinematics".to_owned(), values)])]).unwrap();
        assert!(svg.contains("filter") && svg.contains("kinematics") && !svg.contains("NaN"));
        assert!(histograms(&[plot(vec![])]).is_err());
    }
}
