//! Frames that are missing or damaged, counted by cause from what the recorder noted of each.

use serde::Serialize;

use super::FrameMeta;

/// Frames of one camera, and what went wrong with them. A frame can be counted under several causes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct FrameLosses {
    /// Frames that the driver delivered.
    pub frames: u64,
    /// Frames that the driver counted but did not deliver: gaps of its sequence numbers.
    pub missed: u64,
    /// Frames that must be missing by the interval, without a gap of the sequence numbers: the camera left them out.
    pub skipped: u64,
    /// Frames that the driver says are damaged. Their pixels are not recorded.
    pub damaged: u64,
    /// Frames that were cut off: a JPEG without its end marker, or a raw frame with too few bytes.
    pub truncated: u64,
    /// Frames with the contents of the one before: the camera sent a picture twice.
    pub repeated: u64,
}

impl FrameLosses {
    /// Counts a frame.
    pub fn take(&mut self, meta: &FrameMeta) {
        self.frames += 1;
        self.missed += u64::from(meta.gap);
        self.skipped += u64::from(meta.skipped);
        self.damaged += u64::from(meta.is_damaged());
        self.truncated += u64::from(meta.truncated);
        self.repeated += u64::from(meta.repeated);
    }

    /// Everything that is missing or not as it should be.
    #[must_use]
    pub const fn total(&self) -> u64 {
        self.missed + self.skipped + self.damaged + self.truncated + self.repeated
    }

    /// Each cause with its count, in words that follow the number.
    #[must_use]
    pub const fn causes(&self) -> [(u64, &'static str); 5] {
        [
            (self.missed, "frames that the driver counted but did not deliver"),
            (self.skipped, "frames that the camera left out, by the interval between frames"),
            (self.damaged, "frames that the driver says are damaged; their pixels are not recorded"),
            (self.truncated, "frames that are cut off: a JPEG without its end, or a raw frame with too few bytes"),
            (self.repeated, "frames with the contents of the frame before"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cause_has_its_own_count() {
        let mut losses = FrameLosses::default();
        losses.take(&FrameMeta::default());
        assert_eq!((losses.frames, losses.total()), (1, 0));
        losses.take(&FrameMeta { gap: 2, skipped: 3, flags: 0x1_2041, truncated: true, repeated: true, ..FrameMeta::default() });
        assert_eq!(losses.causes().map(|(count, _)| count), [2, 3, 1, 1, 1]);
        assert_eq!((losses.frames, losses.total()), (2, 8));
    }
}
