//! The tool's shaft, a grey cylinder: its sides are where rays pass its axis at its radius.

use std::ops::Range;

use nalgebra::{Vector2, Vector3};

use super::optics::{Optics, Seen, soft};
use super::{Area, Colour};

const RADIUS_M: f64 = 0.0025;
const LENGTH_M: f64 = 0.16;
const STEEL: Colour = [150.0, 148.0, 144.0];
/// Nearest depth that is drawn [m].
const NEAR_M: f64 = 0.03;
/// How far a lens bends the shaft from a straight line, at most, and the width of an edge [px].
const SLACK_PX: f64 = 4.0;

/// The cylinder in a camera's frame.
pub(crate) struct Shaft {
    start: Vector3<f64>,
    axis: Vector3<f64>,
    length_m: f64,
}

impl Shaft {
    /// From `start` along `axis`, cut off where it would come too near to the camera.
    pub(crate) fn new(start: Vector3<f64>, axis: Vector3<f64>) -> Self {
        let near = if axis.z < 0.0 { ((NEAR_M - start.z) / axis.z).max(0.0) } else { LENGTH_M };
        Self { start, axis, length_m: near.min(LENGTH_M) }
    }

    /// Both ends and the half width in pixels.
    fn outline(&self, optics: &Optics) -> Option<(Vector2<f64>, Vector2<f64>, f64)> {
        let end = self.start + self.axis * self.length_m;
        let (a, b) = (optics.camera().project(&self.start)?, optics.camera().project(&end)?);
        Some((a, b, RADIUS_M / self.start.z.min(end.z) * optics.focal_px() + SLACK_PX))
    }

    /// Pixels it may touch.
    pub(crate) fn area(&self, optics: &Optics) -> Option<Area> {
        let (a, b, width) = self.outline(optics)?;
        let (low, high) = (a.inf(&b).add_scalar(-width), a.sup(&b).add_scalar(width));
        Some(Area::about(optics.camera(), [low.x, low.y], [high.x, high.y]))
    }

    /// Rows it may touch, each with the columns near its axis.
    pub(crate) fn rows(&self, optics: &Optics) -> impl Iterator<Item = (usize, Range<usize>)> {
        let outline = self.outline(optics);
        let rows = self.area(optics).map(|area| area.rows());
        rows.into_iter().flatten().map(move |(v, columns)| {
            let Some((a, b, width)) = outline else { return (v, 0..0) };
            // The part of the axis within `width` of this row, as columns.
            let (rise, row) = (b.y - a.y, v as f64);
            let part = |to: f64| if rise.abs() < 1e-9 { f64::from(u8::from(to > row)) } else { ((to - a.y) / rise).clamp(0.0, 1.0) };
            let at = |part: f64| a.x + part * (b.x - a.x);
            let (first, last) = (at(part(row - width)), at(part(row + width)));
            let low = (first.min(last) - width).max(columns.start as f64) as usize;
            let high = (first.max(last) + width).ceil().clamp(0.0, columns.end as f64) as usize;
            (v, low..high.max(low))
        })
    }

    pub(crate) fn at(&self, optics: &Optics, index: usize) -> Option<Seen> {
        let ray = optics.ray(index);
        // Nearest points of ray and axis: `d ray` and `start + s axis`.
        let across = ray.cross(&self.axis);
        let squared = across.norm_squared();
        if squared < 1e-12 {
            return None;
        }
        let offset = self.start.dot(&across) / squared.sqrt();
        let depth = self.start.cross(&self.axis).dot(&across) / squared;
        if depth <= 0.0 {
            return None;
        }
        let along = (ray * depth - self.start).dot(&self.axis);
        let to_px = optics.focal_px() / depth;
        let sides = soft((RADIUS_M - offset.abs()) * to_px);
        let ends = soft(along * to_px) * soft((self.length_m - along) * to_px);
        let cover = sides * ends;
        if cover <= 0.0 {
            return None;
        }
        let place = (offset / RADIUS_M).clamp(-1.0, 1.0);
        let bulge = (1.0 - place * place).sqrt();
        // Steel: dull at the sides, a bright line off the middle.
        let light = 0.45 + 0.45 * bulge + 0.35 * (-(place - 0.35).powi(2) / 0.03).exp();
        let colour = STEEL.map(|c| (f64::from(c) * light).min(255.0) as f32);
        Some(Seen { cover, colour, depth_m: depth - RADIUS_M * bulge })
    }
}
