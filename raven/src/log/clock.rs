//! How the clocks of the recording machine went: readings of monotonic and real time, once a second.

use serde::Serialize;

use super::ClockSample;

/// What happened to the system clock while the recorder stamped by the monotonic one.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct ClockSurvey {
    /// Readings.
    pub readings: usize,
    /// Real time minus monotonic time, last reading against first (s): what corrections came to.
    pub moved_s: f64,
    /// The largest change from one reading to the next (s).
    pub largest_step_s: f64,
}

impl ClockSurvey {
    /// Surveys readings in the order of the file; `None` with fewer than two.
    #[must_use]
    pub fn of(readings: &[ClockSample]) -> Option<Self> {
        // Nanoseconds as integers: a difference of 1 us is below what a double resolves of the time since 1970.
        let offset = |reading: &ClockSample| i128::from(reading.realtime_ns) - i128::from(reading.monotonic_ns);
        let seconds = |a: &ClockSample, b: &ClockSample| (offset(b) - offset(a)) as f64 * 1e-9;
        let (first, last) = (readings.first()?, readings.get(1..)?.last()?);
        let steps = readings.windows(2).filter_map(|pair| Some(seconds(pair.first()?, pair.get(1)?).abs()));
        Some(Self { readings: readings.len(), moved_s: seconds(first, last), largest_step_s: steps.fold(0.0, f64::max) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_the_system_clock_is_found() {
        let reading = |s: u64, moved_ns: u64| ClockSample {
            timestamp: None,
            monotonic_ns: s * 1_000_000_000,
            realtime_ns: 1_700_000_000_000_000_000 + s * 1_000_000_000 + moved_ns,
        };
        let clock = ClockSurvey::of(&[reading(1, 0), reading(2, 2_000), reading(3, 502_000), reading(4, 500_000)]).unwrap();
        approx::assert_relative_eq!(clock.moved_s, 5.0e-4);
        approx::assert_relative_eq!(clock.largest_step_s, 5.0e-4);
        assert_eq!(ClockSurvey::of(&[reading(1, 0)]), None);
    }
}
