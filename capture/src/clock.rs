//! One clock for a whole session: monotonic time plus an epoch that is taken once.
//!
//! A correction of the system clock during a recording would tear it apart, so stamps of arrival are `monotonic + epoch`; how both clocks went
//! stands in the log once a second on `/clock`, and can be taken out afterwards.

use raven::log::{ClockSample, Stamp};
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Readings of which the quickest is taken: whatever interrupts one of them does not interrupt all.
const READINGS: usize = 10;

/// When something arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Arrival {
    /// Monotonic clock (ns since boot).
    pub monotonic_ns: u64,
    /// System clock (ns since 1970 UTC), with whatever corrections it got.
    pub realtime_ns: u64,
}

impl Arrival {
    /// Both clocks now.
    #[must_use]
    pub fn now() -> Self {
        let monotonic_ns = nanoseconds(clock_gettime(ClockId::Monotonic));
        Self { monotonic_ns, realtime_ns: nanoseconds(clock_gettime(ClockId::Realtime)) }
    }

    /// Both clocks at the same moment: the quickest of several readings, the middle of the monotonic times around it.
    #[must_use]
    pub fn pair() -> Self {
        let reading = || {
            let before = nanoseconds(clock_gettime(ClockId::Monotonic));
            let realtime_ns = nanoseconds(clock_gettime(ClockId::Realtime));
            let took = nanoseconds(clock_gettime(ClockId::Monotonic)).saturating_sub(before);
            (took, Self { monotonic_ns: before + took / 2, realtime_ns })
        };
        let quickest = (0..READINGS).map(|_| reading()).min_by_key(|(took, _)| *took);
        quickest.map_or_else(Self::now, |(_, pair)| pair)
    }
}

/// The clock of a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SessionClock {
    epoch_ns: u64,
}

impl SessionClock {
    /// Takes the epoch.
    #[must_use]
    pub fn start() -> Self {
        let pair = Arrival::pair();
        Self { epoch_ns: pair.realtime_ns.saturating_sub(pair.monotonic_ns) }
    }

    /// System time at which the monotonic clock was zero, as it was found at the start (ns).
    #[must_use]
    pub const fn epoch_ns(&self) -> u64 {
        self.epoch_ns
    }

    /// The stamp of a monotonic time (ns), as in a frame's kernel time.
    #[must_use]
    pub const fn stamp(&self, monotonic_ns: u64) -> Stamp {
        Stamp(self.epoch_ns.saturating_add(monotonic_ns))
    }

    /// Both clocks now, with the stamp that they belong to.
    #[must_use]
    pub fn sample(&self) -> (Stamp, ClockSample) {
        let Arrival { monotonic_ns, realtime_ns } = Arrival::pair();
        (self.stamp(monotonic_ns), ClockSample { timestamp: None, monotonic_ns, realtime_ns })
    }
}

fn nanoseconds(time: Timespec) -> u64 {
    let seconds = u64::try_from(time.tv_sec).unwrap_or_default();
    seconds.saturating_mul(1_000_000_000).saturating_add(u64::try_from(time.tv_nsec).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_system_time_and_never_go_back() {
        let clock = SessionClock::start();
        let mut last = Stamp(0);
        for _ in 0..1000 {
            let now = Arrival::now();
            let stamp = clock.stamp(now.monotonic_ns);
            assert!(stamp >= last);
            // 10 ms cover being interrupted between the two readings; a wrong epoch is off by hours.
            assert!(stamp.seconds_since(Stamp(now.realtime_ns)).abs() < 0.01);
            last = stamp;
        }
    }
}
