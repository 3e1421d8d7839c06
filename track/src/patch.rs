//! The surroundings of a blob, as the fit of [`crate::centre`] wants them: two colour coordinates per pixel, and the background around.
//!
//! The coordinates are the chroma along the marker's own direction at right angles to grey, in which a grey shaft, a shadow or a
//! highlight do not show, and the luma (Rec. 601), which webcams send at full resolution.

use image::RgbImage;
use nalgebra::Vector3;

use crate::bits::Bits;
use crate::marker::Region;

/// How far beyond the mask the background is looked at [px].
pub const REACH_PX: u32 = 7;
/// Depth from which on a pixel of the mask is all marker [px]: optical blur and chroma at half the resolution smear an edge over 3 px.
const CORE_DEPTH_PX: usize = 3;
/// Distance from which on a pixel is all background [px].
const OUTSIDE_PX: u32 = 4;
/// Half the window in which a pixel at the edge looks for background [px]; it grows until there is some.
const WINDOW_PX: i32 = 3;
/// Fewest pixels that make a background.
const FEWEST: f64 = 6.0;
/// Pixels of background within the window of a pixel at the edge, about.
const NEARBY: f64 = 20.0;
const LUMA: Vector3<f64> = Vector3::new(0.299, 0.587, 0.114);

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

/// One pixel, coordinates chroma and luma in grey levels.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Column in the image.
    pub u: f64,
    /// Row in the image.
    pub v: f64,
    /// Its colour.
    pub colour: [f64; 2],
    /// Mean colour of the background nearby.
    pub background: [f64; 2],
    /// Variance of the background nearby.
    pub texture: [f64; 2],
}

/// A blob with its edge.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Pixels of the blob and its edge.
    pub samples: Vec<Sample>,
    /// Mean chroma of the marker, grey levels.
    pub chroma: f64,
    /// Luma over chroma of the marker.
    pub luma_per_chroma: f64,
    /// Mean and variance of all the background.
    pub everywhere: [[f64; 2]; 2],
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Core,
    Edge,
    Outside,
    /// Farther out: not looked at.
    Far,
}

impl Patch {
    /// The blob that spans `bounds` in `mask`, the mask of `region` of `image`; it must be [`REACH_PX`] away from the mask's edge.
    ///
    /// `None` where it is not, or where the marker has no colour.
    #[must_use]
    pub fn cut(image: &RgbImage, region: Region, mask: &Bits, bounds: Bounds) -> Option<Self> {
        let reach = REACH_PX as i32;
        let (left, top) = (u32::try_from(bounds.left - reach).ok()?, u32::try_from(bounds.top - reach).ok()?);
        let width = u32::try_from(bounds.right - bounds.left + 1 + 2 * reach).ok()?;
        let height = u32::try_from(bounds.bottom - bounds.top + 1 + 2 * reach).ok()?;
        if (left + width) as usize > mask.width() || (top + height) as usize > mask.height() {
            return None;
        }
        let kinds = kinds(&mask.crop(left as i32, top as i32, width, height));
        let (x, y) = (region.x + left, region.y + top);
        let rgb = |i: usize| {
            let i = i as u32;
            Vector3::from(image.get_pixel(x + i % width, y + i / width).0.map(f64::from))
        };
        let core: Vec<usize> = (0..kinds.len()).filter(|&i| kinds[i] == Kind::Core).collect();
        let inner = core.iter().map(|&i| rgb(i)).sum::<Vector3<f64>>() / core.len() as f64;
        let axis = (inner - Vector3::repeat(inner.mean())).try_normalize(1.0)?;
        let plane = Plane {
            width: width as i32,
            height: height as i32,
            colour: (0..kinds.len()).map(|i| [rgb(i).dot(&axis), rgb(i).dot(&LUMA)]).collect(),
            kinds,
        };
        let everywhere = plane.background(0, 0, plane.width.max(plane.height))?;
        let mut samples = Vec::with_capacity(plane.kinds.len());
        for (i, &kind) in plane.kinds.iter().enumerate() {
            let (column, row) = (i as i32 % plane.width, i as i32 / plane.width);
            let [background, texture] = match kind {
                Kind::Core => everywhere,
                Kind::Edge => (WINDOW_PX..2 * reach).find_map(|half| plane.background(column, row, half))?,
                Kind::Outside | Kind::Far => continue,
            };
            let (u, v) = (f64::from(x) + f64::from(column), f64::from(y) + f64::from(row));
            samples.push(Sample { u, v, colour: plane.colour[i], background, texture });
        }
        Some(Self { samples, chroma: inner.dot(&axis), luma_per_chroma: inner.dot(&LUMA) / inner.dot(&axis), everywhere })
    }
}

