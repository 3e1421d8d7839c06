//! How far apart the frames of two free-running cameras are.

use serde::Serialize;

use super::Stamp;
use crate::stats::median;

/// Skew of the right camera against the left one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CameraSkew {
    /// Median of the stamp of the nearest right frame minus that of each left frame (s).
    pub right_minus_left_s: f64,
    /// Median of its absolute value (s).
    pub absolute_s: f64,
    /// Median distance from the median (s): how steady it is.
    pub spread_s: f64,
}

impl CameraSkew {
    /// For each left frame the nearest right one; stamps in any order. Free-running cameras keep one skew, so its median tells it apart from
    /// dropped frames. `None` if a camera has no frames.
    #[must_use]
    pub fn of(left: &[Stamp], right: &[Stamp]) -> Option<Self> {
        let mut right = right.to_vec();
        right.sort_unstable();
        let nearest = |&left: &Stamp| {
            let after = right.partition_point(|&right| right < left);
            let candidates = [after.checked_sub(1).and_then(|before| right.get(before)), right.get(after)];
            let skews = candidates.into_iter().flatten().map(|right| right.seconds_since(left));
            skews.min_by(|a, b| a.abs().total_cmp(&b.abs()))
        };
        let signed: Vec<f64> = left.iter().filter_map(nearest).collect();
        let absolute: Vec<f64> = signed.iter().map(|skew| skew.abs()).collect();
        let right_minus_left_s = median(&signed)?;
        let distances: Vec<f64> = signed.iter().map(|skew| (skew - right_minus_left_s).abs()).collect();
        Some(Self { right_minus_left_s, absolute_s: median(&absolute)?, spread_s: median(&distances)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_frame_does_not_move_the_skew() {
        let at = |ms: u64| Stamp(1_000_000_000 + ms * 1_000_000);
        let left: Vec<Stamp> = (0..30).map(|i| at(33 * i)).collect();
        let right: Vec<Stamp> = (0..30).filter(|i| i % 7 != 3).map(|i| at(33 * i + 6)).collect();
        let skew = CameraSkew::of(&left, &right).unwrap();
        approx::assert_relative_eq!(skew.right_minus_left_s, 0.006, epsilon = 1e-12);
        approx::assert_relative_eq!(skew.absolute_s, 0.006, epsilon = 1e-12);
        approx::assert_relative_eq!(skew.spread_s, 0.0, epsilon = 1e-12);
        assert_eq!(CameraSkew::of(&left, &[]), None);
        assert_eq!(CameraSkew::of(&[], &right), None);
    }
}
