//! The surroundings of a blob as a JPEG file holds them: luma of its pixels, and Cb and Cr at their own samples, in squares of 8 x 8 that
//! went through one cosine transform each.
//!
//! A sample of chroma is the mean of the pixels that it covers and lies in their middle (JFIF 1.02). Decoders interpolate between samples,
//! a pixel taking 3/4 of its own and 1/4 of the next, so that along each axis a sample `s` comes back from the pixels `p` around as
//!
//! ```text
//! s = (3 p_1 + 3 p_2 - p_0 - p_3) / 4,   p_1 and p_2 its own
//! ```

use image::RgbImage;
use nalgebra::Vector3;
use raven::log::{Sampling, Steps};

use crate::cosines::{COUNT, SIDE};
use crate::model::Channel;
use crate::patch::{Block, CHROMA, LANES, LUMA};
use crate::plane::{Kind, Plane};
use crate::surroundings::{LUMA_OF_RGB, Surroundings};

/// Blocks of a square, two rows each.
pub(crate) const BLOCKS: usize = COUNT / LANES;
/// Luma, Cb and Cr.
pub(crate) const PLANES: usize = 3;
/// What red, green and blue make of them (JFIF 1.02).
pub(crate) const OF_RGB: [[f64; 3]; PLANES] = [LUMA_OF_RGB, [-0.168_736, -0.331_264, 0.5], [0.5, -0.418_688, -0.081_312]];
/// What luma, Cb and Cr make of red, green and blue.
const TO_RGB: [[f64; PLANES]; 3] = [[1.0, 0.0, 1.402], [1.0, -0.344_136, -0.714_136], [1.0, 1.772, 0.0]];
/// Usual blur of luma [px].
const BLUR_PX: f64 = 1.0;
/// Least colour of a marker over its chroma: a tenth of a grey level.
const LEAST_GAIN: f64 = 1e-3;
/// Means near samples that differ by no more than the variance within them over this differ by chance. They are of some twenty samples, but
/// rounding makes neighbours err together: over even backgrounds it is 0.22, 0.24 and 0.22 of that on average in luma, Cb and Cr (1320 rendered
/// balls), often more. Where 0.22 counts as chance, not a third, rendered centres are 3 to 8 % worse and tips up to 4 % in depth.
const INDEPENDENT: f64 = 3.0;
/// What pixels around a sample of chroma that two of them share make of it.
const BETWEEN: [f64; 4] = [-0.25, 0.75, 0.75, -0.25];

/// One square: of luma, or of Cb and Cr.
#[derive(Debug, Clone)]
pub(crate) struct Square {
    /// Two rows of samples each; what is not looked at is far outside of any ball and has the colour of its background.
    pub(crate) blocks: [Block; BLOCKS],
    /// First of its planes.
    first: usize,
}

impl Square {
    /// Its planes, and where its blocks hold them.
    pub(crate) fn planes(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (first, count) = (self.first, if self.first == 0 { 1 } else { 2 });
        (0..count).map(move |slot| (first + slot, slot))
    }
}

/// A blob with its edge.
#[derive(Debug, Clone)]
pub(crate) struct Squares {
    /// Column and row of the image from which the places of samples count.
    pub(crate) corner: [u32; 2],
    pub(crate) all: Vec<Square>,
    /// Steps of the coefficients of each plane.
    pub(crate) steps: [Steps; PLANES],
    /// What each plane shows of the ball.
    pub(crate) channels: [Channel; PLANES],
    /// Mean of all the background in each plane, and how far the background near a sample is its own, not this.
    pub(crate) mean: [f64; PLANES],
    pub(crate) local: [f64; PLANES],
    /// Red, green and blue of the marker over its chroma, and of the background.
    pub(crate) marker_rgb: [f32; 3],
    pub(crate) background_rgb: [f32; 3],
    /// Usual blur of chroma and of luma [px].
    pub(crate) blur_px: [f64; 2],
}

impl Squares {
    /// Which blur a square has: that of chroma or of luma.
    pub(crate) const fn blur(&self, square: &Square) -> usize {
        self.channels[square.first].blur
    }

