//! What is shown while a recording runs: one line that stays on a terminal, or one line every five seconds elsewhere.

use std::sync::Arc;
use std::time::{Duration, Instant};

use console::style;
use indicatif::ProgressBar;
use raven::cli;
use raven::log::{CameraSkew, Side};

use super::source::{Counters, Counts};
use super::writer::Progress;
use crate::clock::Arrival;

/// A source that says nothing for so long is silent, unless its messages are usually further apart.
const SILENT_S: f64 = 1.0;
/// A source whose messages are far apart is silent after so many of its intervals.
const SILENT_INTERVALS: f64 = 3.0;
/// How often the line changes on a terminal, and how often there is one elsewhere.
const PERIODS: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(5)];

/// A source as it is shown.
#[derive(Debug, Clone)]
pub struct Shown {
    /// Name in the recording.
    pub topic: String,
    /// Which camera, if it is one.
    pub camera: Option<Side>,
    /// What it has done so far.
    pub counters: Arc<Counters>,
}

impl Shown {
    fn name(&self) -> &str {
        match self.camera {
            Some(side) => side.name(),
            None => &self.topic,
        }
    }
}

/// How far apart the latest frames of both cameras are; `None` without two of them.
#[must_use]
pub fn skew(shown: &[Shown]) -> Option<CameraSkew> {
    let recent = |side| shown.iter().find(|shown| shown.camera == Some(side)).map(|shown| shown.counters.recent_frames());
    CameraSkew::of(&recent(Side::Left)?, &recent(Side::Right)?)
}

/// The live line.
pub struct Live {
    bar: ProgressBar,
    started: Instant,
    shown: Instant,
    before: Vec<Counts>,
    bytes_before: u64,
}

impl Live {
    /// Starts the clock of the line.
    #[must_use]
    pub fn start() -> Self {
        let now = Instant::now();
        Self { bar: cli::spinner("recording"), started: now, shown: now, before: Vec::new(), bytes_before: 0 }
    }

    /// Shows how it goes, if it is time.
    pub fn show(&mut self, shown: &[Shown], progress: &Progress) {
        let [on_terminal, elsewhere] = PERIODS;
        let lasted = self.shown.elapsed();
        if lasted < if self.bar.is_hidden() { elsewhere } else { on_terminal } {
            return;
        }
        self.shown = Instant::now();
        let counts: Vec<Counts> = shown.iter().map(|shown| shown.counters.read()).collect();
        let now_ns = Arrival::now().monotonic_ns;
        let mut parts = vec![format!("REC {}", minutes(self.started.elapsed()))];
        for (i, (shown, counts)) in shown.iter().zip(&counts).enumerate() {
            let since = self.before.get(i).map_or(0, |before| before.received);
            let rate_hz = counts.received.saturating_sub(since) as f64 / lasted.as_secs_f64();
            let (text, alarming) = source(shown.name(), counts, rate_hz, now_ns);
            parts.push(if alarming { style(text).red().for_stderr().to_string() } else { text });
        }
        if let Some(skew) = skew(shown) {
            parts.push(format!("skew {:.1} +- {:.1} ms", 1e3 * skew.right_minus_left_s, 1e3 * skew.spread_s));
        }
        let bytes = progress.bytes();
        let rate = bytes.saturating_sub(self.bytes_before) as f64 / lasted.as_secs_f64();
        parts.push(format!("{:.1} MB, {:.2} MB/s, {:.1} GB free", bytes as f64 * 1e-6, rate * 1e-6, progress.free_bytes() as f64 * 1e-9));
        (self.before, self.bytes_before) = (counts, bytes);
        let line = parts.join(" | ");
        if self.bar.is_hidden() {
            eprintln!("{line}");
        } else {
            self.bar.set_message(line);
        }
    }

    /// Says a sentence that is no result.
    pub fn say(&self, sentence: &str) {
        self.bar.suspend(|| cli::warn(sentence));
    }

    /// Takes the line away, and returns how long it was there.
    pub fn end(self) -> Duration {
        self.bar.finish_and_clear();
        self.started.elapsed()
    }
}

/// What is said of a source, and whether it is alarming.
fn source(topic: &str, counts: &Counts, rate_hz: f64, now_ns: u64) -> (String, bool) {
    let Some(last_ns) = counts.last_monotonic_ns else { return (format!("{topic} no message yet"), true) };
    let silent_s = now_ns.saturating_sub(last_ns) as f64 * 1e-9;
    let usual_s = counts.median_interval_s.map_or(0.0, |median_s| SILENT_INTERVALS * median_s);
    if silent_s > SILENT_S.max(usual_s) {
        return (format!("{topic} SILENT for {silent_s:.0} s"), true);
    }
    let mut text = match &counts.frames {
        Some(frames) => format!("{topic} {rate_hz:.1} fps, {} drops", frames.total()),
        None => format!("{topic} {rate_hz:.0} Hz, {} gaps", counts.gaps),
    };
    if let Some(lag_s) = counts.lag_s {
        text += &format!(", lag {:.1} ms", 1e3 * lag_s);
    }
    if counts.dropped > 0 {
        text += &format!(", {} DROPPED", counts.dropped);
    }
    let drops = counts.frames.is_some_and(|frames| frames.total() > 0);
    (text, counts.dropped > 0 || drops)
}

fn minutes(time: Duration) -> String {
    format!("{:02}:{:02}", time.as_secs() / 60, time.as_secs() % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_and_drops_are_alarming_and_a_slow_source_is_not() {
        let at = |last_s: f64, median_s: f64| Counts {
            last_monotonic_ns: Some((last_s * 1e9) as u64),
            median_interval_s: Some(median_s),
            lag_s: Some(0.0021),
            ..Counts::default()
        };
        let now_ns = 10_000_000_000;
        assert_eq!(source("/a", &at(9.9, 0.001), 1000.4, now_ns), ("/a 1000 Hz, 0 gaps, lag 2.1 ms".to_owned(), false));
        assert_eq!(source("/a", &at(5.0, 0.001), 0.0, now_ns), ("/a SILENT for 5 s".to_owned(), true));
        assert!(!source("/a", &at(5.0, 2.0), 0.0, now_ns).1, "one message in two seconds");
        assert_eq!(source("/a", &Counts::default(), 0.0, now_ns), ("/a no message yet".to_owned(), true));
        let frames = |missed| Some(raven::log::FrameLosses { frames: 30, missed, ..Default::default() });
        let camera = Counts { frames: frames(0), ..at(9.9, 0.033) };
        assert_eq!(source("left", &camera, 29.97, now_ns), ("left 30.0 fps, 0 drops, lag 2.1 ms".to_owned(), false));
        assert!(source("left", &Counts { frames: frames(1), ..camera }, 29.97, now_ns).1);
        let dropping = Counts { dropped: 7, ..at(9.9, 0.001) };
        assert_eq!(source("/a", &dropping, 1000.0, now_ns), ("/a 1000 Hz, 0 gaps, lag 2.1 ms, 7 DROPPED".to_owned(), true));
    }
}
