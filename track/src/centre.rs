//! Centre of a blob with every pixel at its edge weighted by how much of it is marker.
//!
//! The pixels well inside weigh 1 and those well outside 0, whatever the shading on a sphere does to their brightness. In the band
//! between, a pixel of chroma `c` weighs
//!
//! ```text
//! w = (c - c_bg) / (c_fg - c_bg)
//! ```
//!
//! with `c_fg` and `c_bg` the means of the nearby pixels well inside and well outside. Chroma is the colour along the marker's own
//! direction at right angles to grey, so that a shaft, a shadow or a highlight, which differ in brightness, do not count. The standard
//! deviation follows from the scatter of the chroma outside:
//!
//! ```text
//! var u = sum (u - u_c)^2 var(w) / (sum w)^2
//! ```

use image::{GrayImage, RgbImage};
use imageproc::distance_transform::{Norm, distance_transform};
use nalgebra::{Vector2, Vector3};

use crate::marker::Region;

/// How far beyond the mask the background is looked at [px].
pub const REACH_PX: u32 = 7;
/// Depth from which on a pixel of the mask is all marker [px]: optical blur and chroma subsampling by two smear an edge over 3 px.
const CORE_DEPTH_PX: u8 = 3;
/// Distance from which on a pixel is all background [px].
const OUTSIDE_PX: u8 = 4;
/// Half the window over which a pixel at the edge looks for marker and background [px].
const WINDOW_PX: i32 = 6;
/// Standard deviation per axis of what noise alone does not explain [px]: demosaicing, compression, texture next to the edge.
const FLOOR_STD_PX: f64 = 0.02;

/// Pixels of a mask that an outline spans, ends included.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// First column.
    pub left: i32,
    /// First row.
    pub top: i32,
    /// Last column.
    pub right: i32,
    /// Last row.
    pub bottom: i32,
}

/// A centre with its standard deviation per axis and the area found with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighted {
    /// `(u, v)` in the image [px].
    pub centre_px: Vector2<f64>,
    /// Per axis [px].
    pub std_px: f64,
    /// Sum of the weights [px].
    pub area_px: f64,
}

/// Centre of the blob that spans `bounds` in `mask`, the mask of `region`; `bounds` must be [`REACH_PX`] away from the mask's edge.
///
/// `None` where the blob is too small to have an inside or has no contrast.
#[must_use]
pub fn weighted(image: &RgbImage, region: Region, mask: &GrayImage, bounds: Bounds) -> Option<Weighted> {
    let patch = Patch::cut(image, region, mask, bounds)?;
    let mut weights = Vec::with_capacity(patch.chroma.len());
    let (mut sum, mut first) = (0.0, Vector2::zeros());
    for y in 0..patch.height {
        for x in 0..patch.width {
            let weight = patch.weight(x, y)?;
            sum += weight.share;
            first += weight.share * Vector2::new(f64::from(x), f64::from(y));
            weights.push((x, y, weight.variance));
        }
    }
    if sum < 1.0 {
        return None;
    }
    let centre = first / sum;
    let variance =
        weights.iter().map(|&(x, y, v)| v * (Vector2::new(f64::from(x), f64::from(y)) - centre).norm_squared() / 2.0).sum::<f64>()
            / (sum * sum);
    Some(Weighted {
        centre_px: centre + Vector2::new(f64::from(patch.x), f64::from(patch.y)),
        std_px: (variance + FLOOR_STD_PX * FLOOR_STD_PX).sqrt(),
        area_px: sum,
    })
}

/// The blob's surroundings, with what each pixel is.
struct Patch {
    x: u32,
    y: u32,
    width: i32,
    height: i32,
    chroma: Vec<f64>,
    kind: Vec<Kind>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Core,
    Edge,
    Outside,
    /// Farther out: not looked at.
    Far,
}

struct Weight {
    share: f64,
    variance: f64,
}

