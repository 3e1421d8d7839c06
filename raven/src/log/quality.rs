//! How regular a stream is: intervals, gaps, repeated and backward stamps.

use serde::Serialize;

use super::Stamp;
use crate::stats::median;

/// An interval counts as a gap beyond this multiple of the median interval: between one frame and two.
pub const GAP_FACTOR: f64 = 1.5;

/// Regularity of one stream, by the stamps of its messages in the order of the file.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct StreamQuality {
    /// Messages in the file.
    pub messages: usize,
    /// First stamp, `None` without messages.
    pub first: Option<Stamp>,
    /// Last stamp.
    pub last: Option<Stamp>,
    /// Median interval between different stamps (s), `None` with fewer than two of them.
    pub median_interval_s: Option<f64>,
    /// Intervals longer than [`GAP_FACTOR`] medians.
    pub gaps: usize,
    /// The longest interval (s).
    pub longest_interval_s: Option<f64>,
    /// Messages whose stamp another one has too.
    pub duplicates: usize,
    /// Messages whose stamp is before that of the message before them.
    pub backward: usize,
    /// Messages without a stamp of their own: the time of publication stands in.
    pub without_stamp: usize,
    /// Messages with a number that is not finite where one is needed.
    pub non_finite: usize,
    /// Messages that do not fit their definition.
    pub undecodable: usize,
}

impl StreamQuality {
    /// Regularity of a stream with these stamps, in the order of the file. The counts about contents stay zero.
    #[must_use]
    pub fn of(stamps: &[Stamp]) -> Self {
        let backward = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
        let mut sorted = stamps.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        let intervals: Vec<f64> = sorted.windows(2).map(|pair| pair[1].seconds_since(pair[0])).collect();
        let median = median(&intervals);
        let gaps = median.map_or(0, |median| intervals.iter().filter(|&&interval| interval > GAP_FACTOR * median).count());
        Self {
            messages: stamps.len(),
            first: sorted.first().copied(),
            last: sorted.last().copied(),
            median_interval_s: median,
            gaps,
            longest_interval_s: intervals.iter().copied().reduce(f64::max),
            duplicates: stamps.len() - sorted.len(),
            backward,
            ..Self::default()
        }
    }

    /// Messages per second over the whole stream, `None` if it has no length.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        let duration = self.last?.seconds_since(self.first?);
        let different = self.messages - self.duplicates;
        (duration > 0.0).then(|| (different.saturating_sub(1)) as f64 / duration)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_duplicates_and_steps_back_are_counted() {
        let stamps: Vec<Stamp> = [0, 10, 20, 20, 60, 50, 70, 80].map(|ms| Stamp(ms * 1_000_000)).to_vec();
        let quality = StreamQuality::of(&stamps);
        assert_eq!((quality.duplicates, quality.backward, quality.gaps), (1, 1, 1));
        assert_eq!(quality.median_interval_s, Some(0.01));
        assert_eq!(quality.longest_interval_s, Some(0.03));
        approx::assert_relative_eq!(quality.rate_hz().unwrap(), 6.0 / 0.08);
        assert_eq!(StreamQuality::of(&[]), StreamQuality::default());
        assert_eq!(StreamQuality::of(&[Stamp(3)]).rate_hz(), None);
    }
}
