//! The motors' motion between samples: angles by linear interpolation, speeds over a short window, gaps known.

use nalgebra::Vector3;
use raven::robot::{HALF_WINDOW_S, MotorTrack};
use raven::stats::median_step;

/// Motor angles of one recording.
#[derive(Debug, Clone)]
pub struct Motion {
    track: MotorTrack,
    half_window_s: f64,
    /// Start and end of each gap.
    gaps_s: Vec<[f64; 2]>,
}

impl Motion {
    /// From the samples, of which those further apart than `longest_joined_s` have a gap between them; `None` of fewer than two.
    #[must_use]
    pub fn new(track: MotorTrack, longest_joined_s: f64) -> Option<Self> {
        if track.time_s.len() < 2 || track.time_s.len() != track.angle.len() {
            return None;
        }
        let period_s = median_step(&track.time_s)?;
        let gaps_s = track.time_s.windows(2).filter(|w| w[1] - w[0] > longest_joined_s).map(|w| [w[0], w[1]]).collect();
        Some(Self { track, half_window_s: HALF_WINDOW_S.max(period_s), gaps_s })
    }

    /// First and last time [s].
    #[must_use]
    pub fn span_s(&self) -> [f64; 2] {
        let time_s = &self.track.time_s;
        [time_s[0], time_s[time_s.len() - 1]]
    }

    /// The samples.
    #[must_use]
    pub fn track(&self) -> &MotorTrack {
        &self.track
    }

    /// The samples from the last one before `from_s` to the first one after `to_s`.
    #[must_use]
    pub fn part(&self, from_s: f64, to_s: f64) -> MotorTrack {
        let MotorTrack { time_s, angle } = &self.track;
        let first = self.track.samples_until(from_s).saturating_sub(1);
        let end = (self.track.samples_until(to_s) + 1).clamp(first, time_s.len());
        MotorTrack { time_s: time_s[first..end].to_vec(), angle: angle[first..end].to_vec() }
    }

    /// The same times and gaps with other angles.
    #[must_use]
    pub fn with_track(&self, track: MotorTrack) -> Self {
        Self { track, ..self.clone() }
    }

    /// How many gaps there are.
    #[must_use]
    pub fn gaps(&self) -> usize {
        self.gaps_s.len()
    }

    /// Times of [`MotorTrack::times_every`].
    pub fn times_every(&self, stride_s: f64) -> impl Iterator<Item = f64> + '_ {
        self.track.times_every(stride_s)
    }

    /// Whether the motion is known all through `[from_s, to_s]`.
    #[must_use]
    pub fn covers(&self, from_s: f64, to_s: f64) -> bool {
        let [start, end] = self.span_s();
        from_s >= start && to_s <= end && !self.gaps_s.iter().any(|&[opens, closes]| from_s < closes && to_s > opens)
    }

    /// Angles [rad] at a time, those of the nearer end outside the recording.
    #[must_use]
    pub fn angle_rad(&self, time_s: f64) -> Vector3<f64> {
        let MotorTrack { time_s: times, angle } = &self.track;
        let after = self.track.samples_until(time_s).clamp(1, times.len() - 1);
        let (start, end) = (times[after - 1], times[after]);
        let share = if end > start { ((time_s - start) / (end - start)).clamp(0.0, 1.0) } else { 0.0 };
        angle[after - 1].lerp(&angle[after], share)
    }

    /// Speeds [rad/s] at a time, over a window of 40 ms or two samples.
    #[must_use]
    pub fn rate_rad_s(&self, time_s: f64) -> Vector3<f64> {
        let [start, end] = self.span_s();
        let (from, to) = ((time_s - self.half_window_s).max(start), (time_s + self.half_window_s).min(end));
        if to > from { (self.angle_rad(to) - self.angle_rad(from)) / (to - from) } else { Vector3::zeros() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn sine(times: impl Iterator<Item = f64>) -> Motion {
        let time_s: Vec<f64> = times.collect();
        let angle = time_s.iter().map(|t| Vector3::new(t.sin(), 2.0 * t.sin(), 0.0)).collect();
        Motion::new(MotorTrack { time_s, angle }, 0.02).unwrap()
    }

    #[test]
    fn angles_and_speeds_between_samples() {
        let motion = sine((0..3000).map(|i| f64::from(i) * 1e-3));
        assert_relative_eq!(motion.angle_rad(1.2345).x, 1.2345_f64.sin(), epsilon = 1e-6);
        assert_relative_eq!(motion.rate_rad_s(1.2345).y, 2.0 * 1.2345_f64.cos(), epsilon = 1e-3);
        assert_eq!(motion.angle_rad(-1.0).x, 0.0);
        assert_eq!(motion.rate_rad_s(-1.0).x, 0.0);
    }

    #[test]
    fn gaps_are_known() {
        let motion = sine((0..3000).filter(|i| !(1000..1200).contains(i)).map(|i| f64::from(i) * 1e-3));
        assert!(motion.covers(0.0, 0.999));
        assert!(!motion.covers(0.9, 1.1));
        assert!(!motion.covers(1.05, 1.1));
        assert!(motion.covers(1.2, 2.0));
        assert!(!motion.covers(-0.1, 0.5));
        assert_eq!(motion.gaps(), 1);
        assert!(Motion::new(MotorTrack { time_s: vec![0.0], angle: vec![Vector3::zeros()] }, 0.02).is_none());
    }
}
