//! What tracking made of a recording, for people and for scripts.

use std::fmt;

use raven::log::{Recording, Side, TipStatus};
use serde::Serialize;

use crate::batches::Counts;
use crate::tips::Tips;
use crate::tracker::{Followed, Record};

/// A camera that sent nothing for longer than this is reported [s].
const MISSING_S: f64 = 1.0;

/// A time without frames of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Missing {
    /// Which camera.
    pub camera: Side,
    /// Since the first frame of the recording [s].
    pub from_s: f64,
    /// How long [s].
    pub seconds: f64,
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Left frames, each with a tip observation.
    pub pairs: usize,
    /// Observations with a position.
    pub seen: usize,
    /// Observations in which the marker was not found or partly hidden, in one camera at least.
    pub occluded: usize,
    /// Observations that were rejected.
    pub jumped: usize,
    /// Time for all [s].
    pub seconds: f64,
    /// Left frames per second.
    pub pairs_per_second: f64,
    /// Median of the stamp of the nearest right frame minus that of each left frame [s].
    pub right_minus_left_s: f64,
    /// Standard deviation of the stamps, left and right [s].
    pub stamp_jitter_s: [f64; 2],
    /// Frames that were cut off or could not be decoded.
    pub frames_undecodable: usize,
    /// Frames of another size than was calibrated.
    pub frames_other_size: usize,
    /// Frames left out as their stamp was not after that of the frame before.
    pub frames_out_of_order: usize,
    /// Frames at whose time the log has no motor angles.
    pub frames_without_motor: usize,
    /// Frames of cameras out of whose view the motors and the registration put the tip.
    pub frames_out_of_view: usize,
    /// When a camera sent nothing that could be used.
    pub missing: Vec<Missing>,
    /// A sentence about other messages than frames that could not be used.
    pub unusable: Option<String>,
}

impl Report {
    /// Of the observations and what was counted on the way.
    #[must_use]
    pub fn new(recording: &Recording, tips: &Tips, followed: &Followed, counts: Counts, seconds: f64) -> Self {
        let count = |status| tips.tips.iter().filter(|tip| tip.status == status).count();
        Self {
            pairs: tips.tips.len(),
            seen: count(TipStatus::Seen),
            occluded: count(TipStatus::Occluded),
            jumped: count(TipStatus::Jumped),
            seconds,
            pairs_per_second: tips.tips.len() as f64 / seconds.max(1e-9),
            right_minus_left_s: tips.right_minus_left_s,
            stamp_jitter_s: tips.jitter_s,
            frames_undecodable: counts.undecodable + followed.undecodable,
            frames_out_of_order: counts.out_of_order,
            frames_other_size: counts.other_size,
            frames_without_motor: followed.without_motor,
            frames_out_of_view: followed.out_of_view.iter().sum(),
            missing: missing(&followed.records),
            unusable: recording.unusable(),
        }
    }

    /// Whether some of the recording could not be used.
    #[must_use]
    pub const fn has_lost_data(&self) -> bool {
        self.frames_undecodable > 0 || self.frames_other_size > 0 || self.unusable.is_some()
    }
}

/// Long times without frames, within the time that the two cameras recorded.
fn missing(records: &[Vec<Record>; 2]) -> Vec<Missing> {
    let stamps = || records.iter().flatten().map(|record| record.stamp);
    let (Some(first), Some(last)) = (stamps().min(), stamps().max()) else { return Vec::new() };
    let of = |camera: Side| {
        let own = records[camera as usize].iter().map(|record| record.stamp);
        let times: Vec<f64> = [first].into_iter().chain(own).chain([last]).map(|stamp| stamp.seconds_since(first)).collect();
        let steps = times.windows(2).map(|pair| (pair[0], pair[1] - pair[0])).filter(|(_, seconds)| *seconds > MISSING_S);
        steps.map(|(from_s, seconds)| Missing { camera, from_s, seconds }).collect::<Vec<Missing>>()
    };
    Side::BOTH.into_iter().flat_map(of).collect()
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |count: usize| 100.0 * count as f64 / self.pairs.max(1) as f64;
        writeln!(f, "pairs             {:6}", self.pairs)?;
        for (name, count) in [("seen", self.seen), ("occluded", self.occluded), ("jumped", self.jumped)] {
            writeln!(f, "  {name:15} {count:6}  {:5.1} %", share(count))?;
        }
        writeln!(f, "right minus left  {:6.2} ms", 1e3 * self.right_minus_left_s)?;
        let [left, right] = self.stamp_jitter_s;
        writeln!(f, "stamp jitter      {:6.2} ms left, {:.2} ms right", 1e3 * left, 1e3 * right)?;
        for (name, count) in [
            ("undecodable", self.frames_undecodable),
            ("of another size", self.frames_other_size),
            ("out of order", self.frames_out_of_order),
            ("without motors", self.frames_without_motor),
            ("out of view", self.frames_out_of_view),
        ] {
            if count > 0 {
                writeln!(f, "frames {name:15} {count}")?;
            }
        }
        for Missing { camera, from_s, seconds } in &self.missing {
            writeln!(f, "no {:5} frames   {seconds:6.1} s from {from_s:.1} s on", camera.name())?;
        }
        writeln!(f, "time              {:6.1} s, {:.0} pairs/s", self.seconds, self.pairs_per_second)
    }
}
