//! A board that moves before one camera: its corners between the frames.
//!
//! Cameras that run freely never look at one instant. Where the board is followed from frame to frame, the corners that one camera would
//! have seen when the other looked lie on the cubic through its own ([`raven_track::interpolate`]).

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Vector2};
use raven::camera::Cameras;
use raven::log::Stamp;
use raven::stats::{median, median_step};
use raven_track::interpolate::{Interpolated, Sample, Track};
use raven_track::pace::pace;

use crate::corners::Sighting;
use crate::desync::{Desync, Seen, desync};
use crate::grid::{Grid, Label, Relabel};

/// A corner between the pictures.
pub type Followed = (Label, Interpolated);

/// One camera's pictures of the board in the order of time, with the corners followed from each to the next.
#[derive(Debug, Clone)]
pub struct Film {
    /// Stamps.
    pub stamps: Vec<Stamp>,
    /// When the pictures were taken after the origin [s].
    pub time_s: Vec<f64>,
    /// What they showed.
    pub sightings: Vec<Option<Sighting>>,
    /// What makes labels of the run's first picture of a picture's own, and the run's number; `None` without board.
    runs: Vec<Option<(Relabel, usize)>>,
    interval_s: f64,
}

/// Pictures farther apart are stills, each for itself [s].
const FILM_S: f64 = 0.2;
/// A corner is followed if it moves by less than this part of the distance to its neighbour.
const FOLLOWED: f64 = 0.4;
/// Noise of a corner, one sigma [px]; what a detector does on webcam pictures.
const CORNER_PX: f64 = 0.05;

/// Of so many corners one is compared: their errors are alike.
const EVERY: usize = 7;
/// An offset that is not known better than this is none [s].
const KNOWN_S: f64 = 0.01;

impl Film {
    /// From pictures in the order of time.
    #[must_use]
    pub fn new(origin: Stamp, seen: Vec<(Stamp, Option<Sighting>)>) -> Self {
        let (stamps, sightings): (Vec<Stamp>, Vec<Option<Sighting>>) = seen.into_iter().unzip();
        let stamps_s: Vec<f64> = stamps.iter().map(|stamp| stamp.seconds_since(origin)).collect();
        let interval_s = median_step(&stamps_s).unwrap_or(f64::INFINITY);
        let time_s = if interval_s < FILM_S { pace(&stamps_s).time_s } else { stamps_s };
        let mut runs: Vec<Option<(Relabel, usize)>> = Vec::with_capacity(sightings.len());
        for k in 0..sightings.len() {
            let followed = |before: usize| {
                let (relabel, run) = runs[before]?;
                let moved = follow(sightings[before].as_ref()?, sightings[k].as_ref()?)?;
                (interval_s < FILM_S).then(|| (relabel.after(&moved), run))
            };
            let fresh = || sightings[k].as_ref().map(|_| (Relabel { turns: 0, shift: (0, 0) }, k));
            let run = k.checked_sub(1).and_then(followed).or_else(fresh);
            runs.push(run);
        }
        Self { stamps, time_s, sightings, runs, interval_s }
    }

    /// Interval between pictures [s].
    #[must_use]
    pub fn interval_s(&self) -> f64 {
        self.interval_s
    }

