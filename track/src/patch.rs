//! The surroundings of a blob, as the fit of [`crate::centre`] wants them: two colour coordinates per pixel, and the background around.
//!
//! The coordinates are the chroma along the marker's own direction at right angles to grey, in which a grey shaft, a shadow or a
//! highlight do not show, and the luma (Rec. 601), which webcams send at full resolution.

use fearless_simd::prelude::*;
use fearless_simd::{f32x16, mask32x16};

use crate::model::Channel;
use crate::plane::Kind;
use crate::surroundings::Surroundings;

/// Pixels of background within the window of a pixel at the edge, about.
const NEARBY: f64 = 20.0;

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

impl Samples {
    /// See [`Patch::without_noise`]; `everywhere` are mean and variance of all the background.
    pub(crate) fn without_noise(&mut self, [mean, spread]: [f64; 2], noise: f64) {
        let spread = (spread - noise).max(0.0);
        self.shrink(mean, spread / (spread + noise / NEARBY + 1e-9));
        self.subtract(noise);
    }

    /// The background as far as it is `local`, else the mean of all.
    pub(crate) fn shrink(&mut self, mean: f64, local: f64) {
        let (mean, local) = (mean as f32, local as f32);
        for background in &mut self.background {
            *background = mean + local * (*background - mean);
        }
    }

    /// So much of the background's variance, grey levels squared, is no texture.
    pub(crate) fn subtract(&mut self, noise: f64) {
        for texture in &mut self.texture {
            *texture = (*texture - noise as f32).max(0.0);
        }
    }
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
    pub(crate) const OUTSIDE: Self = {
        let samples = Samples { colour: [0.0; LANES], background: [0.0; LANES], texture: [0.0; LANES] };
        Self { u: [FAR_PX; LANES], v: [FAR_PX; LANES], planes: [samples; 2] }
    };

    /// Whether there are pixels, or samples, and not what it was filled up with.
    #[inline(always)]
    pub(crate) fn is_looked_at<S: Simd>(&self, simd: S) -> mask32x16<S> {
        f32x16::load_array(simd, self.u).simd_lt(FAR_PX)
    }

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

/// Farther from a patch's corner than any of its pixels [px].
const FAR_PX: f32 = 1e4;
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

impl Patch {
    /// Of a blob's surroundings; `None` where there is too little background.
    #[must_use]
    pub(crate) fn of(around: &Surroundings<'_>) -> Option<Self> {
        let Surroundings { plane, corner: [x, y], .. } = around;
        let everywhere = plane.everywhere()?;
        let mut squares = [Vec::new(), Vec::new()];
        for (i, &kind) in plane.kinds.iter().enumerate() {
            let (column, row) = (i as i32 % plane.width, i as i32 / plane.width);
            let [background, texture] = match kind {
                Kind::Core => everywhere,
                Kind::Edge => plane.nearby(column, row)?,
                Kind::Outside | Kind::Far => continue,
            };
            squares[((x + y) as i32 + column + row) as usize % 2].push(Pixel { column, row, colour: plane.colour[i], background, texture });
        }
        let [mut blocks, black] = squares.map(|pixels| Block::of(pixels.into_iter()));
        let white = blocks.len();
        blocks.extend(black);
        let [chroma, luma] = around.marker;
        Some(Self { corner: around.corner, blocks, white, chroma, luma_per_chroma: luma / chroma, everywhere })
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
            self.blocks.iter_mut().for_each(|block| block.planes[k].without_noise([mean[k], spread[k]], noise[k]));
        }
        self
    }
}