impl Patch {
    fn cut(image: &RgbImage, region: Region, mask: &GrayImage, bounds: Bounds) -> Option<Self> {
        let reach = REACH_PX as i32;
        let (left, top) = (u32::try_from(bounds.left - reach).ok()?, u32::try_from(bounds.top - reach).ok()?);
        let width = u32::try_from(bounds.right - bounds.left + 1 + 2 * reach).ok()?;
        let height = u32::try_from(bounds.bottom - bounds.top + 1 + 2 * reach).ok()?;
        let inside = image::imageops::crop_imm(mask, left, top, width, height).to_image();
        if (inside.width(), inside.height()) != (width, height) {
            return None;
        }
        let distance_out = distance_transform(&inside, Norm::LInf);
        let mut negative = inside;
        image::imageops::invert(&mut negative);
        let distance_in = distance_transform(&negative, Norm::LInf);
        let deepest = distance_in.as_raw().iter().copied().max()?;
        let core = CORE_DEPTH_PX.min(deepest);
        let kind: Vec<Kind> = distance_in
            .as_raw()
            .iter()
            .zip(distance_out.as_raw())
            .map(|(&depth, &distance)| match (depth, distance) {
                (depth, _) if depth >= core => Kind::Core,
                (_, distance) if distance > REACH_PX as u8 => Kind::Far,
                (_, distance) if distance >= OUTSIDE_PX => Kind::Outside,
                _ => Kind::Edge,
            })
            .collect();
        let (x, y) = (region.x + left, region.y + top);
        let colour: Vec<Vector3<f64>> = (0..height)
            .flat_map(|v| (0..width).map(move |u| (u, v)))
            .map(|(u, v)| Vector3::from(image.get_pixel(x + u, y + v).0.map(f64::from)))
            .collect();
        let mean = |wanted: Kind| {
            let (sum, count) =
                colour.iter().zip(&kind).filter(|(_, k)| **k == wanted).fold((Vector3::zeros(), 0.0), |(s, n), (c, _)| (s + c, n + 1.0));
            (count > 0.0).then(|| sum / count)
        };
        let inner = mean(Kind::Core)?;
        let axis = (inner - Vector3::repeat(inner.mean())).try_normalize(1.0)?;
        let chroma = colour.iter().map(|c| c.dot(&axis)).collect();
        Some(Self { x, y, width: width as i32, height: height as i32, chroma, kind })
    }

    fn index(&self, x: i32, y: i32) -> usize {
        (y * self.width + x) as usize
    }

    /// How much of a pixel is marker; `None` without background or contrast nearby.
    fn weight(&self, x: i32, y: i32) -> Option<Weight> {
        match self.kind[self.index(x, y)] {
            Kind::Core => Some(Weight { share: 1.0, variance: 0.0 }),
            Kind::Outside | Kind::Far => Some(Weight { share: 0.0, variance: 0.0 }),
            Kind::Edge => {
                let inner = self.nearby(x, y, Kind::Core)?;
                let outer = self.nearby(x, y, Kind::Outside)?;
                let contrast = inner.mean - outer.mean;
                if contrast < 10.0 {
                    return None;
                }
                // Not clamped to 0..1: noise must cancel on both sides. The limits are for what is no mixture at all.
                let share = ((self.chroma[self.index(x, y)] - outer.mean) / contrast).clamp(-0.5, 1.5);
                Some(Weight { share, variance: outer.variance / (contrast * contrast) })
            }
        }
    }

    /// Mean and variance of the chroma of the pixels of one kind in the window, which grows until it holds some.
    fn nearby(&self, x: i32, y: i32, kind: Kind) -> Option<Scatter> {
        let largest = self.width.max(self.height);
        let mut half = WINDOW_PX;
        while half <= largest {
            let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
            for v in (y - half).max(0)..=(y + half).min(self.height - 1) {
                for u in (x - half).max(0)..=(x + half).min(self.width - 1) {
                    let i = self.index(u, v);
                    if self.kind[i] == kind {
                        count += 1.0;
                        sum += self.chroma[i];
                        squares += self.chroma[i] * self.chroma[i];
                    }
                }
            }
            if count >= 4.0 {
                let mean = sum / count;
                return Some(Scatter { mean, variance: (squares / count - mean * mean).max(0.0) });
            }
            half *= 2;
        }
        None
    }
}

struct Scatter {
    mean: f64,
    variance: f64,
}
