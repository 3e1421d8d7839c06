//! The clock that stamped messages against the one that saw them arrive.
//!
//! A message is under way for a time, never a negative one, and of the many of a second one is quick. So the straight line that stays below
//! all times from stamp to arrival and comes closest to them is how the clocks lie and drift apart, up to the quickest delivery:
//!
//! ```text
//! a + b t <= d_i,   sum_i (d_i - a - b t_i) -> min
//! ```
//!
//! It is the edge of the lower convex hull below the mean of the times (Moon, Skelly and Towsley 1999).

use serde::Serialize;

use super::Stamp;

/// Fewest seconds with messages from which a drift is told.
const SECONDS_MIN: usize = 10;
/// Arrivals that are nowhere farther from the stamps (s) were made from them.
const RECORDED_S: f64 = 1e-6;
/// Parts of the time by which it is judged how well the line holds.
const PARTS: usize = 10;

/// Times from stamp to arrival, as a straight line below them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lag {
    /// Where the line begins (s); negative where stamps are ahead of the recorder's clock.
    pub first_s: f64,
    /// Its slope (s/s): by how much the recorder's clock is faster than that of the stamps.
    pub drift: f64,
    /// How far the quickest message of a tenth of the time lies above it at most (s).
    pub slack_s: f64,
    /// The shortest time from stamp to arrival (s).
    pub least_s: f64,
}

impl Lag {
    /// Of stamps and arrivals in the order of the file. `None` without messages for ten seconds, or where arrivals were not recorded and are
    /// the stamps.
    #[must_use]
    pub fn of(times: &[(Stamp, Stamp)]) -> Option<Self> {
        let quickest = quickest(&points(times));
        if quickest.len() < SECONDS_MIN {
            return None;
        }
        let mean_s = quickest.iter().map(|[t, _]| t).sum::<f64>() / quickest.len() as f64;
        let hull = lower_hull(&quickest);
        let [[t0, d0], [t1, d1]] = hull.windows(2).find_map(|edge| match edge {
            &[a, b] if b[0] >= mean_s => Some([a, b]),
            _ => None,
        })?;
        let drift = (d1 - d0) / (t1 - t0);
        let line = |t: f64| d0 + drift * (t - t0);
        let above = |part: &[[f64; 2]]| part.iter().map(|[t, d]| d - line(*t)).fold(f64::INFINITY, f64::min);
        let slack_s = quickest.chunks(quickest.len().div_ceil(PARTS)).map(above).fold(0.0, f64::max);
        let least_s = quickest.iter().map(|[_, d]| *d).fold(f64::INFINITY, f64::min);
        Some(Self { first_s: line(0.0), drift, slack_s, least_s })
    }
}

/// Arrivals since the first in the file and times from stamp to arrival (s), in the order of arrival; none where arrivals were not recorded.
pub(super) fn points(times: &[(Stamp, Stamp)]) -> Vec<[f64; 2]> {
    let Some(&(_, origin)) = times.first() else { return Vec::new() };
    if times.iter().all(|(stamp, arrival)| arrival.seconds_since(*stamp).abs() < RECORDED_S) {
        return Vec::new();
    }
    let mut points: Vec<[f64; 2]> =
        times.iter().map(|(stamp, arrival)| [arrival.seconds_since(origin), arrival.seconds_since(*stamp)]).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    points
}

/// Of each second that with the shortest time.
pub(super) fn quickest(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points.chunk_by(|a, b| a[0].floor() == b[0].floor()).filter_map(lowest).collect()
}

fn lowest(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    points.iter().copied().min_by(|a, b| a[1].total_cmp(&b[1]))
}

/// Lower convex hull of points in rising order (Andrew 1979).
fn lower_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut hull: Vec<[f64; 2]> = Vec::new();
    for &point in points {
        while let &[.., a, b] = hull.as_slice()
            && (b[0] - a[0]) * (point[1] - a[1]) <= (b[1] - a[1]) * (point[0] - a[0])
        {
            hull.pop();
        }
        hull.push(point);
    }
    hull
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Exp};

    /// A minute at 1 kHz, each message 80 us under way and 0.5 ms more in the mean; the clock of the stamps is `behind_s` and gains or loses.
    fn minute(behind_s: f64, drift: f64) -> Vec<(Stamp, Stamp)> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let waits = Exp::new(2000.0).unwrap();
        let start = Stamp(1_700_000_000_000_000_000);
        let times = (0..60_000).map(|k| {
            let sent_s = 1e-3 * f64::from(k);
            let arrival_s = sent_s + 8e-5 + waits.sample(&mut rng);
            (start.plus_seconds(sent_s - behind_s - drift * sent_s), start.plus_seconds(arrival_s))
        });
        times.collect()
    }

    #[test]
    fn offset_and_drift_are_found_below_the_jitter() {
        for (behind_s, drift) in [(0.0, 0.0), (0.25, 40e-6), (-0.003, -15e-6)] {
            let lag = Lag::of(&minute(behind_s, drift)).unwrap();
            approx::assert_abs_diff_eq!(lag.first_s, behind_s + 8e-5, epsilon = 5e-6);
            approx::assert_abs_diff_eq!(lag.drift, drift, epsilon = 2e-7);
            assert!(lag.slack_s < 5e-6, "{lag:?}");
        }
    }

    #[test]
    fn a_step_of_the_clock_is_no_drift_without_slack() {
        let mut times = minute(0.0, 0.0);
        times[20_000..40_000].iter_mut().for_each(|(stamp, _)| *stamp = stamp.plus_seconds(-0.02));
        let lag = Lag::of(&times).unwrap();
        assert!(lag.slack_s > 0.015, "{lag:?}");
    }

    #[test]
    fn too_short_or_without_arrivals_there_is_none() {
        let times = minute(0.0, 0.0);
        assert_eq!(Lag::of(&[]), None);
        assert_eq!(Lag::of(&times[..8000]), None);
        let without: Vec<_> = times.iter().map(|(stamp, _)| (*stamp, *stamp)).collect();
        assert_eq!(Lag::of(&without), None);
    }
}
