//! Which corner of the left image is which of the right one, and the pose between the cameras to start from.
//!
//! A board of odd columns and rows looks the same from both ends, and a board cut off by the image's edge may sit at several places. Every
//! way of matching the two grids of a pair implies a pose between the cameras. There is only one such pose: it is the one that explains
//! most pairs.

use nalgebra::{Isometry3, Point3};
use raven::camera::Pinhole;

use crate::corners::Sighting;
use crate::grid::Relabel;

/// A pair of sightings, with the poses of their label frames in their own camera.
pub struct Pair<'a> {
    /// Seen by the left camera.
    pub left: &'a Sighting,
    /// Seen by the right camera.
    pub right: &'a Sighting,
    /// `x_left = left_from_label x_label`, of the left labels.
    pub left_from_label: Isometry3<f64>,
    /// `x_right = right_from_label x_label`, of the right labels.
    pub right_from_label: Isometry3<f64>,
}

/// Outcome of the matching.
pub struct Matched {
    /// `x_right = right_from_left x_left`, to start from.
    pub right_from_left: Isometry3<f64>,
    /// Per pair, what makes left labels of right ones; `None` where the pair contradicts the others or could be matched in two ways.
    pub relabel: Vec<Option<Relabel>>,
}

/// A pair is taken for matched if its corners are nearer than this to where the others say, in squares.
const NEAR_SQUARES: f64 = 0.4;
/// Most poses tried.
const MOST_TRIALS: usize = 400;

/// Matches all pairs; `None` if there are none.
#[must_use]
pub fn matched(pairs: &[Pair<'_>], right_camera: &Pinhole, square_m: f64) -> Option<Matched> {
    let candidates: Vec<Vec<Relabel>> = pairs.iter().map(|p| relabels(p.left, p.right)).collect();
    let trials: Vec<Isometry3<f64>> = pairs.iter().zip(&candidates).flat_map(|(p, c)| c.iter().map(|r| implied(p, r, square_m))).collect();
    let stride = trials.len().div_ceil(MOST_TRIALS).max(1);
    let misses = |pose: &Isometry3<f64>| -> Vec<f64> {
        let least = |(p, c): (&Pair<'_>, &Vec<Relabel>)| {
            c.iter().map(|r| miss_squares(p, r, pose, right_camera, square_m)).fold(f64::INFINITY, f64::min)
        };
        pairs.iter().zip(&candidates).map(least).collect()
    };
    // The sum of capped misses counts, in effect, the pairs that a pose does not explain.
    let score = |pose: &Isometry3<f64>| misses(pose).iter().map(|m| m.min(1.0)).sum::<f64>();
    let best = trials.iter().step_by(stride).map(|pose| (score(pose), pose)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    let choose = |(p, c): (&Pair<'_>, &Vec<Relabel>)| {
        let mut ranked: Vec<(f64, Relabel)> = c.iter().map(|r| (miss_squares(p, r, best, right_camera, square_m), *r)).collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (first, second) = (ranked.first()?, ranked.get(1).map_or(f64::INFINITY, |r| r.0));
        (first.0 < NEAR_SQUARES && second > 2.0 * first.0).then_some(first.1)
    };
    let relabel = pairs.iter().zip(&candidates).map(choose).collect();
    Some(Matched { right_from_left: *best, relabel })
}

/// All ways to make left labels of right ones.
fn relabels(left: &Sighting, right: &Sighting) -> Vec<Relabel> {
    let mut all: Vec<Relabel> = left.placements.iter().flat_map(|l| right.placements.iter().map(move |r| l.inverse().after(r))).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Pose between the cameras if the labels match in this way.
fn implied(pair: &Pair<'_>, relabel: &Relabel, square_m: f64) -> Isometry3<f64> {
    pair.right_from_label * (pair.left_from_label * relabel.motion(square_m)).inverse()
}

/// Root mean square distance of the right corners from where the left board and a pose say, in squares.
fn miss_squares(pair: &Pair<'_>, relabel: &Relabel, pose: &Isometry3<f64>, right: &Pinhole, square_m: f64) -> f64 {
    let board = pose * pair.left_from_label * relabel.motion(square_m);
    let (mut sum, mut depth) = (0.0, 0.0);
    for (&(column, row), pixel) in &pair.right.grid.corners {
        let point = board * Point3::new(f64::from(column) * square_m, f64::from(row) * square_m, 0.0);
        let Some(expected) = right.project(&point.coords) else { return f64::INFINITY };
        sum += (expected - pixel).norm_squared();
        depth += point.z;
    }
    let count = pair.right.grid.corners.len() as f64;
    let square_px = right.fx * square_m / (depth / count);
    (sum / count).sqrt() / square_px
}