impl Patch {
    /// The same with `slope` times chroma taken from luma.
    pub(crate) fn without_common(&self, slope: f64) -> Self {
        let less = |[chroma, luma]: [f64; 2]| [chroma, luma - slope * chroma];
        // Chroma and luma of a texture differ independently: muted colours, patches of light.
        let variance = |[chroma, luma]: [f64; 2]| [chroma, luma + slope * slope * chroma];
        let samples = self.samples.iter().map(|sample| Sample {
            colour: less(sample.colour),
            background: less(sample.background),
            texture: variance(sample.texture),
            ..*sample
        });
        let [mean, spread] = self.everywhere;
        Self {
            samples: samples.collect(),
            luma_per_chroma: self.luma_per_chroma - slope,
            everywhere: [less(mean), variance(spread)],
            ..*self
        }
    }

    /// The same where `noise` of the background's variance, grey levels squared, is no texture: without texture the background of all
    /// pixels is a better one than that nearby.
    pub(crate) fn without_noise(mut self, noise: [f64; 2]) -> Self {
        let [mean, spread] = self.everywhere;
        for sample in &mut self.samples {
            for k in 0..2 {
                sample.texture[k] = (sample.texture[k] - noise[k]).max(0.0);
                let texture = (spread[k] - noise[k]).max(0.0);
                let trust = texture / (texture + noise[k] / NEARBY + 1e-9);
                sample.background[k] = mean[k] + trust * (sample.background[k] - mean[k]);
            }
        }
        self
    }
}

/// What each pixel of a mask is, by its distance to the mask's edge.
fn kinds(mask: &Bits) -> Vec<Kind> {
    let mut core = mask.clone();
    for _ in 1..CORE_DEPTH_PX {
        let deeper = core.erode3();
        if deeper.any() {
            core = deeper;
        }
    }
    let wider = |by: u32| (0..by).fold(mask.clone(), |mask, _| mask.dilate3());
    let (near, reached) = (wider(OUTSIDE_PX - 1), wider(REACH_PX));
    let kind = |x: i32, y: i32| match () {
        () if core.get(x, y) => Kind::Core,
        () if near.get(x, y) => Kind::Edge,
        () if reached.get(x, y) => Kind::Outside,
        () => Kind::Far,
    };
    (0..mask.height() as i32).flat_map(|y| (0..mask.width() as i32).map(move |x| (x, y))).map(|(x, y)| kind(x, y)).collect()
}

struct Plane {
    width: i32,
    height: i32,
    colour: Vec<[f64; 2]>,
    kinds: Vec<Kind>,
}

impl Plane {
    /// Mean and variance of the background within `half` of a pixel; `None` if there is too little.
    fn background(&self, x: i32, y: i32, half: i32) -> Option<[[f64; 2]; 2]> {
        let (mut count, mut sum, mut squares) = (0.0, [0.0; 2], [0.0; 2]);
        for row in (y - half).max(0)..=(y + half).min(self.height - 1) {
            for column in (x - half).max(0)..=(x + half).min(self.width - 1) {
                let i = (row * self.width + column) as usize;
                if self.kinds[i] == Kind::Outside {
                    count += 1.0;
                    for k in 0..2 {
                        sum[k] += self.colour[i][k];
                        squares[k] += self.colour[i][k] * self.colour[i][k];
                    }
                }
            }
        }
        let mean = sum.map(|s| s / count);
        (count >= FEWEST).then(|| [mean, [0, 1].map(|k| (squares[k] / count - mean[k] * mean[k]).max(0.0))])
    }
}