    /// Of a blob's surroundings; `None` where there is too little background.
    pub(crate) fn of(around: &Surroundings<'_>, sampling: &Sampling) -> Option<Self> {
        let (chroma, first) = chroma(around, sampling.pixels);
        let (corner, [marker, luma]) = (around.corner, around.marker);
        let mut all = Vec::new();
        let [_, of_luma] = add_squares(&mut all, &around.plane, corner, [1; 2], corner, 0)?;
        let [of_cb, of_cr] = add_squares(&mut all, &chroma, first, sampling.pixels, corner, 1)?;
        let local = [of_luma, of_cb, of_cr];
        // A gain may be small, but what is told is divided by it.
        let gain = |colour: f64| (colour / marker).abs().max(LEAST_GAIN).copysign(colour) as f32;
        let channel = |blur: usize, colour: f64| Channel { blur, gain: gain(colour) };
        let channels = [channel(LUMA, luma), channel(CHROMA, of(1, &around.marker_rgb)), channel(CHROMA, of(2, &around.marker_rgb))];
        let ([[_, luma], _], [[cb, cr], _]) = (around.plane.everywhere()?, chroma.everywhere()?);
        // The mean of `n` pixels has a variance of `n^2 / 12`, of which one pixel's is in the blur of luma.
        let wider2 = sampling.pixels.iter().map(|&n| f64::from(n * n - 1) / 12.0).sum::<f64>() / 2.0;
        let blur_px = [(BLUR_PX * BLUR_PX + wider2).sqrt(), BLUR_PX];
        let marker_rgb = (around.marker_rgb / marker).map(|v| v as f32).into();
        let background_rgb = TO_RGB.map(|[y, b, r]| (y * luma + b * cb + r * cr) as f32);
        Some(Self { corner, all, steps: sampling.steps, channels, mean: [luma, cb, cr], local, marker_rgb, background_rgb, blur_px })
    }
}

/// A plane's part of red, green and blue.
fn of(plane: usize, rgb: &Vector3<f64>) -> f64 {
    rgb.dot(&Vector3::from(OF_RGB[plane]))
}

/// Samples of Cb and Cr whose pixels all lie in the surroundings, and the column and row of the first, in samples.
fn chroma(around: &Surroundings<'_>, pixels: [u32; 2]) -> (Plane, [u32; 2]) {
    let size = [around.plane.width as u32, around.plane.height as u32];
    let first = [0, 1].map(|axis| around.corner[axis].div_ceil(pixels[axis]));
    let [width, height] = [0, 1].map(|axis| ((around.corner[axis] + size[axis]) / pixels[axis]).saturating_sub(first[axis]));
    let (mut colour, mut kinds) = (Vec::new(), Vec::new());
    for y in first[1]..first[1] + height {
        for x in first[0]..first[0] + width {
            colour.push(sample(around.image, [x, y], pixels));
            let within = |x: u32, y: u32| around.plane.kinds[((y - around.corner[1]) * size[0] + x - around.corner[0]) as usize];
            let own = (0..pixels[1]).flat_map(|dy| (0..pixels[0]).map(move |dx| (x * pixels[0] + dx, y * pixels[1] + dy)));
            kinds.push(own.map(|(x, y)| within(x, y)).reduce(both).unwrap_or(Kind::Far));
        }
    }
    (Plane::new(width as i32, height as i32, colour, kinds), first)
}

/// What a sample of pixels of two kinds is.
fn both(a: Kind, b: Kind) -> Kind {
    match (a, b) {
        (Kind::Far, _) | (_, Kind::Far) => Kind::Far,
        (a, b) if a == b => a,
        _ => Kind::Edge,
    }
}

/// Cb and Cr of a sample.
fn sample(image: &RgbImage, place: [u32; 2], pixels: [u32; 2]) -> [f64; 2] {
    let last = [image.width() - 1, image.height() - 1];
    // Pixels along an axis and their weights.
    let along = |axis: usize| {
        let (at, shared) = (place[axis] * pixels[axis], pixels[axis] == 2);
        let weights = if shared { &BETWEEN[..] } else { &[1.0] };
        weights.iter().enumerate().map(move |(i, &weight)| ((at + i as u32).saturating_sub(u32::from(shared)).min(last[axis]), weight))
    };
    let mut rgb = Vector3::zeros();
    for (y, down) in along(1) {
        for (x, across) in along(0) {
            rgb += Vector3::from(image.get_pixel(x, y).0.map(f64::from)) * (down * across);
        }
    }
    [of(1, &rgb), of(2, &rgb)]
}

