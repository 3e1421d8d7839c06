//! Rays of a camera: the normalised coordinates of every pixel's centre, so that drawing needs no lens model.

use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;

use super::Colour;
use crate::camera::Pinhole;

/// Width of an edge from nothing to all [px]: the blur of a webcam's lens, standard deviation 0.57 px. Sampling once per pixel then moves
/// no edge by more than 0.001 px.
const EDGE_PX: f64 = 3.0;

/// A camera and its rays.
#[derive(Debug)]
pub(crate) struct Optics {
    camera: Pinhole,
    /// `x / z, y / z` per pixel, row by row.
    rays: Vec<Vector2<f64>>,
}

/// What an object shows at a pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// Part of the pixel that it covers.
    pub cover: f32,
    pub colour: Colour,
    /// Along the view [m].
    pub depth_m: f64,
}

impl Optics {
    pub(crate) fn new(camera: Pinhole) -> Self {
        let pixel = |u: u32, v: u32| Vector2::new(f64::from(u), f64::from(v));
        let ray = |pixel: Vector2<f64>| {
            // The lens of a webcam can be undone anywhere in its image; the pinhole's ray stands in where it cannot.
            let straight = || Vector2::new((pixel.x - camera.cx) / camera.fx, (pixel.y - camera.cy) / camera.fy);
            camera.undistort(&pixel).unwrap_or_else(straight)
        };
        let rays =
            (0..camera.height * camera.width).into_par_iter().map(|index| ray(pixel(index % camera.width, index / camera.width))).collect();
        Self { camera, rays }
    }

    pub(crate) fn camera(&self) -> &Pinhole {
        &self.camera
    }

    pub(crate) fn len(&self) -> usize {
        self.rays.len()
    }

    pub(crate) fn index(&self, u: usize, v: usize) -> usize {
        v * self.camera.width as usize + u
    }

    /// Direction of a pixel's centre, `[x, y, 1]`.
    pub(crate) fn ray(&self, index: usize) -> Vector3<f64> {
        self.rays[index].push(1.0)
    }

    /// Pixels per unit of normalised coordinates, near enough for the width of an edge.
    pub(crate) fn focal_px(&self) -> f64 {
        0.5 * (self.camera.fx + self.camera.fy)
    }
}

/// Cover of a pixel whose centre is `inside_px` inside an edge.
pub(crate) fn soft(inside_px: f64) -> f32 {
    let t = (0.5 + inside_px / EDGE_PX).clamp(0.0, 1.0);
    (t * t * t * (10.0 + t * (6.0 * t - 15.0))) as f32
}

/// One colour over another.
pub(crate) fn mix(under: Colour, over: Colour, cover: f32) -> Colour {
    std::array::from_fn(|c| under[c] + cover * (over[c] - under[c]))
}
