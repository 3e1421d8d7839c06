//! What a proposal is expected to tell, as people read it and as scripts do.

use std::fmt::Write as _;

use serde::Serialize;

use super::REPETITIONS_MAX;
use crate::batch::IDENTIFIED_BELOW;

/// What `--json` writes.
#[derive(Debug, Serialize)]
pub struct Report {
    /// One per unknown.
    pub parameters: Vec<Line>,
    /// What the proposal is made of, in words.
    pub pieces: Vec<String>,
    /// Length of the sinusoid that it is held against [s].
    pub sinusoid_s: f64,
    /// Length of the proposal [s].
    pub duration_s: f64,
    /// Rates of the nominal cameras, of faster ones and of joint encoders [Hz].
    pub camera_hz: f64,
    pub fast_camera_hz: f64,
    pub encoder_hz: f64,
}

/// Expected posterior over prior deviations of one unknown.
#[derive(Debug, Serialize)]
pub struct Line {
    /// Name.
    pub name: String,
    /// Joint, `shoulder->elbow` for a coupling, null for the cameras.
    pub joint: Option<String>,
    /// By the lab's sinusoid.
    pub sinusoid: f64,
    /// By the proposal.
    pub proposal: f64,
    /// By the same with faster cameras.
    pub fast_cameras: f64,
    /// And with joint encoders beside the nominal cameras.
    pub joint_encoders: f64,
    /// Whether the proposal would determine it.
    pub identified: bool,
    /// If not, how often it must be repeated; null if that would not do either.
    pub repetitions: Option<usize>,
    /// Whether it was asked for.
    #[serde(skip)]
    pub named: bool,
}

impl Report {
    /// In words.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { sinusoid_s, duration_s, camera_hz, fast_camera_hz, .. } = self;
        let mut text = format!(
            "expected posterior/prior deviation, the file's other numbers known to their tolerances; cameras: 0.1 mm across, 1.5 mm in depth, \
             {camera_hz:.0} Hz\n\
             {:<15} {:>12} {:>12} {:>14} {:>16}\n{:<15} {:>12} {:>12} {:>14} {:>16}\n",
            "parameter",
            "sinusoid",
            "proposal",
            "the same,",
            "and with joint",
            "",
            format!("{sinusoid_s:.0} s"),
            format!("{duration_s:.0} s"),
            format!("cameras {fast_camera_hz:.0} Hz"),
            "encoders"
        );
        for Line { name, sinusoid, proposal, fast_cameras, joint_encoders, identified, .. } in &self.parameters {
            let verdict = if *identified { "" } else { "  not identified" };
            let _ = writeln!(text, "{name:<15} {sinusoid:>12.3} {proposal:>12.3} {fast_cameras:>14.3} {joint_encoders:>16.3}{verdict}");
        }
        text.push_str("\nproposal:\n");
        for (i, piece) in self.pieces.iter().enumerate() {
            let _ = writeln!(text, "{:>3}. {piece}", i + 1);
        }
        for line in self.parameters.iter().filter(|line| line.named && !line.identified) {
            let verdict = |ratio: f64| {
                let would = if ratio <= IDENTIFIED_BELOW { "would" } else { "would not" };
                format!("{would} ({ratio:.2})")
            };
            let repeated = match line.repetitions {
                Some(count) => format!("it takes {count} repetitions of this motion"),
                None => format!("{REPETITIONS_MAX} repetitions would not do either"),
            };
            let _ = writeln!(
                text,
                "{} is not identified by cameras of {camera_hz:.0} Hz: {repeated}. Cameras of {fast_camera_hz:.0} Hz {}, joint encoders {}.",
                line.name,
                verdict(line.fast_cameras),
                verdict(line.joint_encoders)
            );
        }
        text
    }
}
