//! The surroundings of a blob, as the fit of [`crate::centre`] wants them: two colour coordinates per pixel, and the background around.
//!
//! The coordinates are the chroma along the marker's own direction at right angles to grey, in which a grey shaft, a shadow or a
//! highlight do not show, and the luma (Rec. 601), which webcams send at full resolution.

use image::RgbImage;
use nalgebra::Vector3;

use crate::bits::Bits;
use crate::marker::Region;
use crate::model::Channel;

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
const LUMA_OF_RGB: Vector3<f64> = Vector3::new(0.299, 0.587, 0.114);

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

/// Pixels that are worked on at a time.
pub const LANES: usize = 16;
/// A number of each of them.
pub type Lanes = [f32; LANES];

/// Pixels, in chroma or in luma.
#[derive(Debug, Clone, Copy)]
pub struct Samples {
    /// What is seen, grey levels.
    pub colour: Lanes,
    /// Mean of the background nearby.
    pub background: Lanes,
    /// Variance of the background nearby.
    pub texture: Lanes,
}

/// Some pixels of a patch.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    /// Columns from the patch's corner.
    pub u: Lanes,
    /// Rows from the patch's corner.
    pub v: Lanes,
    /// Chroma and luma.
    pub planes: [Samples; 2],
}

impl Block {
    /// Pixels far outside of any ball, where nothing is told: the last block is filled up with them.
    const OUTSIDE: Self = {
        let samples = Samples { colour: [0.0; LANES], background: [0.0; LANES], texture: [0.0; LANES] };
        Self { u: [1e4; LANES], v: [1e4; LANES], planes: [samples; 2] }
    };

    /// All of the pixels, in blocks.
    fn of(pixels: impl Iterator<Item = Pixel>) -> Vec<Self> {
        let mut blocks = Vec::new();
        for (n, pixel) in pixels.enumerate() {
            let i = n % LANES;
            if i == 0 {
                blocks.push(Self::OUTSIDE);
            }
            if let Some(block) = blocks.last_mut() {
                (block.u[i], block.v[i]) = (pixel.column as f32, pixel.row as f32);
                for (k, samples) in block.planes.iter_mut().enumerate() {
                    let [colour, background, texture] = [pixel.colour, pixel.background, pixel.texture].map(|of| of[k] as f32);
                    (samples.colour[i], samples.background[i], samples.texture[i]) = (colour, background, texture);
                }
            }
        }
        blocks
    }
}

/// One pixel with its background, in chroma and in luma.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    column: i32,
    row: i32,
    colour: [f64; 2],
    background: [f64; 2],
    texture: [f64; 2],
}

/// Chroma or luma.
pub const CHROMA: usize = 0;
/// See [`CHROMA`].
pub const LUMA: usize = 1;

/// A blob with its edge.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Column and row of the image at which the patch's pixels count from 0.
    pub corner: [u32; 2],
    /// Pixels of the blob and its edge: those on the white squares of a chessboard first.
    pub blocks: Vec<Block>,
    /// Blocks of the white squares.
    white: usize,
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
        let colour = (0..kinds.len()).map(|i| [rgb(i).dot(&axis), rgb(i).dot(&LUMA_OF_RGB)]).collect();
        let plane = Plane::new(width as i32, height as i32, colour, kinds);
        let everywhere = plane.background(0, 0, plane.width.max(plane.height))?;
        let mut squares = [Vec::new(), Vec::new()];
        for (i, &kind) in plane.kinds.iter().enumerate() {
            let (column, row) = (i as i32 % plane.width, i as i32 / plane.width);
            let [background, texture] = match kind {
                Kind::Core => everywhere,
                Kind::Edge => (WINDOW_PX..2 * reach).find_map(|half| plane.background(column, row, half))?,
                Kind::Outside | Kind::Far => continue,
            };
            squares[((x + y) as i32 + column + row) as usize % 2].push(Pixel { column, row, colour: plane.colour[i], background, texture });
        }
        let [mut blocks, black] = squares.map(|pixels| Block::of(pixels.into_iter()));
        let white = blocks.len();
        blocks.extend(black);
        let (chroma, luma) = (inner.dot(&axis), inner.dot(&LUMA_OF_RGB));
        Some(Self { corner: [x, y], blocks, white, chroma, luma_per_chroma: luma / chroma, everywhere })
    }
}

