//! What a recording came to: the table at its end and the same for machines.

use std::path::PathBuf;

use raven::cli::Outcome;
use raven::log::{CameraSkew, FrameLosses, Side};
use serde::Serialize;

use super::source::Counts;
use super::writer::Written;
use crate::table::table;

/// What is said of messages whose stamps cannot be read.
pub(crate) const MISFITS: &str = "messages that do not fit their definition; they are recorded as they came";

/// A topic and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicSummary {
    /// Name in the recording.
    pub topic: String,
    /// Which camera, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<Side>,
    /// Its counters at the end.
    #[serde(flatten)]
    pub counts: Counts,
}

/// The machine-readable result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Files, in order.
    pub files: Vec<PathBuf>,
    /// Their bytes.
    pub bytes: u64,
    /// How long it was recorded (s).
    pub seconds: f64,
    /// Why the recording ended before it was told to.
    pub trouble: Option<String>,
    /// Sentences about what was lost; empty if nothing was.
    pub lost: Vec<String>,
    /// Cameras and topics, in the order of the command line.
    pub topics: Vec<TopicSummary>,
    /// How far apart the last frames of both cameras were.
    pub skew: Option<CameraSkew>,
}

impl Summary {
    /// Sums up.
    #[must_use]
    pub fn new(written: Written, seconds: f64, topics: Vec<TopicSummary>, skew: Option<CameraSkew>) -> Self {
        let Written { files, bytes, trouble } = written;
        let lost = trouble.iter().cloned().chain(topics.iter().flat_map(losses)).collect();
        Self { files, bytes, seconds, trouble, lost, topics, skew }
    }

    /// Whether everything that was asked for is there.
    #[must_use]
    pub const fn outcome(&self) -> Outcome {
        if self.lost.is_empty() { Outcome::Done } else { Outcome::DataLost }
    }

    /// The result as people read it.
    #[must_use]
    pub fn render(&self) -> String {
        let messages: u64 = self.topics.iter().map(|topic| topic.counts.written).sum();
        let files: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        let mut lines =
            vec![format!("{}: {:.1} MB, {:.1} s, {messages} messages", files.join(", "), self.bytes as f64 * 1e-6, self.seconds)];
        let number = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
        let titles = ["topic", "messages", "lost", "rate/Hz", "gaps", "longest/ms", "interruptions"].map(str::to_owned).to_vec();
        let row = |TopicSummary { topic, counts, .. }: &TopicSummary| {
            vec![
                topic.clone(),
                counts.written.to_string(),
                (counts.received - counts.written).to_string(),
                number(counts.rate_hz, 2),
                counts.gaps.to_string(),
                number(counts.longest_interval_s.map(|longest| 1e3 * longest), 2),
                counts.interruptions.to_string(),
            ]
        };
        lines.extend(table(&std::iter::once(titles).chain(self.topics.iter().map(row)).collect::<Vec<_>>(), 0));
        lines.extend(camera_table(self.topics.iter().filter_map(|topic| Some((topic.camera?, topic.counts.frames.unwrap_or_default())))));
        if let Some(skew) = self.skew {
            let [skew_ms, spread_ms] = [skew.right_minus_left_s, skew.spread_s].map(|seconds| 1e3 * seconds);
            lines.push(format!("cameras: right minus left {skew_ms:.2} +- {spread_ms:.2} ms (the last frames)"));
        }
        lines.push(String::new());
        lines.join("\n")
    }
}

/// Frames of each camera by what went wrong with them; nothing without cameras.
pub(crate) fn camera_table(cameras: impl Iterator<Item = (Side, FrameLosses)>) -> Vec<String> {
    let titles = ["camera", "frames", "lost by driver", "left out", "damaged", "cut off", "repeated"].map(str::to_owned).to_vec();
    let row = |(side, losses): (Side, FrameLosses)| {
        let counts = [losses.frames].into_iter().chain(losses.causes().map(|(count, _)| count)).map(|count| count.to_string());
        std::iter::once(side.name().to_owned()).chain(counts).collect::<Vec<_>>()
    };
    let rows: Vec<_> = cameras.map(row).collect();
    if rows.is_empty() { Vec::new() } else { table(&std::iter::once(titles).chain(rows).collect::<Vec<_>>(), 0) }
}

/// One sentence per way in which something is not in the recording.
fn losses(TopicSummary { topic, counts, .. }: &TopicSummary) -> Vec<String> {
    let unwritten = counts.received.saturating_sub(counts.written).saturating_sub(counts.dropped);
    let sentences = [
        (u64::from(counts.received == 0), "no message came"),
        (counts.dropped, "messages lost because the disk was too slow for the queue"),
        (unwritten, "messages lost that came when the file could no longer be written"),
        (counts.interruptions, "times that the connection was lost, and with it what was sent meanwhile"),
        (counts.misfits, MISFITS),
    ];
    let sentence = |(i, (count, what)): (usize, (u64, &str))| match (i, count) {
        (_, 0) => None,
        (0, _) => Some(format!("{topic}: {what}.")),
        _ => Some(format!("{topic}: {count} {what}.")),
    };
    let frames = counts.frames.iter().flat_map(FrameLosses::causes).filter(|(count, _)| *count > 0);
    let frames = frames.map(|(count, what)| format!("{topic}: {count} {what}."));
    sentences.into_iter().enumerate().filter_map(sentence).chain(frames).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_is_not_in_the_file_is_data_lost() {
        let of = |counts: Counts, trouble: Option<&str>| {
            let written = Written { trouble: trouble.map(str::to_owned), ..Written::default() };
            Summary::new(written, 1.0, vec![TopicSummary { topic: "/a".to_owned(), camera: None, counts }], None)
        };
        let whole = Counts { received: 10, written: 10, ..Counts::default() };
        assert_eq!(of(whole.clone(), None).outcome(), Outcome::Done);
        let dropped = of(Counts { received: 13, dropped: 3, ..whole.clone() }, None);
        assert_eq!((dropped.outcome(), dropped.lost.len()), (Outcome::DataLost, 1), "{:?}", dropped.lost);
        let unwritten = of(Counts { received: 15, dropped: 3, ..whole.clone() }, None);
        assert!(unwritten.lost[1].starts_with("/a: 2 messages lost that came when"), "{:?}", unwritten.lost);
        assert_eq!(of(Counts::default(), None).lost, ["/a: no message came."]);
        let frames = Some(FrameLosses { frames: 10, truncated: 2, ..FrameLosses::default() });
        let truncated = of(Counts { frames, ..whole.clone() }, None);
        assert_eq!((truncated.outcome(), truncated.lost.len()), (Outcome::DataLost, 1));
        assert!(truncated.lost[0].starts_with("/a: 2 frames that are cut off"), "{:?}", truncated.lost);
        assert_eq!(of(whole, Some("The recording ended early.")).outcome(), Outcome::DataLost);
    }
}
