//! Systematic errors of the sightings: disparity, scale, and what changes with the place in the images, which the cameras that placed them have wrong
//! alike in all images.
//!
//! Depth is known worst, and an error of depth that grows with it, as a disparity makes it, passes for a radius. Such errors do not average out:
//! taken for noise they would let a radius claim several times less than it is off by.

use nalgebra::Vector3;
use raven::camera::{self, Cameras, SYSTEMATIC};
use serde::Serialize;

use crate::batch::Estimate;
use crate::problem::Flaw;

/// The cameras that placed the tips of sessions, and what one prior deviation of each flaw is.
#[derive(Debug, Clone, Default)]
pub struct Systematic {
    /// One per session; none where it does not say.
    placed_by: Vec<Option<Cameras>>,
    std: Option<camera::Systematic>,
}

/// What recordings say of their cameras' systematic errors: value, standard deviation, and that of the calibration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Found {
    /// Of the disparity: by how much the right image lies too far right [px].
    pub disparity_px: [f64; 3],
    /// Of distances from the left camera: by which part they are too long.
    pub scale: [f64; 3],
}

impl Systematic {
    /// Of the cameras with which each session was tracked, where it says so.
    #[must_use]
    pub fn of(placed_by: Vec<Option<Cameras>>) -> Self {
        Self { std: placed_by.iter().flatten().next().map(Cameras::systematic), placed_by }
    }

    /// How many flaws there are: none where no session says which cameras placed its tips.
    pub(crate) fn len(&self) -> usize {
        self.std.map_or(0, |_| SYSTEMATIC)
    }

    /// Disparity, scale, and what changes with the place in the images, for tips of each session at `tips_m` [m, frame 0]. Of a tip that no cameras
    /// placed nothing is known to be wrong.
    #[must_use]
    pub fn flaws(&self, tips_m: &[Vec<Vector3<f64>>]) -> Vec<Flaw> {
        let mut flaws = vec![Flaw::new(); self.len()];
        let placed = tips_m.iter().zip(&self.placed_by).flat_map(|(tips_m, cameras)| tips_m.iter().map(move |tip_m| (tip_m, cameras)));
        for (tip_m, cameras) in placed {
            let moved = cameras.as_ref().and_then(|cameras| cameras.moved_by(&cameras.systematic(), tip_m));
            flaws.iter_mut().zip(moved.unwrap_or([Vector3::zeros(); SYSTEMATIC])).for_each(|(flaw, moved)| flaw.push(moved));
        }
        flaws
    }

    /// What an estimate says of them, of whose unknowns they are those from `first` on.
    #[must_use]
    pub fn found(&self, estimate: &Estimate, first: usize) -> Option<Found> {
        let of = |k: usize, std: f64| [estimate.z[k] * std, estimate.std[k] * std, std];
        self.std.map(|std| Found { disparity_px: of(first, std.disparity_px), scale: of(first + 1, std.scale) })
    }
}
