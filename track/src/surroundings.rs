//! A blob of the marker's colour and what is around it: chroma and luma of its pixels.

use image::RgbImage;
use nalgebra::{Vector2, Vector3};

use crate::bits::Bits;
use crate::marker::Region;
use crate::plane::{Kind, Plane, kinds};
use crate::shaft::Shaft;

/// How far beyond the mask the background is looked at [px].
pub const REACH_PX: u32 = 7;
/// What red, green and blue make of luma (JFIF 1.02).
pub(crate) const LUMA_OF_RGB: [f64; 3] = [0.299, 0.587, 0.114];

/// Pixels of a mask that an outline spans, ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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

/// A blob with what is around it.
pub(crate) struct Surroundings<'i> {
    pub(crate) image: &'i RgbImage,
    /// Column and row of the image at which the plane begins.
    pub(crate) corner: [u32; 2],
    /// Chroma along the marker's own direction, and luma.
    pub(crate) plane: Plane,
    /// Mean chroma and luma of the marker, grey levels.
    pub(crate) marker: [f64; 2],
    /// The same in red, green and blue.
    pub(crate) marker_rgb: Vector3<f64>,
}

impl<'i> Surroundings<'i> {
    /// Of the blob that spans `bounds` in `mask`, the mask of `region` of `image`; it must be [`REACH_PX`] away from the mask's edge.
    ///
    /// What lies along a `shaft` is not looked at. `None` where the blob is nearer, or where the marker has no colour.
    pub(crate) fn of(image: &'i RgbImage, region: Region, mask: &Bits, bounds: Bounds, shaft: Option<&Shaft>) -> Option<Self> {
        let reach = REACH_PX as i32;
        let (left, top) = (u32::try_from(bounds.left - reach).ok()?, u32::try_from(bounds.top - reach).ok()?);
        let width = u32::try_from(bounds.right - bounds.left + 1 + 2 * reach).ok()?;
        let height = u32::try_from(bounds.bottom - bounds.top + 1 + 2 * reach).ok()?;
        if (left + width) as usize > mask.width() || (top + height) as usize > mask.height() {
            return None;
        }
        let mut kinds = kinds(&mask.crop(left as i32, top as i32, width, height));
        if let Some(shaft) = shaft {
            let middle = |low: i32, high: i32| f64::from(reach) + 0.5 * f64::from(high - low);
            shaft.hide(&mut kinds, width as usize, Vector2::new(middle(bounds.left, bounds.right), middle(bounds.top, bounds.bottom)));
        }
        let (x, y) = (region.x + left, region.y + top);
        let rgb = |i: usize| {
            let i = i as u32;
            Vector3::from(image.get_pixel(x + i % width, y + i / width).0.map(f64::from))
        };
        let core: Vec<usize> = (0..kinds.len()).filter(|&i| kinds[i] == Kind::Core).collect();
        let inner = core.iter().map(|&i| rgb(i)).sum::<Vector3<f64>>() / core.len() as f64;
        let axis = (inner - Vector3::repeat(inner.mean())).try_normalize(1.0)?;
        let of = |rgb: Vector3<f64>| [rgb.dot(&axis), rgb.dot(&Vector3::from(LUMA_OF_RGB))];
        let colour = (0..kinds.len()).map(|i| of(rgb(i))).collect();
        let plane = Plane::new(width as i32, height as i32, colour, kinds);
        Some(Self { image, corner: [x, y], plane, marker: of(inner), marker_rgb: inner })
    }
}
