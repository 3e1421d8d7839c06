//! Phases of a motion, per joint: around a reversal, at hold, at cruise, changing speed.

use serde::Serialize;

/// What a joint is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// Within [`REVERSAL_S`] of a change of direction.
    Reversal,
    /// Not moving.
    Hold,
    /// Moving at a steady speed, away from reversals.
    Cruise,
    /// Changing speed, away from reversals.
    Acceleration,
}

impl Phase {
    /// All, in the order of the report.
    pub const ALL: [Self; 4] = [Self::Reversal, Self::Hold, Self::Cruise, Self::Acceleration];

    /// Name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reversal => "reversal",
            Self::Hold => "hold",
            Self::Cruise => "cruise",
            Self::Acceleration => "acceleration",
        }
    }
}

/// How long before and after a change of direction belongs to the reversal [s].
pub const REVERSAL_S: f64 = 0.15;

/// A joint moves where it is faster than this share of its 95th-percentile speed; slower is holding.
const MOVING_SHARE: f64 = 0.02;

/// A joint changes speed where its acceleration is above this share of the 95th-percentile acceleration.
const ACCELERATING_SHARE: f64 = 0.5;

/// Half of the window over which the acceleration is taken [s].
const ACCELERATION_S: f64 = 0.1;

/// The phase of each sample from the joint's speed. `time_s` is sorted; both have the same length.
#[must_use]
pub fn phases(time_s: &[f64], rate: &[f64]) -> Vec<Phase> {
    let high = |values: &[f64]| {
        let mut sizes: Vec<f64> = values.iter().map(|r| r.abs()).filter(|r| r.is_finite()).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() * 95 / 100).copied().unwrap_or(0.0)
    };
    let fast = high(rate);
    let acceleration = accelerations(time_s, rate);
    let brisk = high(&acceleration);
    let moving = |r: f64| r.abs() > MOVING_SHARE * fast && fast > 0.0;
    let mut reversals = Vec::new();
    let mut last: Option<(f64, f64)> = None;
    for (&t, &r) in time_s.iter().zip(rate) {
        if moving(r) {
            // The turn is where the motion ends and where it starts again; a hold may lie between.
            if let Some((before, direction)) = last
                && direction * r < 0.0
            {
                reversals.push([before, t]);
            }
            last = Some((t, r));
        }
    }
    let near = |t: f64| {
        let next = reversals.partition_point(|turn| turn[1] + REVERSAL_S < t);
        reversals[next.min(reversals.len())..].iter().take_while(|turn| turn[0] - REVERSAL_S <= t).any(|turn| {
            let [end, start] = *turn;
            (t - end).abs() <= REVERSAL_S || (t - start).abs() <= REVERSAL_S || (t > end && t < start && start - end <= 2.0 * REVERSAL_S)
        })
    };
    time_s
        .iter()
        .zip(rate)
        .zip(&acceleration)
        .map(|((&t, &r), &a)| match (near(t), moving(r)) {
            (true, _) => Phase::Reversal,
            (false, true) if a.abs() > ACCELERATING_SHARE * brisk => Phase::Acceleration,
            (false, true) => Phase::Cruise,
            (false, false) => Phase::Hold,
        })
        .collect()
}

/// Change of speed over the samples within [`ACCELERATION_S`] before and after each, one at least.
fn accelerations(time_s: &[f64], rate: &[f64]) -> Vec<f64> {
    let slope = |k: usize| {
        let from = time_s.partition_point(|&t| t < time_s[k] - ACCELERATION_S).min(k.saturating_sub(1));
        let to = time_s.partition_point(|&t| t <= time_s[k] + ACCELERATION_S).max(k + 2).min(time_s.len()) - 1;
        let span = time_s[to] - time_s[from];
        if span > 0.0 { (rate[to] - rate[from]) / span } else { 0.0 }
    };
    (0..time_s.len().min(rate.len())).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_with_a_pause_has_its_phases() {
        let time_s: Vec<f64> = (0..4000).map(|k| f64::from(k) * 1e-3).collect();
        // Up for 1 s, down for 1 s, hold for 1 s, down again for 1 s.
        let rate: Vec<f64> = time_s
            .iter()
            .map(|&t| {
                if t < 1.0 {
                    1.0
                } else if (2.0..3.0).contains(&t) {
                    0.0
                } else {
                    -1.0
                }
            })
            .collect();
        let phases = phases(&time_s, &rate);
        let at = |t: f64| phases[(t * 1e3) as usize];
        assert_eq!(at(0.5), Phase::Cruise);
        assert_eq!((at(0.86), at(1.0), at(1.14)), (Phase::Reversal, Phase::Reversal, Phase::Reversal));
        assert_eq!((at(1.5), at(2.5), at(3.5)), (Phase::Cruise, Phase::Hold, Phase::Cruise));
    }

    #[test]
    fn a_start_and_a_stop_change_the_speed() {
        let time_s: Vec<f64> = (0..6000).map(|k| f64::from(k) * 1e-3).collect();
        // At rest for 1 s, faster for half a second, steady until 4 s, and back to rest within half a second.
        let rate: Vec<f64> = time_s.iter().map(|&t| (2.0 * (t - 1.0)).min(2.0 * (4.5 - t)).clamp(0.0, 1.0)).collect();
        let phases = phases(&time_s, &rate);
        let at = |t: f64| phases[(t * 1e3) as usize];
        assert_eq!((at(0.5), at(1.25), at(2.5), at(4.25), at(5.5)), {
            use Phase::{Acceleration, Cruise, Hold};
            (Hold, Acceleration, Cruise, Acceleration, Hold)
        });
    }

    #[test]
    fn nothing_moving_is_all_hold() {
        assert!(phases(&[0.0, 1.0], &[0.0, 0.0]).iter().all(|&p| p == Phase::Hold));
        assert!(phases(&[], &[]).is_empty());
    }
}
