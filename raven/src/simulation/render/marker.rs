//! The marker, a green ball: its outline is where rays touch it, its shade a diffuse and a glossy part.
//!
//! A ray `d` meets a ball at `c` of radius `r` where `d.c >= |d| sqrt(|c|^2 - r^2)`.

use nalgebra::Vector3;

use super::optics::{Optics, Seen, soft};
use super::{Area, Colour};
use crate::simulation::MARKER_RADIUS_M;

/// Colour in full light.
const GREEN: Colour = [38.0, 188.0, 44.0];
/// Towards the lamp, in the camera's frame, up and to the left behind the camera.
const LAMP: [f64; 3] = [-0.40, -0.72, -0.57];
const AMBIENT: f64 = 0.42;
const GLOSS: f64 = 0.35;

/// The ball in a camera's frame.
pub(crate) struct Marker {
    centre: Vector3<f64>,
    /// Length of a ray from the camera to where it touches the ball [m].
    tangent_m: f64,
}

impl Marker {
    pub(crate) fn new(centre: Vector3<f64>) -> Self {
        let tangent_m = (centre.norm_squared() - MARKER_RADIUS_M * MARKER_RADIUS_M).max(0.0).sqrt();
        Self { centre, tangent_m }
    }

    /// Pixels it may touch; `None` behind the camera.
    pub(crate) fn area(&self, optics: &Optics) -> Option<Area> {
        let pixel = optics.camera().project(&self.centre)?;
        // A ball off the axis looks longer; a tenth and three pixels more cover that.
        let bound = 1.1 * MARKER_RADIUS_M / self.centre.z * optics.focal_px() + 3.0;
        Some(Area::about(optics.camera(), [pixel.x - bound, pixel.y - bound], [pixel.x + bound, pixel.y + bound]))
    }

    pub(crate) fn at(&self, optics: &Optics, index: usize) -> Option<Seen> {
        let ray = optics.ray(index);
        let (length, along) = (ray.norm(), ray.dot(&self.centre));
        // Zero on the outline; over its slope it is the distance from there.
        let inside = along - length * self.tangent_m;
        let slope = (self.centre.xy() - ray.xy() * (self.tangent_m / length)).norm() / optics.focal_px();
        let cover = soft(inside / slope.max(1e-12));
        if cover <= 0.0 {
            return None;
        }
        let squared = length * length;
        let half_chord = (along * along - squared * self.tangent_m * self.tangent_m).max(0.0).sqrt();
        let depth_m = (along - half_chord) / squared;
        let normal = (ray * depth_m - self.centre).normalize();
        Some(Seen { cover, colour: shade(&normal, &ray), depth_m })
    }
}

fn shade(normal: &Vector3<f64>, ray: &Vector3<f64>) -> Colour {
    let lamp = Vector3::from(LAMP).normalize();
    let towards = normal.dot(&lamp);
    let diffuse = AMBIENT + (1.0 - AMBIENT) * towards.max(0.0);
    let mirrored = normal * (2.0 * towards) - lamp;
    let gloss = GLOSS * mirrored.dot(&-ray.normalize()).max(0.0).powi(24);
    GREEN.map(|c| (f64::from(c) * diffuse + 255.0 * gloss).min(255.0) as f32)
}
