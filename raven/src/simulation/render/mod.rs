//! Images of the virtual lab: a still background, and before it the tool with its marker, or a checkerboard.
//!
//! Geometry is exact: every edge is placed by the ray through a pixel's centre, lens included, and softened over three pixels, as a
//! webcam's lens does. Only what moves is drawn anew for a frame.

mod background;
mod board;
mod marker;
mod optics;
mod sensor;
mod shaft;

pub use board::Board;
pub use sensor::Sensor;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::camera::Pinhole;
use background::background;
use marker::Marker;
use optics::{Optics, mix};
use shaft::Shaft;

/// Linear colour, red green blue, 0 to 255.
pub(crate) type Colour = [f32; 3];

/// A camera that sees only the background so far.
#[derive(Debug)]
pub struct Renderer {
    optics: Optics,
    /// Camera's frame from the rig's, the left camera's.
    from_left: Isometry3<f64>,
    background: Vec<Colour>,
}

/// An image in the making: a copy of the background and what was changed in it.
#[derive(Debug, Clone)]
pub struct Canvas {
    pixels: Vec<Colour>,
    changed: Option<Area>,
}

/// The tool at one moment, in the left camera's frame [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tool {
    /// Centre of the marker.
    pub tip: Vector3<f64>,
    /// From the tip along the shaft, unit length.
    pub axis: Vector3<f64>,
}

/// Pixels from `low` up to, not including, `high`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Area {
    low: [usize; 2],
    high: [usize; 2],
}

impl Area {
    /// What of a box about a pixel lies in the image.
    pub(crate) fn about(camera: &Pinhole, low: [f64; 2], high: [f64; 2]) -> Self {
        let clip = |value: f64, size: u32| value.clamp(0.0, f64::from(size)) as usize;
        Self {
            low: [clip(low[0].floor(), camera.width), clip(low[1].floor(), camera.height)],
            high: [clip(high[0].ceil() + 1.0, camera.width), clip(high[1].ceil() + 1.0, camera.height)],
        }
    }

    fn contains(&self, u: usize, v: usize) -> bool {
        (self.low[0]..self.high[0]).contains(&u) && (self.low[1]..self.high[1]).contains(&v)
    }

    fn with(self, other: Self) -> Self {
        Self {
            low: [self.low[0].min(other.low[0]), self.low[1].min(other.low[1])],
            high: [self.high[0].max(other.high[0]), self.high[1].max(other.high[1])],
        }
    }

    /// Rows, each with its columns.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> + use<> {
        let (low, high) = (self.low, self.high);
        (low[1]..high[1]).map(move |v| (v, low[0]..high[0].max(low[0])))
    }
}

/// Moments over which an exposure is averaged, at most.
const MOMENTS_MAX: usize = 9;

impl Renderer {
    /// Draws the background that a camera sees; it follows from `seed`.
    #[must_use]
    pub fn new(camera: &Pinhole, from_left: Isometry3<f64>, seed: u64) -> Self {
        let optics = Optics::new(*camera);
        let background = background(&optics, &from_left, seed);
        Self { optics, from_left, background }
    }

    /// The same camera before a black wall.
    #[must_use]
    pub fn before_black(camera: &Pinhole, from_left: Isometry3<f64>) -> Self {
        let optics = Optics::new(*camera);
        let background = vec![[0.0; 3]; optics.len()];
        Self { optics, from_left, background }
    }

    /// A canvas with the background.
    #[must_use]
    pub fn canvas(&self) -> Canvas {
        Canvas { pixels: self.background.clone(), changed: None }
    }

    /// Wipes the canvas: the background again.
    pub fn wipe(&self, canvas: &mut Canvas) {
        if let Some(area) = canvas.changed.take() {
            for (v, columns) in area.rows() {
                let row = self.optics.index(columns.start, v)..self.optics.index(columns.end, v);
                canvas.pixels[row.clone()].copy_from_slice(&self.background[row]);
            }
        }
    }

    /// Draws the tool as it moves through an exposure: `tool_at` gives it at parts of the exposure from 0 to 1.
    pub fn draw_tool(&self, canvas: &mut Canvas, tool_at: impl Fn(f64) -> Tool) {
        let place = |part| self.place(&tool_at(part));
        let moments = match (self.tip_pixel(&tool_at(0.0)), self.tip_pixel(&tool_at(1.0))) {
            // A moment every two thirds of a pixel: the edges are softer than that.
            (Some(a), Some(b)) => (1.5 * (b - a).norm()).ceil() as usize + 1,
            _ => 1,
        }
        .min(MOMENTS_MAX);
        let share = 1.0 / moments as f32;
        for moment in 0..moments {
            let (marker, shaft) = place((moment as f64 + 0.5) / moments as f64);
            self.draw_moment(canvas, &marker, &shaft, share);
        }
    }

