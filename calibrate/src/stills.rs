//! Which frames of a recording belong together, and which of them are worth using.
//!
//! Free-running cameras are up to half a period apart, and a board in the hand moves meanwhile. Frames in quick succession also repeat one
//! another's errors. So of each half second one pair is taken: that in which the board moved least from frame to frame.

use nalgebra::Vector2;
use raven::log::Stamp;

use crate::calibration::Shot;
use crate::corners::Sighting;

/// Two frames taken together, either of which may be missing or show no board.
pub struct TimedShot {
    /// Time of the left frame, or of the right one where there is no left one.
    pub stamp: Stamp,
    /// Left and right.
    pub sightings: [Option<Sighting>; 2],
}

/// Of so many seconds one pair is used.
const WINDOW_S: f64 = 0.5;

/// Puts frames together that are each other's nearest and within half a period; the others stay alone. Both lists are in order of time.
#[must_use]
pub fn pair(mut seen: [Vec<(Stamp, Option<Sighting>)>; 2]) -> Vec<TimedShot> {
    let stamps: [Vec<Stamp>; 2] = [0, 1].map(|c| seen[c].iter().map(|(stamp, _)| *stamp).collect());
    let half_period_s = 0.5 * period_s(&stamps[0]).min(period_s(&stamps[1]));
    let mut shots = Vec::new();
    let mut taken = vec![false; stamps[1].len()];
    for (i, &stamp) in stamps[0].iter().enumerate() {
        let partner = nearest(&stamps[1], stamp)
            .filter(|&j| nearest(&stamps[0], stamps[1][j]) == Some(i) && stamps[1][j].seconds_since(stamp).abs() <= half_period_s);
        let right = partner.and_then(|j| {
            taken[j] = true;
            seen[1][j].1.take()
        });
        shots.push(TimedShot { stamp, sightings: [seen[0][i].1.take(), right] });
    }
    let alone = seen[1].iter_mut().zip(&taken).filter(|(_, taken)| !**taken);
    shots.extend(alone.map(|((stamp, sighting), _)| TimedShot { stamp: *stamp, sightings: [None, sighting.take()] }));
    shots.sort_by_key(|shot| shot.stamp);
    shots
}

/// Median interval [s]; infinite for a single frame.
fn period_s(stamps: &[Stamp]) -> f64 {
    let intervals: Vec<f64> = stamps.windows(2).map(|w| w[1].seconds_since(w[0])).collect();
    raven::stats::median(&intervals).unwrap_or(f64::INFINITY)
}

fn nearest(stamps: &[Stamp], to: Stamp) -> Option<usize> {
    let after = stamps.partition_point(|&stamp| stamp < to);
    let candidates = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|&i| i < stamps.len());
    candidates.min_by(|&a, &b| stamps[a].seconds_since(to).abs().total_cmp(&stamps[b].seconds_since(to).abs()))
}

/// Of each half second the shot with the most boards, of these the one in which they moved least.
#[must_use]
pub fn choose(shots: Vec<TimedShot>) -> Vec<Shot> {
    let Some(start) = shots.first().map(|shot| shot.stamp) else { return Vec::new() };
    let window = |shot: &TimedShot| (shot.stamp.seconds_since(start) / WINDOW_S) as u64;
    let rank = |i: usize| {
        let boards = shots[i].sightings.iter().flatten().count();
        (std::cmp::Reverse(boards), motion_px(&shots, i))
    };
    let mut chosen: Vec<usize> = Vec::new();
    for i in (0..shots.len()).filter(|&i| shots[i].sightings.iter().any(Option::is_some)) {
        match chosen.last_mut() {
            Some(last) if window(&shots[*last]) == window(&shots[i]) => {
                let ((more, less), (boards, motion)) = (rank(*last), rank(i));
                if boards.cmp(&more).then(motion.total_cmp(&less)).is_lt() {
                    *last = i;
                }
            }
            _ => chosen.push(i),
        }
    }
    let name = |shot: &TimedShot| format!("{:.3} s", shot.stamp.seconds_since(start));
    chosen.into_iter().map(|i| Shot { name: name(&shots[i]), sightings: shots[i].sightings.clone() }).collect()
}

/// How far the board moves from this shot to its neighbours within half a second [px]; 0 without any.
fn motion_px(shots: &[TimedShot], index: usize) -> f64 {
    let here = &shots[index];
    let neighbours = [index.checked_sub(1), Some(index + 1)].into_iter().flatten().filter_map(|i| shots.get(i));
    let close = neighbours.filter(|n| n.stamp.seconds_since(here.stamp).abs() < WINDOW_S);
    let moved = |n: &TimedShot| {
        let cameras = here.sightings.iter().zip(&n.sightings);
        cameras.filter_map(|(a, b)| Some(distance_px(a.as_ref()?, b.as_ref()?))).fold(0.0, f64::max)
    };
    close.map(moved).fold(0.0, f64::max)
}

/// Median distance from a corner to the nearest one of another sighting [px]. The labels of two sightings need not agree.
fn distance_px(a: &Sighting, b: &Sighting) -> f64 {
    let to_nearest = |p: &Vector2<f64>| b.grid.corners.values().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
    let distances: Vec<f64> = a.grid.corners.values().map(to_nearest).collect();
    raven::stats::median(&distances).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;

    fn board(shift_px: f64) -> Option<Sighting> {
        let labels = (0..9).flat_map(|c| (0..6).map(move |r| (c, r)));
        let at = |(c, r): (i32, i32)| Vector2::new(40.0 * f64::from(c) + shift_px, 40.0 * f64::from(r));
        Some(Sighting { grid: Grid { corners: labels.map(|l| (l, at(l))).collect() }, placements: Vec::new() })
    }

    fn at(ms: u64) -> Stamp {
        Stamp(1_700_000_000_000_000_000 + ms * 1_000_000)
    }

    #[test]
    fn nearest_frames_are_paired_and_the_others_stay_alone() {
        let left = [0, 66, 133, 200].map(|t| (at(t), board(0.0)));
        // The second frame was dropped; the last is nearer to none than half a period.
        let right = [20, 140, 240].map(|t| (at(t), board(0.0)));
        let shots = pair([left.into(), right.into()]);
        let kinds: Vec<[bool; 2]> = shots.iter().map(|s| [0, 1].map(|c| s.sightings[c].is_some())).collect();
        assert_eq!(kinds, [[true, true], [true, false], [true, true], [true, false], [false, true]]);
    }

    #[test]
    fn the_stillest_frame_of_each_half_second_is_kept() {
        let moving = [0.0, 5.0, 9.0, 9.2, 9.3, 14.0, 20.0, 26.0];
        let frames: Vec<_> = moving.iter().enumerate().map(|(i, &x)| (at(66 * i as u64), board(x))).collect();
        let chosen = choose(pair([frames.clone(), frames]));
        assert_eq!(chosen.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["0.198 s"]);
        let stills: Vec<_> = (0..5).map(|i| (at(1000 * i), board(50.0 * i as f64))).collect();
        assert_eq!(choose(pair([stills.clone(), stills])).len(), 5);
    }
}
