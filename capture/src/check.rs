//! `raven-capture check`: what is in a log, how regular it is, and what can be done with it.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;

use raven::cli::{self, Outcome};
use raven::log::{FrameLosses, Jump, Lag, Recovery, Side, Survey, TopicSurvey, recover, topics};
use raven::{Result, files};
use serde::Serialize;

use crate::devices;
use crate::record::summary::camera_table;
use crate::robot_trial::disagreement;
use crate::steps::{Step, steps};
use crate::table::table;

/// What is said of a file with the name of a recording under way.
const UNFINISHED: &str = "this recording is under way or was cut off, and up to a second at its end may be missing";

/// Arguments of `raven-capture check`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  raven-capture check session.mcap\n  raven-capture check cut-off.mcap --recover -o session.mcap\n  \
                        raven-capture check --devices --left serial:2B4F91C0 --right serial:77D03A12 --robot ros://robot:11311/ravenstate\n\n\
                        Exit codes: 0 the log is whole, 1 failed, 2 wrong arguments, 3 the log is damaged or was cut off, or a recording would lose data.")]
pub struct Args {
    /// The log.
    #[arg(required_unless_present = "devices", conflicts_with = "devices")]
    pub file: Option<PathBuf>,
    /// The preflight.
    #[command(flatten)]
    pub devices: devices::DeviceArgs,
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
    let Some(file) = args.file.as_deref() else { return devices::run(&args.devices, args.json.as_deref(), out) };
    files::apart([file], &[("-o", args.output.as_deref()), ("--json", args.json.as_deref())])?;
    let survey = Survey::of(file)?;
    let steps = steps(&survey);
    let recovery = args.output.as_ref().map(|output| recover(file, output)).transpose()?;
    let mut text = render(&survey, &steps);
    if let (Some(recovery), Some(output)) = (&recovery, &args.output) {
        let of = recovery.expected_messages.map_or_else(String::new, |expected| format!(" of {expected}"));
        let (messages, attachments) = (recovery.messages, recovery.attachments);
        text += &format!("\n{messages}{of} messages and {attachments} attachments are saved in {}.\n", output.display());
    }
    let report = Report { survey: &survey, steps: &steps, recovery: recovery.as_ref() };
    cli::results(out, &text, args.json.as_deref(), &report)?;
    if survey.damage.is_some() && recovery.is_none() {
        cli::warn(&format!("{}: the log is damaged; `--recover -o OUT.mcap` saves what can be read.", file.display()));
    }
    let disagreeing = |topic: &TopicSurvey| disagreement(&topic.topic, topic.lag.map(|lag| lag.least_s));
    survey.topics.iter().filter_map(disagreeing).for_each(|sentence| cli::warn(&sentence));
    jumps(&survey).iter().for_each(|sentence| cli::warn(sentence));
    let active = file.extension().is_some_and(|extension| extension == "active");
    if active {
        cli::warn(&format!("{}: {UNFINISHED}.", file.display()));
    }
    Ok(if survey.damage.is_some() || active { Outcome::DataLost } else { Outcome::Done })
}

/// The report as people read it.
fn render(survey: &Survey, steps: &[Step]) -> String {
    let span = survey.span();
    let lasts = span.map_or_else(String::new, |[first, last]| format!(", {:.3} s from {first}", last.seconds_since(first)));
    let mut lines = vec![format!("{}: {:.1} MB, {} messages{lasts}", survey.path.display(), survey.bytes as f64 * 1e-6, survey.messages)];
    lines.extend(survey.damage.iter().map(|damage| format!("DAMAGED: {}.", damage.fault)));
    if !survey.session.is_empty() {
        let pairs: Vec<String> = survey.session.iter().map(|(key, value)| format!("{key} {value}")).collect();
        lines.push(format!("session: {}", pairs.join(", ")));
    }
    for (name, record) in survey.records.iter().filter(|(name, _)| name.starts_with("camera.")) {
        let of = |key: &str| record.get(key).map(String::as_str);
        let words: Vec<&str> = ["card", "serial", "port", "mode", "stamps"].into_iter().filter_map(of).collect();
        lines.push(format!("{name}: {}", words.join(", ")));
    }
    lines.extend(survey.attachments.iter().map(|file| format!("attachment: {} ({}, {} bytes)", file.name, file.media_type, file.bytes)));
    lines.push(String::new());
    lines.extend(table(&topic_rows(survey, span.map(|[first, _]| first)), 2));
    lines.push(String::new());
    let before_remarks = lines.len();
    lines.extend(camera_table(survey.losses.iter().map(|(side, losses)| (*side, *losses))));
    if let Some(skew) = survey.cameras {
        let (signed, absolute) = (1e3 * skew.right_minus_left_s, 1e3 * skew.absolute_s);
        lines.push(format!("cameras: right minus left {signed:.2} ms, {absolute:.2} ms without sign (medians over the nearest frames)"));
    }
    if let Some(clock) = survey.clock {
        let (moved, step) = (1e3 * clock.moved_s, 1e3 * clock.largest_step_s);
        lines.push(format!(
            "clock: the system clock moved {moved:.3} ms against the recorder's, at most {step:.3} ms from one reading to the next"
        ));
    }
    // Through a step of the clock there is no line.
    let steady = survey.topics.iter().filter(|topic| topic.jumps.is_empty());
    lines.extend(steady.filter_map(|topic| topic.lag.map(|lag| drift(&topic.topic, lag))));
    lines.extend(jumps(survey));
    lines.extend(survey.tip.map(|tip| format!("tip: {} seen, {} occluded, {} jumped", tip.seen, tip.occluded, tip.jumped)));
    if survey.torque_recorded == Some(false) {
        lines.push("motors: torque was not recorded".to_owned());
    }
    lines.extend(survey.topics.iter().flat_map(|topic| remarks(topic, &survey.losses)));
    if lines.len() > before_remarks {
        lines.push(String::new());
    }
    let answer = |step: &Step| if step.ready { "ready" } else { "no" }.to_owned();
    lines.extend(table(&steps.iter().map(|step| vec![step.program.to_owned(), answer(step), step.note.clone()]).collect::<Vec<_>>(), 2));
    lines.push(String::new());
    lines.join("\n")
}