    fn place(&self, tool: &Tool) -> (Marker, Shaft) {
        let tip = self.from_left * Point3::from(tool.tip);
        let axis = self.from_left.rotation * tool.axis;
        (Marker::new(tip.coords), Shaft::new(tip.coords, axis))
    }

    fn tip_pixel(&self, tool: &Tool) -> Option<nalgebra::Vector2<f64>> {
        self.optics.camera().project(&(self.from_left * Point3::from(tool.tip)).coords)
    }

    /// Adds `share` of the image of one moment: what lies over the background, minus the background.
    fn draw_moment(&self, canvas: &mut Canvas, marker: &Marker, shaft: &Shaft, share: f32) {
        let optics = &self.optics;
        let near = marker.area(optics);
        let mut add = |index: usize, colour: Colour| {
            for (pixel, (new, old)) in canvas.pixels[index].iter_mut().zip(colour.iter().zip(&self.background[index])) {
                *pixel += share * (new - old);
            }
        };
        for (v, columns) in shaft.rows(optics) {
            for u in columns {
                if near.is_some_and(|area| area.contains(u, v)) {
                    continue;
                }
                let index = optics.index(u, v);
                if let Some(seen) = shaft.at(optics, index) {
                    add(index, mix(self.background[index], seen.colour, seen.cover));
                }
            }
        }
        if let Some(area) = near {
            for (v, columns) in area.rows() {
                for u in columns {
                    let index = optics.index(u, v);
                    let mut layers = [shaft.at(optics, index), marker.at(optics, index)];
                    // What is farther goes first.
                    if let [Some(a), Some(b)] = &layers
                        && a.depth_m < b.depth_m
                    {
                        layers.swap(0, 1);
                    }
                    let under = self.background[index];
                    add(index, layers.iter().flatten().fold(under, |colour, seen| mix(colour, seen.colour, seen.cover)));
                }
            }
        }
        for area in [near, shaft.area(optics)].into_iter().flatten() {
            canvas.touch(area);
        }
    }

    /// Draws a checkerboard; `left_from_board` has its first inner corner at the origin, x along its rows, z away from the camera.
    pub fn draw_board(&self, canvas: &mut Canvas, board: &Board, left_from_board: &Isometry3<f64>) {
        let Some((plane, area)) = board.place(&self.optics, &(self.from_left * left_from_board)) else { return };
        for (v, columns) in area.rows() {
            for u in columns {
                let index = self.optics.index(u, v);
                if let Some((cover, colour)) = plane.at(&self.optics, index) {
                    canvas.pixels[index] = mix(canvas.pixels[index], colour, cover);
                }
            }
        }
        canvas.touch(area);
    }

    /// Hides what is about a point in the left camera's frame [m] behind a gloved finger.
    pub fn draw_finger(&self, canvas: &mut Canvas, before: &Vector3<f64>) {
        let Some(centre) = self.optics.camera().project(&(self.from_left * Point3::from(*before)).coords) else { return };
        let (radius, glove) = (FINGER_PX, [172.0, 160.0, 150.0]);
        let bound = radius + 2.0;
        let area = Area::about(self.optics.camera(), [centre.x - bound, centre.y - bound], [centre.x + bound, centre.y + bound]);
        for (v, columns) in area.rows() {
            for u in columns {
                let away = (u as f64 - centre.x).hypot(v as f64 - centre.y);
                let cover = optics::soft(radius - away);
                let shade = (1.0 - 0.25 * (away / radius).powi(2)) as f32;
                let index = self.optics.index(u, v);
                canvas.pixels[index] = mix(canvas.pixels[index], glove.map(|c: f32| c * shade), cover);
            }
        }
        canvas.touch(area);
    }
}

/// Radius of what hides the marker [px].
const FINGER_PX: f64 = 24.0;

impl Canvas {
    /// Colours, row by row.
    #[must_use]
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    fn touch(&mut self, area: Area) {
        self.changed = Some(self.changed.map_or(area, |changed| changed.with(area)));
    }
}

#[cfg(test)]
mod tests;
