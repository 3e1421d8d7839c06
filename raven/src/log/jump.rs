//! Steps of the clock that stamped messages against the one that saw them arrive.
//!
//! Of each second the quickest message counts, and of five seconds the quickest of these: a step is where the five after differ from the five
//! before by far more than such fives do elsewhere in the recording, which a drift makes differ everywhere.

use serde::Serialize;

use super::Stamp;
use super::lag::{points, quickest};
use crate::stats::median;

/// Seconds before and after a step that are compared.
const SECONDS: usize = 5;
/// Less (s) may be another way of the messages, or a drift.
const SMALLEST_S: f64 = 0.01;
/// A step is larger than the median difference by this factor.
const FAR: f64 = 10.0;

/// A step of the clock of stamps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Jump {
    /// When the first message after it arrived.
    pub at: Stamp,
    /// By how much the clock of the stamps went ahead against the recorder's (s); negative where it went back.
    pub ahead_s: f64,
}

impl Jump {
    /// All steps, of stamps and arrivals in the order of the file.
    #[must_use]
    pub fn all(times: &[(Stamp, Stamp)]) -> Vec<Self> {
        let points = points(times);
        let seconds = quickest(&points);
        let least = |part: &[[f64; 2]]| part.iter().map(|[_, d]| *d).fold(f64::INFINITY, f64::min);
        let changes: Vec<f64> = seconds.windows(2 * SECONDS).map(|both| least(&both[SECONDS..]) - least(&both[..SECONDS])).collect();
        let sizes: Vec<f64> = changes.iter().map(|change| change.abs()).collect();
        let (Some(&(_, origin)), Some(usual)) = (times.first(), median(&sizes)) else { return Vec::new() };
        let is_far = |k: usize| sizes[k] > SMALLEST_S.max(FAR * usual);
        let places: Vec<usize> = (0..changes.len()).filter(|&k| is_far(k)).collect();
        // One step shows in neighbouring places: as it is the quickest that count, a rise first and a fall last where it is.
        let steps = places.chunk_by(|&a, &b| b == a + 1 && (changes[a] > 0.0) == (changes[b] > 0.0));
        let jump = |step: &[usize]| {
            let (first, last) = (*step.first()?, *step.last()?);
            let change = changes[if changes[first] > 0.0 { first } else { last }];
            let k = SECONDS + if change > 0.0 { first } else { last };
            let ([from, _], [to, _]) = (seconds[k - 1], seconds[k]);
            let around = points.windows(2).filter(|pair| pair[0][0] >= from && pair[1][0] <= to);
            let rise = |pair: &[[f64; 2]]| (pair[1][1] - pair[0][1]) * change.signum();
            let after = around.max_by(|a, b| rise(a).total_cmp(&rise(b)))?[1][0];
            Some(Self { at: origin.plus_seconds(after), ahead_s: -change })
        };
        steps.filter_map(jump).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute at 100 Hz from stamp to arrival of 1 ms and up to 3 ms more; the clock of the stamps loses 50 us a second, and `wrong_s` more.
    fn minute(wrong_s: impl Fn(f64) -> f64) -> Vec<(Stamp, Stamp)> {
        let start = Stamp(1_700_000_000_000_000_000);
        let times = (0..6000).map(|k| {
            let sent_s = 0.01 * f64::from(k);
            let late_s = 0.001 + 0.003 * (f64::from(k) * 12.9898).sin().abs();
            (start.plus_seconds(sent_s - 50e-6 * sent_s - wrong_s(sent_s)), start.plus_seconds(sent_s + late_s))
        });
        times.collect()
    }

    #[test]
    fn steps_are_told_with_their_time_and_size() {
        let start = Stamp(1_700_000_000_000_000_000);
        let between = |t: f64, from: f64, to: f64| f64::from(u8::from((from..to).contains(&t)));
        for behind_s in [0.5, -0.5, 0.02] {
            let once = Jump::all(&minute(|t| behind_s * between(t, 20.35, 99.0)));
            assert_eq!(once.len(), 1, "{once:?}");
            approx::assert_abs_diff_eq!(once[0].ahead_s, -behind_s, epsilon = 1e-3);
            approx::assert_abs_diff_eq!(once[0].at.seconds_since(start), 20.35, epsilon = 0.02);
            let there_and_back = Jump::all(&minute(|t| behind_s * between(t, 20.35, 42.7)));
            let told: Vec<f64> = there_and_back.iter().map(|jump| jump.ahead_s * behind_s.signum()).collect();
            assert!(told.len() == 2 && told[0] < -0.01 && told[1] > 0.01, "{there_and_back:?}");
        }
    }

    #[test]
    fn a_drift_and_a_slow_second_are_no_steps() {
        for drift in [0.0, 1e-3, -0.025] {
            assert_eq!(Jump::all(&minute(|t| drift * t)), []);
        }
        assert_eq!(Jump::all(&minute(|t| if (20.0..22.0).contains(&t) { 0.3 } else { 0.0 })), []);
        let without: Vec<_> = minute(|_| 0.0).iter().map(|(stamp, _)| (*stamp, *stamp)).collect();
        assert_eq!((Jump::all(&without), Jump::all(&[])), (vec![], vec![]));
    }
}