    /// The picture nearest to a time [s].
    #[must_use]
    pub fn nearest(&self, time_s: f64) -> Option<usize> {
        let after = self.time_s.partition_point(|&t| t < time_s);
        let candidates = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|&i| i < self.time_s.len());
        candidates.min_by(|&a, &b| (self.time_s[a] - time_s).abs().total_cmp(&(self.time_s[b] - time_s).abs()))
    }

    /// Corners at a time [s], with their velocities, by the labels of the nearest picture, and where these can be on the board. `None` where the
    /// board was not followed.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<(Vec<Followed>, &[Relabel])> {
        let near = self.nearest(time_s)?;
        let (to_run, run) = self.runs[near]?;
        let around = near.saturating_sub(2)..(near + 3).min(self.time_s.len());
        let corner = |label: Label| {
            let in_run = to_run.apply(label);
            let sample = |k: usize| {
                let pixel = self.runs[k].filter(|(_, other)| *other == run).and_then(|(relabel, _)| {
                    let own = relabel.inverse().apply(in_run);
                    self.sightings[k].as_ref()?.grid.corners.get(&own).copied()
                });
                Sample {
                    time_s: self.time_s[k],
                    centre: pixel.map(|pixel| (pixel, Matrix2::identity() * CORNER_PX.powi(2))),
                    alike_px: 0.0,
                }
            };
            Some((label, Track::new(around.clone().map(sample).collect(), 0.0).at(time_s)?))
        };
        let sighting = self.sightings[near].as_ref()?;
        let corners: Vec<Followed> = sighting.grid.corners.keys().filter_map(|&label| corner(label)).collect();
        (!corners.is_empty()).then_some((corners, sighting.placements.as_slice()))
    }

    /// What the camera would have seen at a time [s], if all corners of the nearest picture were followed.
    #[must_use]
    pub fn sighting_at(&self, time_s: f64) -> Option<Sighting> {
        let (corners, placements) = self.at(time_s)?;
        let whole = corners.len() == self.sightings[self.nearest(time_s)?].as_ref()?.grid.corners.len();
        let grid = Grid { corners: corners.into_iter().map(|(label, corner)| (label, corner.pixel)).collect() };
        whole.then(|| Sighting { grid, placements: placements.to_vec() })
    }

    /// How fast the board moves in a picture: median over its corners of the speed towards its neighbours [px/s]. Stills count as at rest;
    /// `None` where the board was not followed.
    #[must_use]
    pub fn speed_px_s(&self, picture: usize) -> Option<f64> {
        if self.interval_s >= FILM_S {
            return Some(0.0);
        }
        let joined = |k: usize| self.runs[k].zip(self.runs.get(k + 1).copied().flatten()).is_some_and(|((_, a), (_, b))| a == b);
        if !joined(picture) && !picture.checked_sub(1).is_some_and(joined) {
            return None;
        }
        let (corners, _) = self.at(self.time_s[picture])?;
        median(&corners.iter().map(|(_, corner)| corner.velocity.norm()).collect::<Vec<f64>>())
    }
}

/// By how much more right pictures show the past than left ones of the same stamp, by corners that move and the epipolar lines of cameras that
/// are calibrated already; `None` where nothing moved enough.
#[must_use]
pub fn offset(films: &[Film; 2], cameras: &Cameras) -> Option<Desync> {
    let [left, right] = films;
    let mut all = Vec::new();
    for &time_s in &left.time_s {
        let (Some((ours, [placed])), Some((theirs, [their_place]))) = (left.at(time_s), right.at(time_s)) else { continue };
        let theirs: BTreeMap<Label, Interpolated> = theirs.into_iter().map(|(label, corner)| (their_place.apply(label), corner)).collect();
        let both = ours.iter().filter_map(|(label, corner)| Some([*corner, *theirs.get(&placed.apply(*label))?]));
        all.extend(both.step_by(EVERY).map(|both| Seen { time_s, both }));
    }
    desync(cameras, &all).filter(|found| found.std_s < KNOWN_S)
}

/// What makes labels of `before` of those of `now`, if every corner was followed to the one nearest to it.
fn follow(before: &Sighting, now: &Sighting) -> Option<Relabel> {
    let spacing = spacing_px(&before.grid)?;
    // A board that is seen as a whole both times may move by more than a square.
    let middle = |grid: &Grid| grid.corners.values().sum::<Vector2<f64>>() / grid.corners.len() as f64;
    let whole = before.grid.corners.len() == now.grid.corners.len();
    let moved = if whole { middle(&before.grid) - middle(&now.grid) } else { Vector2::zeros() };
    let nearest = |pixel: &Vector2<f64>| {
        let by = |(&label, p): (&Label, &Vector2<f64>)| ((p - pixel - moved).norm(), label);
        before.grid.corners.iter().map(by).min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(d, _)| *d < FOLLOWED * spacing)
    };
    let pairs: Vec<(Label, Label)> = now.grid.corners.iter().filter_map(|(&label, pixel)| Some((label, nearest(pixel)?.1))).collect();
    let &(own, target) = pairs.first()?;
    let relabel = (0..4_u8).find_map(|turns| {
        let turn = Relabel { turns, shift: (0, 0) };
        let (column, row) = turn.apply(own);
        let relabel = Relabel { turns, shift: (target.0 - column, target.1 - row) };
        let agreeing = pairs.iter().filter(|(own, target)| relabel.apply(*own) == *target).count();
        (agreeing == pairs.len()).then_some(relabel)
    })?;
    (4 * pairs.len() >= 3 * now.grid.corners.len()).then_some(relabel)
}

/// Median distance from a corner to the next in its row [px].
fn spacing_px(grid: &Grid) -> Option<f64> {
    let next = |(&(column, row), pixel): (&Label, &Vector2<f64>)| Some((grid.corners.get(&(column + 1, row))? - pixel).norm());
    median(&grid.corners.iter().filter_map(next).collect::<Vec<f64>>())
}
