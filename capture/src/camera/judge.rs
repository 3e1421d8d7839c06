//! What is wrong with a frame, if anything, judged against those before it.
//!
//! Two detectors of missing frames are needed, since each sees what the other cannot: the driver numbers the frames that arrive, so a frame lost
//! on the bus leaves a gap in the numbers; a frame that the camera itself leaves out leaves none, but an interval of about twice the usual.

use raven::log::{FrameMeta, Stamp, is_truncated_jpeg};

use super::{Encoding, Frame, Mode};
use crate::record::pace::Pace;

/// A larger gap of the sequence numbers is a count that started again.
const LARGEST_GAP: u32 = 1 << 20;

/// Judges the frames of one stream, from one opening to the next.
pub struct Judge {
    mode: Mode,
    pace: Pace,
    sequence: Option<u32>,
    before: Vec<u8>,
}

impl Judge {
    /// A judge that has seen nothing yet.
    #[must_use]
    pub fn new(mode: Mode) -> Self {
        // A camera sends no faster than its mode says, however late its frames are taken.
        let least_s = Some(mode.rate_hz()).filter(|rate_hz| *rate_hz > 0.0).map_or(0.0, f64::recip);
        Self { mode, pace: Pace::of_at_least(least_s), sequence: None, before: Vec::new() }
    }

    /// Judges the next frame. The note's `timestamp` is left to the log.
    pub fn take(&mut self, frame: &Frame) -> FrameMeta {
        let gap = self.sequence.map_or(0, |before| frame.sequence.wrapping_sub(before).wrapping_sub(1));
        let gap = if gap > LARGEST_GAP { 0 } else { gap };
        self.sequence = Some(frame.sequence);
        let late = self.pace.take(Stamp(frame.monotonic_ns()));
        let meta = FrameMeta {
            timestamp: None,
            sequence: frame.sequence,
            kernel_monotonic_ns: frame.monotonic_ns(),
            dequeue_monotonic_ns: frame.dequeued.monotonic_ns,
            flags: frame.flags,
            bytes: u32::try_from(frame.bytes.len()).unwrap_or(u32::MAX),
            gap,
            truncated: false,
            repeated: false,
            // A gap of the numbers explains the interval.
            skipped: if gap == 0 { late } else { 0 },
        };
        if meta.is_damaged() {
            return meta;
        }
        let repeated = !frame.bytes.is_empty() && self.before == frame.bytes;
        self.before.clone_from(&frame.bytes);
        FrameMeta { truncated: self.is_truncated(&frame.bytes), repeated, ..meta }
    }

    /// How regular the frames were.
    #[must_use]
    pub const fn pace(&self) -> &Pace {
        &self.pace
    }

    fn is_truncated(&self, bytes: &[u8]) -> bool {
        match (self.mode.encoding, self.mode.frame_bytes()) {
            (Encoding::Yuyv, Some(whole)) => bytes.len() < whole,
            _ => !bytes.starts_with(&[0xff, 0xd8]) || is_truncated_jpeg(bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use raven::log::FrameLosses;

    use super::*;
    use crate::clock::Arrival;

    const MJPG: Mode = Mode { encoding: Encoding::Mjpg, size_px: [640, 480], interval_s: [1, 30], stride_bytes: 0 };

    fn frame(sequence: u32, at_ms: u64) -> Frame {
        let bytes = [&[0xff, 0xd8][..], &sequence.to_le_bytes(), &[0xff, 0xd9]].concat();
        Frame { bytes, sequence, flags: 0x1_2001, kernel_ns: at_ms * 1_000_000, dequeued: Arrival::default() }
    }

    fn judged(mode: Mode, frames: impl IntoIterator<Item = Frame>) -> FrameLosses {
        let (mut judge, mut losses) = (Judge::new(mode), FrameLosses::default());
        frames.into_iter().for_each(|frame| losses.take(&judge.take(&frame)));
        losses
    }

    #[test]
    fn a_regular_stream_has_nothing_wrong_even_where_its_numbers_wrap() {
        let clean = judged(MJPG, (0..60).map(|i| frame(u32::MAX.wrapping_add(i).wrapping_sub(20), 1000 + 33 * u64::from(i))));
        assert_eq!((clean.frames, clean.total()), (60, 0));
    }

    #[test]
    fn each_cause_is_told_from_the_others() {
        let mut frames: Vec<Frame> = (0..60).map(|i| frame(i, 1000 + 33 * u64::from(i))).collect();
        // Frames 20 and 21 lost on the bus, frame 30 left out by the camera, which then numbers on without it.
        frames.retain(|frame| ![20, 21, 30].contains(&frame.sequence));
        frames.iter_mut().filter(|frame| frame.sequence > 30).for_each(|frame| frame.sequence -= 1);
        frames[40].flags |= 0x40;
        frames[44].bytes.truncate(4);
        frames[48].bytes = frames[47].bytes.clone();
        let losses = judged(MJPG, frames);
        assert_eq!(losses.causes().map(|(count, _)| count), [2, 1, 1, 1, 1]);
    }

    #[test]
    fn a_raw_frame_must_have_all_its_rows() {
        let mode = Mode { encoding: Encoding::Yuyv, size_px: [4, 2], stride_bytes: 8, ..MJPG };
        let raw = |i: u8, bytes: usize| Frame { bytes: vec![i; bytes], ..frame(u32::from(i), u64::from(i) * 33) };
        assert_eq!(judged(mode, (0..20).map(|i| raw(i, 16))).total(), 0);
        assert_eq!(judged(mode, (0..20).map(|i| raw(i, if i == 7 { 15 } else { 16 }))).truncated, 1);
    }
}
