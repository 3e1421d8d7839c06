//! How regular a stream is while it runs: the rule of [`raven::log::StreamQuality`] on a window that moves.

use raven::log::{GAP_FACTOR, Stamp};
use raven::stats::median;

/// Intervals that the median is taken of.
const WINDOW: usize = 127;
/// The median is taken anew after so many intervals.
const RENEW: usize = 32;
/// What is farther behind the latest stamp is no message that came late [s].
const LATE_S: f64 = 1.0;
/// With fewer intervals there is no telling what is usual.
const LEAST: usize = 8;

/// Gaps and the longest interval of a stream so far.
#[derive(Debug, Default)]
pub struct Pace {
    last: Option<Stamp>,
    window: Vec<f64>,
    next: usize,
    median_s: Option<f64>,
    least_s: f64,
    longest_s: Option<f64>,
    gaps: u64,
}

impl Pace {
    /// Of a stream whose messages are at least so far apart (s): intervals that bunch up after a delay are not taken for its pace.
    #[must_use]
    pub fn of_at_least(least_s: f64) -> Self {
        Self { least_s, ..Self::default() }
    }

    /// Takes the stamp of the next message; one that repeats or goes back is no interval. Returns how many messages must be missing before it,
    /// which is 0 up to [`GAP_FACTOR`] medians.
    pub fn take(&mut self, stamp: Stamp) -> u32 {
        let Some(last) = self.last.filter(|last| stamp > *last) else {
            // The clock was set back, or a stamp was far ahead: the next interval counts from here.
            let is_late = |last: &Stamp| last.seconds_since(stamp) < LATE_S;
            self.last = self.last.filter(is_late).or(Some(stamp));
            return 0;
        };
        let interval_s = stamp.seconds_since(last);
        self.last = Some(stamp);
        self.longest_s = Some(self.longest_s.map_or(interval_s, |longest| longest.max(interval_s)));
        // The cast saturates; an interval beyond the factor is at least two medians when rounded.
        let missing =
            self.median_s.filter(|median| interval_s > GAP_FACTOR * median).map_or(0, |median| (interval_s / median).round() as u32 - 1);
        self.gaps += u64::from(missing > 0);
        match self.window.get_mut(self.next % WINDOW) {
            Some(oldest) => *oldest = interval_s,
            None => self.window.push(interval_s),
        }
        self.next += 1;
        if self.next == LEAST || self.next.is_multiple_of(RENEW) {
            self.median_s = median(&self.window).map(|median| median.max(self.least_s));
        }
        missing
    }

    /// The latest stamp.
    #[must_use]
    pub const fn last(&self) -> Option<Stamp> {
        self.last
    }

    /// Intervals longer than [`GAP_FACTOR`] medians.
    #[must_use]
    pub const fn gaps(&self) -> u64 {
        self.gaps
    }

    /// Median of the latest intervals (s), `None` with too few of them.
    #[must_use]
    pub const fn median_s(&self) -> Option<f64> {
        self.median_s
    }

    /// The longest interval (s).
    #[must_use]
    pub const fn longest_s(&self) -> Option<f64> {
        self.longest_s
    }
}

#[cfg(test)]
mod tests {
    use raven::log::StreamQuality;

    use super::*;

    #[test]
    fn a_running_stream_is_judged_as_the_recorded_one() {
        let (mut pace, mut stamps, mut now) = (Pace::default(), Vec::new(), 1_000_000_000_u64);
        for i in 0..2000_u64 {
            // 1 kHz with some jitter; now and then a message is missing, repeated or late by itself.
            now += if i > 20 && i % 97 == 0 { 2_000_000 } else { 1_000_000 + (i * 7919) % 100_000 };
            let stamp = if i % 501 == 500 { Stamp(now - 10_000_000) } else { Stamp(now) };
            pace.take(stamp);
            if i % 501 != 500 {
                stamps.push(stamp);
            }
        }
        let quality = StreamQuality::of(&stamps);
        assert_eq!(pace.gaps(), quality.gaps as u64);
        assert_eq!(pace.longest_s(), quality.longest_interval_s);
        assert_eq!(quality.gaps, 20 + 3, "twenty at every 97th, three where a stamp went back");
    }

    #[test]
    fn a_stamp_far_ahead_does_not_blind_to_gaps() {
        let mut pace = Pace::default();
        let missing: u32 = (0..3000_u64)
            .filter(|i| !(2000..2100).contains(i))
            .map(|i| pace.take(Stamp(1_000_000 * if i == 1000 { 3_600_000 } else { 1 + i })))
            .sum();
        // The stamp itself is a gap of an hour.
        assert_eq!((pace.gaps(), missing), (2, 3_598_999 + 100));
        assert_eq!(pace.last(), Some(Stamp(3_000_000_000)));
    }

    #[test]
    fn frames_that_bunch_up_are_not_the_pace() {
        // Frames of 30 Hz that a busy machine takes three at a time, 1 ms apart every 100 ms.
        let stamps = (0..200).flat_map(|i| [100 * i, 100 * i + 1, 100 * i + 2]);
        let (mut free, mut camera) = (Pace::default(), Pace::of_at_least(1.0 / 30.0));
        let missing = stamps.map(|ms: u64| Stamp(1 + ms * 1_000_000)).map(|stamp| [free.take(stamp), camera.take(stamp)]);
        let [free, camera] = missing.fold([0, 0], |[a, b], [c, d]| [a + c, b + d]);
        assert!(camera <= 400 && free > 10_000, "{camera} {free}");
    }

    #[test]
    fn a_stream_that_changes_its_rate_is_judged_by_the_new_one() {
        let mut pace = Pace::default();
        for i in 0..200_u64 {
            pace.take(Stamp(i * 1_000_000));
        }
        for i in 1..400_u64 {
            pace.take(Stamp(200_000_000 + i * 66_000_000));
        }
        let before = pace.gaps();
        assert!(before < 130, "{before}");
        for i in 400..600_u64 {
            pace.take(Stamp(200_000_000 + i * 66_000_000));
        }
        assert_eq!(pace.gaps(), before);
    }
}
