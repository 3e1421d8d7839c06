//! Time of a measurement: nanoseconds since the epoch, as in a ROS header.

const NANOSECONDS_PER_SECOND: u64 = 1_000_000_000;

/// Time of a measurement in nanoseconds since 1970-01-01 UTC on the robot's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, serde::Serialize, serde::Deserialize)]
pub struct Stamp(pub u64);

impl Stamp {
    /// The two numbers of a ROS 1 `time`.
    #[must_use]
    pub fn from_ros(seconds: u32, nanoseconds: u32) -> Self {
        Self(u64::from(seconds) * NANOSECONDS_PER_SECOND + u64::from(nanoseconds))
    }

    /// Seconds and nanoseconds of a ROS 1 `time`, which ends in 2106: later stamps give its last second.
    #[must_use]
    pub fn to_ros(self) -> (u32, u32) {
        let seconds = u32::try_from(self.0 / NANOSECONDS_PER_SECOND).unwrap_or(u32::MAX);
        // A remainder of 10^9 always fits.
        let nanoseconds = u32::try_from(self.0 % NANOSECONDS_PER_SECOND).unwrap_or_default();
        (seconds, nanoseconds)
    }

    /// Time since `origin` in seconds, negative before it. Exact to 0.1 ns within a day of `origin`.
    #[must_use]
    pub fn seconds_since(self, origin: Self) -> f64 {
        let nanoseconds = i128::from(self.0) - i128::from(origin.0);
        nanoseconds as f64 / 1e9
    }

    /// The stamp `seconds` later, rounded to a nanosecond; it stops at the ends of the range, and NaN does not move it.
    #[must_use]
    pub fn plus_seconds(self, seconds: f64) -> Self {
        let nanoseconds = (seconds * 1e9).round() as i128;
        let sum = i128::from(self.0).saturating_add(nanoseconds);
        Self(u64::try_from(sum.max(0)).unwrap_or(u64::MAX))
    }
}

impl std::fmt::Display for Stamp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{:09}", self.0 / NANOSECONDS_PER_SECOND, self.0 % NANOSECONDS_PER_SECOND)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ends_of_the_range_do_not_wrap() {
        assert_eq!(Stamp(5).plus_seconds(-1.0), Stamp(0));
        assert_eq!(Stamp(u64::MAX).plus_seconds(1.0), Stamp(u64::MAX));
        assert_eq!(Stamp(7).plus_seconds(f64::NAN), Stamp(7));
        assert_eq!(Stamp(u64::MAX).to_ros().0, u32::MAX);
        assert_eq!(Stamp::from_ros(1, 5).to_string(), "1.000000005");
    }

    proptest! {
        #[test]
        fn seconds_and_stamps_agree(seconds in 0_u32.., nanoseconds in 0_u32..1_000_000_000, later in -1e5..1e5_f64) {
            let stamp = Stamp::from_ros(seconds, nanoseconds);
            prop_assert_eq!(stamp.to_ros(), (seconds, nanoseconds));
            let moved = stamp.plus_seconds(later);
            if moved.0 > 0 {
                prop_assert!((moved.seconds_since(stamp) - later).abs() <= 1.001e-9);
            }
        }
    }
}