/// How the clock of a topic's stamps went against the recorder's.
fn drift(topic: &str, lag: Lag) -> String {
    let (first_ms, ppm, slack_ms) = (1e3 * lag.first_s, 1e6 * lag.drift, 1e3 * lag.slack_s);
    let goes = if lag.drift < 0.0 { "gains" } else { "loses" };
    format!(
        "{topic}: {first_ms:.3} ms from stamp to arrival at the start, its clock {goes} {:.2} ppm on the recorder's; both within {slack_ms:.3} ms",
        ppm.abs()
    )
}

/// A sentence for each step of a clock, in seconds as `cut` counts them.
fn jumps(survey: &Survey) -> Vec<String> {
    let Some(first) = survey.first_arrival else { return Vec::new() };
    let of = |topic: &TopicSurvey| {
        let jump = |jump: &Jump| {
            let goes = if jump.ahead_s < 0.0 { "back" } else { "ahead" };
            format!(
                "{}: at {:.3} s the clock of its stamps jumps {goes} by {:.1} ms against the recorder's; use the part before or after it \
                 (`raven-capture cut`), and let one time service keep both clocks.",
                topic.topic,
                jump.at.seconds_since(first),
                1e3 * jump.ahead_s.abs()
            )
        };
        topic.jumps.iter().map(jump).collect::<Vec<_>>()
    };
    survey.topics.iter().flat_map(of).collect()
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
fn remarks(topic: &TopicSurvey, losses: &BTreeMap<Side, FrameLosses>) -> Vec<String> {
    let quality = &topic.quality;
    // Where the recorder noted what happened to each frame, there is a table of it.
    let noted = topics::camera_of(&topic.topic).is_some_and(|side| losses.contains_key(&side));
    let unless_noted = |count: u64| if noted { 0 } else { count };
    let counts = [
        (unless_noted(topic.truncated_frames as u64), "frames without their end: cut off by camera or cable"),
        (unless_noted(topic.missing_frames), "frames that the camera counted are not in the log"),
        (quality.without_stamp as u64, "messages without a stamp: the time of publication stands in"),
        (quality.non_finite as u64, "messages with numbers that are not finite: left out"),
        (quality.undecodable as u64, "messages that do not fit their definition: left out"),
    ];
    let remark = |(count, what): (u64, &str)| format!("{}: {count} {what}", topic.topic);
    counts.into_iter().filter(|(count, _)| *count > 0).map(remark).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use raven::log::{LogWriter, RavenState, Stamp, Times};

    use super::*;
    use clap::Parser;

    /// Half a minute of robot and cameras at low rates; the right camera is 5 ms late and loses a frame.
    fn session(path: &Path) {
        let mut log = LogWriter::create(path).unwrap();
        let at = |ms: u64| Stamp(1_700_000_000_000_000_000 + ms * 1_000_000);
        for i in 0..300 {
            log.robot_state(at(100 * i), &RavenState::default()).unwrap();
            log.compressed_image(Side::Left, at(100 * i), i as u32, &[0xff, 0xd8, 0xff, 0xd9]).unwrap();
            if i != 100 {
                log.compressed_image(Side::Right, at(100 * i + 5), i as u32, &[0xff, 0xd8, 1]).unwrap();
            }
        }
        log.joint_states(topics::JOINT_ENCODERS, at(0), &["shoulder"], &[0.0], None).unwrap();
        log.finish().unwrap();
    }

    fn check(words: &[&str]) -> (Outcome, String) {
        let args = crate::Args::parse_from(["raven-capture", "check"].iter().chain(words));
        let mut out = Vec::new();
        let outcome = crate::run(args, &mut out).unwrap();
        (outcome, String::from_utf8(out).unwrap())
    }

    fn row<'t>(text: &'t str, start: &str) -> Vec<&'t str> {
        text.lines().find(|line| line.starts_with(start)).unwrap().split_whitespace().collect()
    }

    #[test]
    fn a_session_is_described_and_its_next_step_named() {
        let folder = tempfile::tempdir().unwrap();
        let (file, json) = (folder.path().join("session.mcap"), folder.path().join("check.json"));
        session(&file);
        let (outcome, text) = check(&[file.to_str().unwrap(), "--json", json.to_str().unwrap()]);
        assert_eq!(outcome, Outcome::Done);
        let right = row(&text, topics::RIGHT_COMPRESSED);
        assert_eq!(right[1..8], ["299", "9.97", "100.000", "200.000", "1", "0", "0"], "{text}");
        assert!(text.contains("right minus left 5.00 ms"), "{text}");
        assert!(text.contains("299 frames without their end"), "{text}");
        assert!(text.contains("1 frames that the camera counted"), "{text}");
        assert_eq!(row(&text, "raven-track")[1], "ready");
        assert_eq!(row(&text, "raven-identify")[1..], ["no", "needs", "/tip:", "run", "raven-track"]);

        let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
        assert_eq!(json["messages"], 900);
        assert_eq!(json["topics"][1]["topic"], topics::RAVEN_STATE);
        assert_eq!(json["topics"][1]["gaps"], 0);
        assert_eq!(json["steps"][2]["ready"], true);
    }

    /// A minute of robot states whose clock is so far ahead of the recorder's at the k-th [s].
    fn states_of_a_clock(file: &Path, ahead_s: impl Fn(u32) -> f64) {
        let mut log = LogWriter::create(file).unwrap();
        for k in 0..600 {
            let arrived = Stamp(1_700_000_000_000_000_000).plus_seconds(0.1 * f64::from(k));
            let measured = arrived.plus_seconds(ahead_s(k));
            log.robot_state(Times { measured, arrived }, &RavenState::default()).unwrap();
        }
        log.finish().unwrap();
    }

    #[test]
    fn the_robots_clock_is_held_against_the_recorders() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("session.mcap");
        // The robot's clock is 3 ms behind, and loses 50 us a second.
        states_of_a_clock(&file, |k| -0.003 - 50e-6 * 0.1 * f64::from(k));
        let (_, text) = check(&[file.to_str().unwrap()]);
        let line =
            "/ravenstate: 3.000 ms from stamp to arrival at the start, its clock loses 50.00 ppm on the recorder's; both within 0.000 ms";
        assert!(text.contains(line), "{text}");
    }

    #[test]
    fn a_clock_that_jumps_does_not_drift() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("session.mcap");
        states_of_a_clock(&file, |k| if k < 300 { -0.003 } else { -0.503 });
        let (_, text) = check(&[file.to_str().unwrap()]);
        let line = "/ravenstate: at 30.000 s the clock of its stamps jumps back by 500.0 ms against the recorder's; use the part";
        assert!(text.contains(line) && !text.contains("ppm"), "{text}");
    }

    #[test]
    fn a_cut_off_session_is_damaged_and_saved() {
        let folder = tempfile::tempdir().unwrap();
        let (file, output) = (folder.path().join("cut.mcap"), folder.path().join("saved.mcap"));
        session(&file);
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() / 3]).unwrap();
        let words = [file.to_str().unwrap(), "--recover", "-o", output.to_str().unwrap()];
        let twice = crate::Args::parse_from(["raven-capture", "check"].iter().chain(&words).chain(&["--json", words[3]]));
        let said = crate::run(twice, &mut Vec::new()).unwrap_err().to_string();
        assert!(said.contains("-o and --json both name") && !output.exists(), "{said}");
        let (outcome, text) = check(&words);
        assert_eq!(outcome, Outcome::DataLost);
        assert!(text.contains("DAMAGED: it breaks off") && text.contains("saved.mcap"), "{text}");
        let (outcome, _) = check(&[output.to_str().unwrap()]);
        assert_eq!(outcome, Outcome::Done);
    }

    #[test]
    fn a_recording_that_was_killed_is_whole_but_for_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("session.mcap.active");
        session(&file);
        let (outcome, text) = check(&[file.to_str().unwrap()]);
        assert_eq!(outcome, Outcome::DataLost);
        assert!(!text.contains("DAMAGED"), "{text}");
    }
}