impl Patch {
    /// Chroma or luma `k` of it.
    #[inline(always)]
    pub(crate) fn channel(&self, k: usize) -> Channel {
        Channel { blur: k, gain: [1.0, self.luma_per_chroma as f32][k] }
    }

    /// Every other pixel of it.
    pub(crate) fn chessboard(&self) -> Self {
        Self { blocks: self.blocks[..self.white].to_vec(), ..*self }
    }

    /// The same with `slope` times chroma taken from luma.
    pub(crate) fn without_common(&self, slope: f64) -> Self {
        let by = slope as f32;
        let mut blocks = self.blocks.clone();
        for [chroma, luma] in blocks.iter_mut().map(|block| &mut block.planes) {
            for i in 0..LANES {
                luma.colour[i] -= by * chroma.colour[i];
                luma.background[i] -= by * chroma.background[i];
                // Chroma and luma of a texture differ independently: muted colours, patches of light.
                luma.texture[i] += by * by * chroma.texture[i];
            }
        }
        let [mean, spread] = self.everywhere;
        let everywhere = [[mean[0], mean[1] - slope * mean[0]], [spread[0], spread[1] + slope * slope * spread[0]]];
        Self { blocks, luma_per_chroma: self.luma_per_chroma - slope, everywhere, ..*self }
    }

    /// The same where `noise` of the background's variance, grey levels squared, is no texture: without texture the background of all
    /// pixels is a better one than that nearby.
    pub(crate) fn without_noise(mut self, noise: [f64; 2]) -> Self {
        let [mean, spread] = self.everywhere;
        for k in [CHROMA, LUMA] {
            let spread = (spread[k] - noise[k]).max(0.0);
            let trust = (spread / (spread + noise[k] / NEARBY + 1e-9)) as f32;
            let (mean, noise) = (mean[k] as f32, noise[k] as f32);
            for samples in self.blocks.iter_mut().map(|block| &mut block.planes[k]) {
                for (texture, background) in samples.texture.iter_mut().zip(&mut samples.background) {
                    *texture = (*texture - noise).max(0.0);
                    *background = mean + trust * (*background - mean);
                }
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
    /// Over all pixels of the background above and to the left of a corner between pixels.
    sums: Vec<Sums>,
}

/// Number of pixels, sums of chroma and luma, and of their squares.
type Sums = [f64; 5];

impl Plane {
    fn new(width: i32, height: i32, colour: Vec<[f64; 2]>, kinds: Vec<Kind>) -> Self {
        let corners = width as usize + 1;
        let mut sums: Vec<Sums> = vec![[0.0; 5]; corners * (height as usize + 1)];
        for (row, (kinds, colours)) in kinds.chunks_exact(corners - 1).zip(colour.chunks_exact(corners - 1)).enumerate() {
            let mut along = [0.0; 5];
            for (column, (kind, &[c, l])) in kinds.iter().zip(colours).enumerate() {
                if *kind == Kind::Outside {
                    along = plus(along, [1.0, c, l, c * c, l * l], 1.0);
                }
                sums[(row + 1) * corners + column + 1] = plus(along, sums[row * corners + column + 1], 1.0);
            }
        }
        Self { width, height, colour, kinds, sums }
    }

    /// Mean and variance of the background within `half` of a pixel; `None` if there is too little.
    fn background(&self, x: i32, y: i32, half: i32) -> Option<[[f64; 2]; 2]> {
        let corner = |x: i32, y: i32| self.sums[(y.clamp(0, self.height) * (self.width + 1) + x.clamp(0, self.width)) as usize];
        let (left, top, right, bottom) = (x - half, y - half, x + half + 1, y + half + 1);
        let lower = plus(corner(right, bottom), corner(left, bottom), -1.0);
        let [count, chroma, luma, chroma2, luma2] = plus(lower, plus(corner(right, top), corner(left, top), -1.0), -1.0);
        let mean = [chroma / count, luma / count];
        let variance = [chroma2 / count - mean[0] * mean[0], luma2 / count - mean[1] * mean[1]];
        (count >= FEWEST).then(|| [mean, variance.map(|v| v.max(0.0))])
    }
}

fn plus(a: Sums, b: Sums, factor: f64) -> Sums {
    std::array::from_fn(|i| a[i] + factor * b[i])
}
