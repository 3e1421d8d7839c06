//! A frame as the driver hands it over, and what its flags say (V4L2, `videodev2.h`).

use crate::clock::Arrival;

/// Kinds of stamps: the clock in three bits, and what is stamped in three others.
const CLOCK_MASK: u32 = 0xe000;
const CLOCK_MONOTONIC: u32 = 0x2000;
const MOMENT_MASK: u32 = 0x7_0000;
const MOMENT_START: u32 = 0x1_0000;

/// A frame and what the driver says of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// The bytes that are used, no more.
    pub bytes: Vec<u8>,
    /// The driver's count of frames; it starts again with every opening and wraps around.
    pub sequence: u32,
    /// V4L2 buffer flags.
    pub flags: u32,
    /// The driver's stamp, on the clock that the flags say (ns).
    pub kernel_ns: u64,
    /// When the program took the frame from the driver.
    pub dequeued: Arrival,
}

impl Frame {
    /// When the frame was taken, on the monotonic clock (ns): the driver's stamp, which may lie after the moment of dequeueing, or that moment if
    /// the stamp is of another clock.
    #[must_use]
    pub const fn monotonic_ns(&self) -> u64 {
        if self.flags & CLOCK_MASK == CLOCK_MONOTONIC { self.kernel_ns } else { self.dequeued.monotonic_ns }
    }

    /// What the stamp is, in words.
    #[must_use]
    pub const fn stamp_kind(&self) -> &'static str {
        match (self.flags & CLOCK_MASK, self.flags & MOMENT_MASK) {
            (CLOCK_MONOTONIC, MOMENT_START) => "monotonic, start of the frame",
            (CLOCK_MONOTONIC, _) => "monotonic, end of the frame",
            _ => "unknown clock: the time of dequeueing stands in",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_monotonic_stamp_is_taken_and_never_corrected() {
        let dequeued = Arrival { monotonic_ns: 100, realtime_ns: 7 };
        let frame = |flags| Frame { bytes: Vec::new(), sequence: 0, flags, kernel_ns: 150, dequeued };
        // What uvcvideo, vivid and a loopback device were seen to say.
        let kinds = [(0x1_2001, 150, "start"), (0x2001, 150, "end"), (0x1, 100, "unknown"), (0x4001, 100, "unknown")];
        for (flags, expected_ns, word) in kinds {
            assert_eq!(frame(flags).monotonic_ns(), expected_ns, "{flags:x}");
            assert!(frame(flags).stamp_kind().contains(word), "{flags:x}");
        }
    }
}