/// Adds the squares of a plane in which the blob's edge or inside is, and returns how far the background of a sample is that near it, not that of
/// all: of the variance of what is near, the part that is no chance. `first` is the plane's first sample in the file, `pixels` the pixels of each.
fn add_squares(
    all: &mut Vec<Square>,
    plane: &Plane,
    first: [u32; 2],
    pixels: [u32; 2],
    corner: [u32; 2],
    first_plane: usize,
) -> Option<[f64; 2]> {
    let everywhere = plane.everywhere()?;
    // How the backgrounds near samples at the edge differ, and the variance within them.
    let mut sums = [[0.0; 2]; 2];
    let side = SIDE as i32;
    let [left, top] = first.map(|first| first as i32);
    let middle = |axis: usize, sample: i32| (pixels[axis] as i32 * sample) as f32 + 0.5 * (pixels[axis] - 1) as f32 - corner[axis] as f32;
    for y in top / side..=(top + plane.height - 1) / side {
        for x in left / side..=(left + plane.width - 1) / side {
            let rows = (y * side).max(top)..((y + 1) * side).min(top + plane.height);
            let columns = (x * side).max(left)..((x + 1) * side).min(left + plane.width);
            let at = |u: i32, v: i32| ((v - top) * plane.width + u - left) as usize;
            let tells = |v: i32| plane.kinds[at(columns.start, v)..=at(columns.end - 1, v)].iter().any(|kind| *kind < Kind::Outside);
            if !rows.clone().any(tells) {
                continue;
            }
            let mut square = Square { blocks: [Block::OUTSIDE; BLOCKS], first: first_plane };
            for (u, v) in rows.flat_map(|v| columns.clone().map(move |u| (u, v))) {
                let at = at(u, v);
                let [background, texture] = match plane.kinds[at] {
                    Kind::Core => everywhere,
                    Kind::Edge | Kind::Outside => plane.nearby(u - left, v - top)?,
                    Kind::Far => continue,
                };
                if plane.kinds[at] == Kind::Edge {
                    for (k, [between, within]) in sums.iter_mut().enumerate() {
                        *between += (background[k] - everywhere[0][k]).powi(2);
                        *within += texture[k];
                    }
                }
                let i = ((v - y * side) * side + u - x * side) as usize;
                let (block, lane) = (&mut square.blocks[i / LANES], i % LANES);
                (block.u[lane], block.v[lane]) = (middle(0, u), middle(1, v));
                for (slot, samples) in block.planes.iter_mut().enumerate() {
                    // The surroundings' own planes are chroma and luma, of which the first comes from Cb and Cr.
                    let k = if first_plane == 0 { LUMA } else { slot };
                    let [colour, background, texture] = [plane.colour[at], background, texture].map(|of| of[k] as f32);
                    (samples.colour[lane], samples.background[lane], samples.texture[lane]) = (colour, background, texture);
                }
            }
            all.push(square);
        }
    }
    Some(sums.map(|[between, within]| if between > 0.0 { (1.0 - within / (INDEPENDENT * between)).max(0.0) } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use jpeg_encoder::{ChromaSubsamplingMethod, ColorType, Encoder, SamplingFactor};

    use super::*;

    #[test]
    fn samples_come_back_from_decoded_pixels() {
        // Checks of four pixels, which interpolation blurs.
        let image = RgbImage::from_fn(64, 64, |x, y| if (x / 4 + y / 4) % 2 == 0 { Rgb([60, 140, 90]) } else { Rgb([140, 100, 120]) });
        for (factor, pixels) in [
            (SamplingFactor::F_1_1, [1, 1]),
            (SamplingFactor::F_2_1, [2, 1]),
            (SamplingFactor::F_1_2, [1, 2]),
            (SamplingFactor::F_2_2, [2, 2]),
        ] {
            let mut jpeg = Vec::new();
            let mut encoder = Encoder::new(&mut jpeg, 100);
            encoder.set_sampling_factor(factor);
            encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
            encoder.encode(image.as_raw(), 64, 64, ColorType::Rgb).unwrap();
            assert_eq!(Sampling::of(&jpeg).unwrap().pixels, pixels);
            let decoded = image::load_from_memory(&jpeg).unwrap().into_rgb8();
            for (x, y) in (4..24).flat_map(|y| (4..24).map(move |x| (x, y))) {
                let rgb = Vector3::from(image.get_pixel(x * pixels[0], y * pixels[1]).0.map(f64::from));
                let [cb, cr] = sample(&decoded, [x, y], pixels);
                // Rounding of samples, coefficients of step 1 and pixels.
                let off = (cb - of(1, &rgb)).abs().max((cr - of(2, &rgb)).abs());
                assert!(off < 2.5, "{pixels:?} at {x}, {y}: {off}");
            }
        }
    }
}
