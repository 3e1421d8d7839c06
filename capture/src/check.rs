//! `raven-capture check`: what is in a log, how regular it is, and what can be done with it.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use raven::cli::{self, Outcome};
use raven::log::{Recovery, Survey, TopicSurvey, recover};
use raven::{Error, Result};
use serde::Serialize;

use crate::steps::{Step, steps};

/// Arguments of `raven-capture check`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  raven-capture check session.mcap\n  raven-capture check cut-off.mcap --recover -o session.mcap\n\n\
                        Exit codes: 0 the log is whole, 1 failed, 2 wrong arguments, 3 the log is damaged.")]
pub struct Args {
    /// The log.
    pub file: PathBuf,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Save what can be read of a damaged log in a new one.
    #[arg(long, requires = "output")]
    pub recover: bool,
    /// The new log.
    #[arg(short, long, value_name = "FILE", requires = "recover")]
    pub output: Option<PathBuf>,
}

/// The machine-readable result.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    survey: &'a Survey,
    steps: &'a [Step],
    recovery: Option<&'a Recovery>,
}

/// Checks a log.
///
/// # Errors
/// If the file cannot be read, is no MCAP file, or a result cannot be written.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let survey = Survey::of(&args.file)?;
    let steps = steps(&survey);
    let recovery = args.output.as_ref().map(|output| recover(&args.file, output)).transpose()?;
    let text = render(&survey, &steps).unwrap_or_default();
    out.write_all(text.as_bytes()).map_err(|e| Error::io(Path::new("standard output"), "write", e))?;
    if let (Some(recovery), Some(output)) = (&recovery, &args.output) {
        let of = recovery.expected_messages.map_or_else(String::new, |expected| format!(" of {expected}"));
        writeln!(out, "\n{}{of} messages and {} attachments are saved in {}.", recovery.messages, recovery.attachments, output.display())
            .map_err(|e| Error::io(Path::new("standard output"), "write", e))?;
    }
    if let Some(json) = &args.json {
        cli::write_json(json, &Report { survey: &survey, steps: &steps, recovery: recovery.as_ref() })?;
    }
    Ok(if survey.damage.is_some() { Outcome::DataLost } else { Outcome::Done })
}

/// The report as people read it.
fn render(survey: &Survey, steps: &[Step]) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    let megabytes = survey.bytes as f64 * 1e-6;
    write!(text, "{}: {megabytes:.1} MB, {} messages", survey.path.display(), survey.messages)?;
    let first = survey.topics.iter().filter_map(|topic| topic.quality.first).min();
    let last = survey.topics.iter().filter_map(|topic| topic.quality.last).max();
    if let (Some(first), Some(last)) = (first, last) {
        write!(text, ", {:.3} s from {first}", last.seconds_since(first))?;
    }
    writeln!(text)?;
    if let Some(damage) = &survey.damage {
        writeln!(text, "DAMAGED: {}.", damage.fault)?;
    }
    if !survey.session.is_empty() {
        let pairs: Vec<String> = survey.session.iter().map(|(key, value)| format!("{key} {value}")).collect();
        writeln!(text, "session: {}", pairs.join(", "))?;
    }
    for file in &survey.attachments {
        writeln!(text, "attachment: {} ({}, {} bytes)", file.name, file.media_type, file.bytes)?;
    }
    writeln!(text, "\n{}", table(&topic_rows(survey, first)))?;
    if let Some(skew) = survey.cameras {
        let (signed, absolute) = (1e3 * skew.right_minus_left_s, 1e3 * skew.absolute_s);
        writeln!(text, "cameras: right minus left {signed:.2} ms, {absolute:.2} ms without sign (medians over the nearest frames)")?;
    }
    if let Some(tip) = survey.tip {
        writeln!(text, "tip: {} seen, {} occluded, {} jumped", tip.seen, tip.occluded, tip.jumped)?;
    }
    if survey.torque_recorded == Some(false) {
        writeln!(text, "motors: torque was not recorded")?;
    }
    let remarks: Vec<String> = survey.topics.iter().flat_map(remarks).collect();
    for remark in &remarks {
        writeln!(text, "{remark}")?;
    }
    let rows: Vec<Vec<String>> = steps
        .iter()
        .map(|step| vec![step.program.to_owned(), if step.ready { "ready" } else { "no" }.to_owned(), step.note.clone()])
        .collect();
    write!(text, "\n{}", table(&rows))?;
    Ok(text)
}

fn topic_rows(survey: &Survey, origin: Option<raven::log::Stamp>) -> Vec<Vec<String>> {
    let titles =
        ["topic", "messages", "rate/Hz", "median/ms", "longest/ms", "gaps", "repeated", "back", "first/s", "last/s", "encoding", "schema"];
    let number =
        |value: Option<f64>, scale: f64, digits: usize| value.map_or("-".to_owned(), |value| format!("{:.digits$}", scale * value));
    let row = |topic: &TopicSurvey| {
        let quality = &topic.quality;
        let since = |stamp: Option<raven::log::Stamp>| number(stamp.zip(origin).map(|(s, origin)| s.seconds_since(origin)), 1.0, 3);
        vec![
            topic.topic.clone(),
            quality.messages.to_string(),
            number(topic.rate_hz, 1.0, 2),
            number(quality.median_interval_s, 1e3, 3),
            number(quality.longest_interval_s, 1e3, 3),
            quality.gaps.to_string(),
            quality.duplicates.to_string(),
            quality.backward.to_string(),
            since(quality.first),
            since(quality.last),
            topic.message_encoding.clone(),
            topic.schema.clone(),
        ]
    };
    std::iter::once(titles.map(String::from).to_vec()).chain(survey.topics.iter().map(row)).collect()
}

/// One sentence per irregularity that the table does not explain.
fn remarks(topic: &TopicSurvey) -> Vec<String> {
    let quality = &topic.quality;
    let counts = [
        (topic.truncated_frames as u64, "JPEG frames without an end marker: cut off by camera or cable"),
        (topic.missing_frames, "frames that the camera counted are not in the log"),
        (quality.without_stamp as u64, "messages without a stamp: the time of publication stands in"),
        (quality.non_finite as u64, "messages with numbers that are not finite: left out"),
        (quality.undecodable as u64, "messages that do not fit their definition: left out"),
    ];
    let remark = |(count, what): (u64, &str)| format!("{}: {count} {what}", topic.topic);
    counts.into_iter().filter(|(count, _)| *count > 0).map(remark).collect()
}

/// Aligned columns, two spaces apart: the first and the last two to the left, numbers in between to the right.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            let left = column == 0 || column + 2 >= columns;
            if left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        format!("{}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}
