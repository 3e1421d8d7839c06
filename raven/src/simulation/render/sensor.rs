//! From light to a JPEG: brightness of the room, noise of the sensor, eight bits, compression.

use jpeg_encoder::{ChromaSubsamplingMethod, ColorType, Encoder, SamplingFactor};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::Canvas;
use crate::simulation::truth::stream;
use crate::{Error, Result};

/// Standard deviation of a pixel [of 255].
const NOISE: f64 = 1.5;
/// Length of the store of noise, a power of two.
const STORE: usize = 1 << 20;
const QUALITY: u8 = 90;

/// Turns canvases into images. Noise comes from a store, entered at another place for every row.
#[derive(Debug)]
pub struct Sensor {
    store: Vec<i8>,
}

impl Sensor {
    /// A sensor whose noise follows from `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = stream(seed, "sensor");
        let store = (0..STORE)
            .map(|_| {
                let normal: f64 = StandardNormal.sample(&mut rng);
                (NOISE * normal).round() as i8
            })
            .collect();
        Self { store }
    }

    /// Eight-bit image, red green blue, of a canvas of `width` columns under a light of `gain`.
    #[must_use]
    pub fn expose(&self, canvas: &Canvas, width: usize, gain: f32, rng: &mut impl Rng) -> Vec<u8> {
        let mut image = vec![0; canvas.pixels().len() * 3];
        let row_length = 3 * width;
        for (row, colours) in image.chunks_exact_mut(row_length).zip(canvas.pixels().chunks_exact(width)) {
            let from = rng.random_range(0..STORE - row_length);
            let noise = &self.store[from..from + row_length];
            for ((byte, light), noise) in row.iter_mut().zip(colours.as_flattened()).zip(noise) {
                *byte = (light * gain + f32::from(*noise) + 0.5).clamp(0.0, 255.0) as u8;
            }
        }
        image
    }

    /// The JPEG of an eight-bit image, with half the columns of chroma, as webcams send it.
    ///
    /// A sample of chroma is the mean of its two pixels, as JFIF places it: that of the left pixel alone would move colours by half a pixel
    /// against brightness.
    ///
    /// # Errors
    /// If the image does not have `width` x `height` pixels.
    pub fn jpeg(&self, image: &[u8], width: u16, height: u16) -> Result<Vec<u8>> {
        let mut jpeg = Vec::new();
        let mut encoder = Encoder::new(&mut jpeg, QUALITY);
        encoder.set_sampling_factor(SamplingFactor::F_2_1);
        encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
        encoder.encode(image, width, height, ColorType::Rgb).map_err(|e| Error::Data(format!("an image could not be compressed: {e}.")))?;
        Ok(jpeg)
    }
}
