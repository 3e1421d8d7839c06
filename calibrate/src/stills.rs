//! Which frames of a recording belong together, and which of them are worth using.
//!
//! Free-running cameras are up to half a period apart, and a board in the hand moves meanwhile. So the right corners are taken where they
//! were when the left camera looked ([`crate::film`]), unless the board stands still anyway. Frames in quick succession also repeat one
//! another's errors. So of each half second one pair is taken: that in which the board moved least from frame to frame.

use nalgebra::Vector2;
use raven::log::Stamp;

use crate::calibration::Shot;
use crate::corners::Sighting;
use crate::film::Film;

/// Two frames taken together, either of which may be missing or show no board.
pub struct TimedShot {
    /// Time of the left frame, or of the right one where there is no left one.
    pub stamp: Stamp,
    /// Left and right.
    pub sightings: [Option<Sighting>; 2],
}

/// Of so many seconds one pair is used.
const WINDOW_S: f64 = 0.5;

/// Two pictures are of one instant if the board moves by less than this between them [px]: twice what a corner is uncertain by.
const TOGETHER_PX: f64 = 0.1;

/// The shots of two cameras' pictures that are worth using; right images show `offset_s` more of the past than left ones [s].
#[must_use]
pub fn shots(films: &[Film; 2], offset_s: f64) -> Vec<Shot> {
    choose(pair(films, offset_s))
}

/// Puts pictures together that are each other's nearest and within half a period; the others stay alone. Where the board moves between the
/// two, the right corners are taken where they were at the left picture's time; where it was not followed, both pictures stay alone.
#[must_use]
pub fn pair(films: &[Film; 2], offset_s: f64) -> Vec<TimedShot> {
    let [left, right] = films;
    let half_period_s = 0.5 * left.interval_s().min(right.interval_s());
    let mut shots = Vec::new();
    let mut taken = vec![false; right.stamps.len()];
    for (i, (&stamp, sighting)) in left.stamps.iter().zip(&left.sightings).enumerate() {
        let then_s = left.time_s[i] + offset_s;
        let partner = right
            .nearest(then_s)
            .filter(|&j| left.nearest(right.time_s[j] - offset_s) == Some(i) && (right.time_s[j] - then_s).abs() <= half_period_s);
        let seen = partner.and_then(|j| {
            let apart_s = (right.time_s[j] - then_s).abs();
            let speeds_px_s = left.speed_px_s(i).zip(right.speed_px_s(j));
            let together = apart_s == 0.0 || speeds_px_s.is_some_and(|(a, b)| a.max(b) * apart_s <= TOGETHER_PX);
            let seen = if together { right.sightings[j].clone() } else { right.sighting_at(then_s) };
            taken[j] = together || seen.is_some();
            seen
        });
        shots.push(TimedShot { stamp, sightings: [sighting.clone(), seen] });
    }
    let alone = right.sightings.iter().zip(&right.stamps).zip(&taken).filter(|(_, taken)| !**taken);
    shots.extend(alone.map(|((sighting, &stamp), _)| TimedShot { stamp, sightings: [None, sighting.clone()] }));
    shots.sort_by_key(|shot| shot.stamp);
    shots
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

    fn films(left: Vec<(Stamp, Option<Sighting>)>, right: Vec<(Stamp, Option<Sighting>)>) -> [Film; 2] {
        [left, right].map(|seen| Film::new(at(0), seen))
    }

    #[test]
    fn nearest_frames_are_paired_and_the_others_stay_alone() {
        let left = [0, 66, 133, 200].map(|t| (at(t), board(0.0)));
        // The second frame was dropped; the last is nearer to none than half a period.
        let right = [20, 140, 240].map(|t| (at(t), board(0.0)));
        let shots = pair(&films(left.into(), right.into()), 0.0);
        let kinds: Vec<[bool; 2]> = shots.iter().map(|s| [0, 1].map(|c| s.sightings[c].is_some())).collect();
        assert_eq!(kinds, [[true, true], [true, false], [true, true], [true, false], [false, true]]);
    }

    #[test]
    fn the_stillest_frame_of_each_half_second_is_kept() {
        let moving = [0.0, 5.0, 9.0, 9.2, 9.3, 14.0, 20.0, 26.0];
        let frames: Vec<_> = moving.iter().enumerate().map(|(i, &x)| (at(66 * i as u64), board(x))).collect();
        let chosen = shots(&films(frames.clone(), frames), 0.0);
        assert_eq!(chosen.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["0.198 s"]);
        let stills: Vec<_> = (0..5).map(|i| (at(1000 * i), board(50.0 * i as f64))).collect();
        assert_eq!(shots(&films(stills.clone(), stills), 0.0).len(), 5);
    }

    #[test]
    fn a_moving_board_is_seen_by_both_at_one_instant() {
        // 150 px/s, and the right camera 20 ms later, 5 ms more than its stamps say.
        let place = |ms: f64| 0.15 * ms + 2.0 * (0.004 * ms).sin();
        let left: Vec<_> = (0..40).map(|k| (at(66 * k), board(place(66.0 * k as f64)))).collect();
        let right: Vec<_> = (0..40).map(|k| (at(66 * k + 15), board(place((66 * k + 20) as f64)))).collect();
        let films = films(left, right);
        let shots = pair(&films, -0.005);
        let corner = |shot: &TimedShot, c: usize| shot.sightings[c].as_ref().map(|s| s.grid.corners[&(4, 3)].x);
        let both: Vec<(f64, f64)> = shots.iter().filter_map(|s| Some((corner(s, 0)?, corner(s, 1)?))).collect();
        assert!(both.len() >= 36);
        for (l, r) in both {
            assert!((l - r).abs() < 0.05, "{l} {r}");
        }
    }
}
