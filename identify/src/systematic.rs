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
use crate::session::{Session, Sighting};

/// The flaws of a problem, and what one prior deviation of each is.
#[derive(Debug, Clone)]
pub struct Systematic {
    /// Disparity, scale, and what changes with the place in the images; none where no recording says which cameras placed its tips.
    pub flaws: Vec<Flaw>,
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
    /// Of recordings, each with the cameras that it was tracked with where it says so.
    #[must_use]
    pub fn of(sessions: &[Session], tracked: &[Option<&Cameras>]) -> Self {
        let std = tracked.iter().flatten().next().map(|cameras| cameras.systematic());
        let placed =
            sessions.iter().zip(tracked).flat_map(|(session, &cameras)| session.sightings.iter().map(move |sighting| (sighting, cameras)));
        Self { flaws: std.map_or_else(Vec::new, |_| flaws(placed).to_vec()), std }
    }

    /// What an estimate of `unknowns` numbers of the robot says beside them.
    #[must_use]
    pub fn found(&self, estimate: &Estimate, unknowns: usize) -> Option<Found> {
        let of = |k: usize, std: f64| [estimate.z[k] * std, estimate.std[k] * std, std];
        self.std.map(|std| Found { disparity_px: of(unknowns, std.disparity_px), scale: of(unknowns + 1, std.scale) })
    }
}

/// What cameras have wrong alike, as flaws, for sightings each with the cameras that placed it. Of a sighting without cameras nothing is known to be wrong.
pub fn flaws<'a>(placed: impl IntoIterator<Item = (&'a Sighting, Option<&'a Cameras>)>) -> [Flaw; SYSTEMATIC] {
    let mut flaws = [const { Flaw::new() }; SYSTEMATIC];
    for (sighting, cameras) in placed {
        let moved = cameras.and_then(|cameras| cameras.moved_by(&cameras.systematic(), &sighting.position_m));
        flaws.iter_mut().zip(moved.unwrap_or([Vector3::zeros(); SYSTEMATIC])).for_each(|(flaw, moved)| flaw.push(moved));
    }
    flaws
}
