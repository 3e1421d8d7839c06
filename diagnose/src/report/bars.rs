//! Pairs of bars, before above after, with the noise floor across both.

use raven::plot::svg::{figure, frame, line, rectangle, text};

use super::{GapBar, PhaseBars};
use crate::attribution::percent;

/// One pair.
struct Row {
    label: String,
    under_label: String,
    unit: String,
    before: f64,
    after: Option<f64>,
    noise_floor: f64,
    notes: Vec<String>,
}

/// Widths of the label, the bars and the note.
struct Columns {
    label: f64,
    bars: f64,
    note: f64,
}

const ROW: f64 = 50.0;
const BAR: f64 = 15.0;
/// Room for the number behind a bar.
const NUMBER: f64 = 90.0;

/// The gap of every channel.
pub fn gaps(gaps: &[GapBar]) -> String {
    let row = |gap: &GapBar| Row {
        label: gap.channel.clone(),
        under_label: String::new(),
        unit: gap.unit.clone(),
        before: gap.before,
        after: gap.after,
        noise_floor: gap.noise_floor,
        notes: notes(gap),
    };
    let rows: Vec<Row> = gaps.iter().map(row).collect();
    let note = if rows.iter().any(|row| !row.notes.is_empty()) { 215.0 } else { 0.0 };
    draw("gap", "Gap before and after", &rows, &Columns { label: 132.0, bars: 610.0 - note, note })
}

fn notes(gap: &GapBar) -> Vec<String> {
    let closed =
        |(closed, [low, high]): (f64, [f64; 2])| format!("{} % closed (95 %: {} to {} %)", percent(closed), percent(low), percent(high));
    let retuned = |after: f64| format!("{} {} with the file retuned", figure(after), gap.unit);
    gap.closed.map(closed).into_iter().chain(gap.retuned.map(retuned)).collect()
}

/// One channel by phase; `index` tells the drawings of a page apart.
pub fn phases(index: usize, bars: &PhaseBars) -> String {
    let row = |phase: &super::PhaseBar| Row {
        label: phase.phase.clone(),
        under_label: format!("{:.0} % of time", 100.0 * phase.share_of_time),
        unit: bars.unit.clone(),
        before: phase.before,
        after: phase.after,
        noise_floor: phase.noise_floor,
        notes: Vec::new(),
    };
    let rows: Vec<Row> = bars.phases.iter().map(row).collect();
    draw(&format!("phase-{index}"), &format!("{} by phase", bars.channel), &rows, &Columns { label: 96.0, bars: 196.0, note: 0.0 })
}

fn draw(id: &str, title: &str, rows: &[Row], columns: &Columns) -> String {
    let mut inside = String::new();
    for (k, row) in rows.iter().enumerate() {
        // Channels of one unit are drawn to one scale.
        let largest = rows.iter().filter(|r| r.unit == row.unit).flat_map(|r| [r.before, r.after.unwrap_or(0.0), r.noise_floor]);
        let largest = largest.filter(|v| v.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
        inside += &pair(row, k as f64 * ROW, columns, columns.bars.max(NUMBER) - NUMBER, largest);
    }
    let size = [columns.label + columns.bars + columns.note, ROW * rows.len() as f64 + 4.0];
    frame(id, size, title, &description(rows), &inside)
}

fn pair(row: &Row, top: f64, columns: &Columns, width: f64, largest: f64) -> String {
    let left = columns.label;
    let long = |value: f64| if value.is_finite() { width * (value / largest).clamp(0.0, 1.0) } else { 0.0 };
    let mut drawn = text(left - 10.0, top + if row.under_label.is_empty() { 30.0 } else { 24.0 }, "e", &row.label);
    drawn += &text(left - 10.0, top + 38.0, "e s", &row.under_label);
    let bars = [(Some(row.before), "before", 8.0), (row.after, "after", 10.0 + BAR)];
    for (value, class, down) in bars {
        if let Some(value) = value {
            let end = left + long(value);
            drawn += &rectangle([left, top + down, long(value), BAR], class);
            // Clear of the noise floor's line where that stands right behind the bar.
            let floor = left + long(row.noise_floor);
            let after_bar = if floor > end - 2.0 && floor < end + NUMBER { floor.max(end) } else { end };
            drawn += &text(after_bar + 6.0, top + down + 12.0, "s", &format!("{} {}", figure(value), row.unit));
        }
    }
    if row.noise_floor > 0.0 {
        let x = left + long(row.noise_floor);
        drawn += &line([x, top + 4.0, x, top + 14.0 + 2.0 * BAR], "floor");
    }
    drawn += &line([left, top + 4.0, left, top + 14.0 + 2.0 * BAR], "axis");
    let end = left + columns.bars + columns.note;
    let first = top + 37.0 - 7.0 * row.notes.len() as f64;
    drawn + &row.notes.iter().enumerate().map(|(k, note)| text(end, first + 14.0 * k as f64, "e s", note)).collect::<String>()
}

fn description(rows: &[Row]) -> String {
    let one = |row: &Row| {
        let after = row.after.map_or_else(String::new, |after| format!(", {} after", figure(after)));
        let unit = &row.unit;
        format!("{}: {}{after}, noise floor {} {unit}.", row.label, figure(row.before), figure(row.noise_floor))
    };
    rows.iter().map(one).collect::<Vec<_>>().join(" ")
}
