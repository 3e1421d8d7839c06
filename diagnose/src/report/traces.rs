//! Residuals over time: before behind after, in the band of two deviations of the noise.

use raven::plot::svg::{figure, frame, line, rectangle, text, tick, ticks};
use raven::stats::{median, quantiles};

use super::Trace;

const SIZE: [f64; 2] = [960.0, 184.0];
const LEFT: f64 = 56.0;
const RIGHT: f64 = 952.0;
const TOP: f64 = 22.0;
const BOTTOM: f64 = 156.0;
/// Columns that a trace is drawn in; each shows the least and the greatest value in it.
const COLUMNS: usize = 640;
/// A pause of more than so many intervals leaves a hole.
const PAUSE: f64 = 8.0;
/// Share of the values at either end that may lie outside, so that a stray one does not flatten the rest.
const OUTSIDE: f64 = 0.002;

/// One channel; `index` tells the drawings of a page apart.
pub fn trace(index: usize, trace: &Trace) -> String {
    let values = [trace.before.as_slice(), &trace.after].concat();
    let reach = quantiles(&values, [OUTSIDE, 1.0 - OUTSIDE]).unwrap_or([-1.0, 1.0]);
    let band = 2.0 * trace.noise_floor;
    let (low, high) = (reach[0].min(-1.2 * band), reach[1].max(1.2 * band));
    let margin = 0.05 * (high - low).max(f64::MIN_POSITIVE);
    let (low, high) = (low.min(0.0) - margin, high.max(0.0) + margin);
    let finite = || trace.time_s.iter().copied().filter(|t| t.is_finite());
    let (start, end) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    let x = |t: f64| LEFT + (RIGHT - LEFT) * (t - start) / (end - start).max(f64::MIN_POSITIVE);
    let y = |v: f64| (BOTTOM - (BOTTOM - TOP) * (v - low) / (high - low)).clamp(TOP, BOTTOM);

    let mut inside = rectangle([LEFT, y(band), RIGHT - LEFT, y(-band) - y(band)], "band");
    for value in ticks(low, high, 4) {
        inside += &line([LEFT, y(value), RIGHT, y(value)], if value == 0.0 { "axis" } else { "grid" });
        inside += &text(LEFT - 6.0, y(value) + 4.0, "e s", &tick(value));
    }
    if end > start {
        for value in ticks(start, end, 8) {
            inside += &line([x(value), BOTTOM, x(value), BOTTOM + 4.0], "axis");
            inside += &text(x(value), BOTTOM + 17.0, "m s", &tick(value));
        }
    }
    inside += &text(RIGHT, BOTTOM + 17.0, "e s", "s");
    inside += &text(LEFT, TOP - 8.0, "", &format!("{} [{}]", trace.channel, trace.unit));
    for (values, class) in [(&trace.before, "line-before"), (&trace.after, "line-after")] {
        for run in runs(&trace.time_s, values) {
            let points: Vec<String> = run.iter().map(|(t, v)| format!("{:.1},{:.1}", x(*t), y(*v))).collect();
            inside += &format!("<polyline points=\"{}\" class=\"{class}\"/>", points.join(" "));
        }
    }
    let rms = |values: &[f64]| raven::stats::rms(values).map_or_else(|| "-".to_owned(), figure);
    let after = if trace.after.is_empty() { String::new() } else { format!(", {} after", rms(&trace.after)) };
    let description = format!("Root mean square {} {} before{after}; noise {}.", rms(&trace.before), trace.unit, figure(trace.noise_floor));
    frame(&format!("trace-{index}"), SIZE, &format!("Residual of {} over time", trace.channel), &description, &inside)
}

/// The trace in [`COLUMNS`] columns, cut where it pauses.
fn runs(time_s: &[f64], values: &[f64]) -> Vec<Vec<(f64, f64)>> {
    let samples: Vec<(f64, f64)> =
        time_s.iter().copied().zip(values.iter().copied()).filter(|(t, v)| t.is_finite() && v.is_finite()).collect();
    let steps: Vec<f64> = samples.windows(2).map(|w| w[1].0 - w[0].0).collect();
    let pause = PAUSE * median(&steps).unwrap_or(f64::INFINITY);
    let per_column = samples.len().div_ceil(COLUMNS).max(1);
    let mut runs = Vec::new();
    for run in samples.chunk_by(|a, b| b.0 >= a.0 && b.0 - a.0 <= pause) {
        let mut points = Vec::new();
        for column in run.chunks(per_column) {
            let least = column.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
            let greatest = column.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
            let mut ends: Vec<(f64, f64)> = [least, greatest].into_iter().flatten().collect();
            ends.sort_by(|a, b| a.0.total_cmp(&b.0));
            ends.dedup();
            points.extend(ends);
        }
        runs.push(points);
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_trace_keeps_its_extremes_and_its_pause() {
        let time_s: Vec<f64> = (0..100_000).map(|k| f64::from(k) * 1e-3 + if k >= 50_000 { 5.0 } else { 0.0 }).collect();
        let mut values = vec![0.0; time_s.len()];
        values[70_123] = 3.0;
        values[10] = f64::NAN;
        let runs = runs(&time_s, &values);
        assert_eq!(runs.len(), 2);
        let points: Vec<&(f64, f64)> = runs.iter().flatten().collect();
        assert!(points.len() <= 2 * COLUMNS + 4 && points.iter().any(|p| p.1 == 3.0));
    }
}
