//! Box plots: the middle half of values as a box with the median in it, whiskers to the 5th and 95th percentile.

use plotters::prelude::*;

use super::{Area, COLOURS, axes, document, drawing, legend, nothing_to_show, padded};
use crate::Result;
use crate::stats::quantiles;

/// Percentiles of one set of values.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Spread {
    /// 5th, 25th, 50th, 75th and 95th percentile.
    pub percentiles: [f64; 5],
}

impl Spread {
    /// Of the finite ones among `values`; `None` if there are none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        quantiles(values, [0.05, 0.25, 0.5, 0.75, 0.95]).map(|percentiles| Self { percentiles })
    }
}

/// One pair of axes with groups side by side, each with one box per series.
#[derive(Debug, Clone)]
pub struct Boxes {
    /// Heading.
    pub title: String,
    /// Label of the abscissa.
    pub x_label: String,
    /// Label of the ordinate.
    pub y_label: String,
    /// Names of the groups, left to right.
    pub groups: Vec<String>,
    /// Name in the legend, and a box for each group that has values.
    pub series: Vec<(String, Vec<Option<Spread>>)>,
}

/// Box plots below each other, as one SVG document.
///
/// # Errors
/// If one has no box.
pub fn boxes(plots: &[Boxes]) -> Result<String> {
    document(plots, draw)
}

fn draw(plot: &Boxes, area: &Area<'_>) -> Result<()> {
    let spreads = || plot.series.iter().flat_map(|(_, spreads)| spreads.iter().flatten());
    let reach = spreads().fold([f64::MAX, f64::MIN], |[low, high], s| [low.min(s.percentiles[0]), high.max(s.percentiles[4])]);
    if reach[0] > reach[1] {
        return Err(nothing_to_show(&plot.title));
    }
    let mut chart = axes(area, &plot.title, -0.5..plot.groups.len() as f64 - 0.5, padded(reach, 0.06))?;
    let name = |x: &f64| {
        let index = x.round();
        let group = (index >= 0.0 && (x - index).abs() < 0.01).then(|| plot.groups.get(index as usize)).flatten();
        group.cloned().unwrap_or_default()
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(2 * plot.groups.len() + 1)
        .x_label_formatter(&name)
        .x_desc(&plot.x_label)
        .y_desc(&plot.y_label)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()
        .map_err(drawing)?;
    let slot = 0.8 / plot.series.len() as f64;
    for (i, ((label, spreads), colour)) in plot.series.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let mut lines = Vec::new();
        let mut halves = Vec::new();
        for (group, spread) in spreads.iter().enumerate() {
            let Some(Spread { percentiles: [low, first, median, third, high] }) = *spread else { continue };
            let middle = group as f64 - 0.4 + slot * (i as f64 + 0.5);
            let (left, right) = (middle - 0.35 * slot, middle + 0.35 * slot);
            halves.push(Rectangle::new([(left, first), (right, third)], colour.mix(0.35).filled()));
            lines.push(vec![(left, first), (left, third), (right, third), (right, first), (left, first)]);
            lines.extend([
                vec![(left, median), (right, median)],
                vec![(middle, low), (middle, first)],
                vec![(middle, third), (middle, high)],
            ]);
        }
        chart.draw_series(halves).map_err(drawing)?;
        let drawn = chart.draw_series(lines.into_iter().map(|line| PathElement::new(line, colour.stroke_width(1)))).map_err(drawing)?;
        drawn.label(label).legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(4)));
    }
    legend(&mut chart)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_show_groups_and_leave_out_what_has_no_values() {
        let values: Vec<f64> = (0..=100).map(f64::from).collect();
        let spread = Spread::of(&values);
        assert_eq!(spread.unwrap().percentiles, [5.0, 25.0, 50.0, 75.0, 95.0]);
        let plot = Boxes {
            title: "elbow".to_owned(),
            x_label: "trial".to_owned(),
            y_label: "error [deg]".to_owned(),
            groups: vec!["one".to_owned(), "two".to_owned()],
            series: vec![("kinematics".to_owned(), vec![spread, None]), ("filter".to_owned(), vec![spread, spread])],
        };
        let svg = boxes(std::slice::from_ref(&plot)).unwrap();
        assert!(["one", "two", "kinematics", "filter"].iter().all(|text| svg.contains(text)), "{svg}");
        let empty = Boxes { series: vec![("none".to_owned(), vec![Spread::of(&[f64::NAN]), None])], ..plot };
        assert!(boxes(&[empty]).unwrap_err().to_string().contains("elbow"));
    }
}
