//! The marker's candidates in one frame: blobs of the right colour, size and shape around where the marker is expected.

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};
use raven::Result;
use raven::camera::Pinhole;
use raven::log::{CameraFrame, Part};

use crate::colour::MarkerColour;
use crate::lock::Size;
use crate::marker::{Blob, Blobs, Centre, Region};
use crate::perspective::ball_centre;
use crate::predict::View;
use crate::response::Response;
use crate::shaft::Shaft;

/// Side of the region of interest of Haghighipanah et al. 2017 while the marker is seen [px].
const REGION_PX: f64 = 100.0;
/// Side of the region of interest while the marker is seen and balls are fitted [px]: less of a frame is decoded, and motors and the last sight
/// tell the place to a few pixels. A blob that reaches over the edge is looked for in a wider one.
pub const BALL_REGION_PX: f64 = 48.0;
/// Side of the region of interest at the start [px].
const FIRST_REGION_PX: f64 = 300.0;
/// The region is at least so many radii of the marker wide.
const REGION_RADII: f64 = 6.0;

/// What the marker looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marker {
    /// Its colour.
    pub colour: MarkerColour,
    /// Its radius [m].
    pub radius_m: f64,
    /// Radius of the shaft that it sits on [m]; 0 without.
    pub shaft_radius_m: f64,
    /// Which centre of a blob to take.
    pub centre: Centre,
}

/// A blob that may be the marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Image of the ball's centre [px].
    pub centre: Vector2<f64>,
    /// Covariance of the centre by noise [px^2].
    pub noise_px2: Matrix2<f64>,
    /// What moves the centre alike in both cameras, beside that.
    pub response: Response,
    /// Radius [px].
    pub radius_px: f64,
    /// Area over the area expected at the predicted depth.
    pub share: f64,
}

impl Candidate {
    /// Covariance of the centre by both, as far as this frame alone tells [px^2].
    #[must_use]
    pub fn covariance_px2(&self) -> Matrix2<f64> {
        self.response.beside(self.noise_px2)
    }
}

/// What a search found in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Blobs that may be the marker, the largest first.
    pub candidates: Vec<Candidate>,
    /// Blobs of the marker's colour, whatever their size and shape.
    pub blobs: usize,
    /// Where they were looked for.
    pub region: Region,
}

/// One camera's search from frame to frame.
#[derive(Debug, Clone)]
pub struct Search {
    camera: Pinhole,
    marker: Marker,
    side_px: f64,
    /// How large the marker usually is.
    pub size: Size,
}

impl Search {
    /// A search in the images of a camera.
    #[must_use]
    pub fn new(camera: Pinhole, marker: Marker) -> Self {
        Self { camera, marker, side_px: FIRST_REGION_PX, size: Size::default() }
    }

    /// Looks around the expected place. Where a blob reaches over the edge of the region, a region twice as wide is searched. Only
    /// the region is decoded.
    ///
    /// # Errors
    /// If the frame cannot be decoded.
    pub fn look(&self, frame: &CameraFrame, expected: &View) -> Result<Found> {
        let [radius_px, shaft_px] = [self.marker.radius_m, self.marker.shaft_radius_m].map(|radius_m| radius_m * expected.px_per_m);
        let shaft = expected.shaft.filter(|_| shaft_px > 0.0).map(|direction| Shaft { direction, radius_px: shaft_px });
        let mut side = self.side_px.max(REGION_RADII * radius_px);
        let sampling = frame.sampling();
        loop {
            let region = Region::around(&expected.pixel, side as u32);
            let Part { image, corner } = frame.decode_rgb_part(region.columns(), region.rows())?;
            let blobs = Blobs::find(&image, Some(region.from(corner)), &self.marker.colour).sampled(sampling.as_ref()).on_shaft(shaft);
            let candidates = blobs.found.iter().filter_map(|blob| self.candidate(&blobs, blob, corner, radius_px)).collect::<Vec<_>>();
            if !candidates.is_empty() || side >= self.largest_px() || !blobs.found.iter().any(|blob| blob.cut_off) {
                return Ok(Found { candidates, blobs: blobs.found.len(), region });
            }
            side *= 2.0;
        }
    }

    /// A blob of the part of the frame that begins at `corner`.
    fn candidate(&self, blobs: &Blobs<'_>, blob: &Blob, corner: [u32; 2], radius_px: f64) -> Option<Candidate> {
        let share = blob.area_px / (PI * radius_px * radius_px);
        (blob.is_round() && !blob.cut_off && self.size.fits(share)).then(|| {
            let ball = blobs.centre(blob, self.marker.centre);
            let seen_px = ball.centre_px + Vector2::from(corner.map(f64::from));
            let centre = match self.marker.centre {
                // The paper's centroid as it is.
                Centre::Contour => seen_px,
                Centre::Ball | Centre::Refined => ball_centre(&self.camera, &seen_px, ball.radius_px),
            };
            Candidate { centre, noise_px2: ball.noise_px2, response: ball.response, radius_px: ball.radius_px, share }
        })
    }

    /// The marker was seen: the region shrinks.
    pub fn seen(&mut self, share: f64) {
        self.size.accept(share);
        let least_px = if self.marker.centre == Centre::Contour { REGION_PX } else { BALL_REGION_PX };
        self.side_px = (0.5 * self.side_px).max(least_px);
    }

    /// The marker was not found: the region grows, up to twice the image.
    pub fn lost(&mut self) {
        self.size.lost();
        self.side_px = (1.1 * self.side_px).min(self.largest_px());
    }

    fn largest_px(&self) -> f64 {
        2.0 * f64::from(self.camera.width.max(self.camera.height))
    }
}
