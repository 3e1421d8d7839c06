//! Blobs of the marker's colour in an image, and their centres.
//!
//! Threshold, median, erosion, dilation, contour: the pipeline of Haghighipanah et al. 2017, see [`crate::bits`] and [`crate::outline`].
//! Three centres can be had of each blob:
//!
//! | centre | what | standard deviation per axis |
//! |---|---|---|
//! | [`Centre::Contour`] | centroid by the outline's moments, the paper's | [`CONTOUR_STD_PX`] |
//! | [`Centre::Ball`] | a shaded ball fitted to the colours, see [`crate::centre`] | the fit's, mostly 0.03 to 0.10 px |
//! | [`Centre::Refined`] | the same, the weights of its pixels taken from the residuals until they settle | the fit's |
//!
//! Pixel (0, 0) is the centre of the top-left pixel.

use std::ops::Range;

use image::RgbImage;
use nalgebra::{Matrix2, Vector2};
use raven::log::Sampling;

use crate::bits::Bits;
use crate::centre::{self, Ball, RESPONSE_STD_PX};
use crate::colour::MarkerColour;
use crate::outline::{self, Moments, Pixel};
use crate::patch::Patch;
use crate::response::Response;
use crate::shaft::Shaft;
use crate::squares::Squares;
use crate::surroundings::{Bounds, REACH_PX, Surroundings};

/// A rectangle of an image [px].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// Leftmost column.
    pub x: u32,
    /// Uppermost row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Region {
    /// All of an image.
    #[must_use]
    pub fn whole(image: &RgbImage) -> Self {
        Self { x: 0, y: 0, width: image.width(), height: image.height() }
    }

    /// A square of `side_px` around a pixel, without what lies left of or above the image.
    #[must_use]
    pub fn around(pixel: &Vector2<f64>, side_px: u32) -> Self {
        let from = |centre: f64| (centre - f64::from(side_px) / 2.0).round();
        let cut = |from: f64| (from.max(0.0) as u32, (f64::from(side_px) + from.min(0.0)).max(0.0) as u32);
        let ((x, width), (y, height)) = (cut(from(pixel.x)), cut(from(pixel.y)));
        Self { x, y, width, height }
    }

    /// Its columns.
    #[must_use]
    pub const fn columns(&self) -> Range<u32> {
        self.x..self.x.saturating_add(self.width)
    }

    /// Its rows.
    #[must_use]
    pub const fn rows(&self) -> Range<u32> {
        self.y..self.y.saturating_add(self.height)
    }

    /// The same as it lies in the part of the image that begins at `corner`.
    #[must_use]
    pub const fn from(self, corner: [u32; 2]) -> Self {
        Self { x: self.x.saturating_sub(corner[0]), y: self.y.saturating_sub(corner[1]), ..self }
    }

    /// The part that lies in the image; `None` if there is none.
    #[must_use]
    pub fn clipped(self, image: &RgbImage) -> Option<Self> {
        let width = self.width.min(image.width().saturating_sub(self.x));
        let height = self.height.min(image.height().saturating_sub(self.y));
        (width > 0 && height > 0).then_some(Self { width, height, ..self })
    }
}

/// Which of a blob's centres to take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Centre {
    /// Of a shaded ball fitted to the colours.
    #[default]
    Ball,
    /// Centroid of the mask's outline: the paper's.
    Contour,
    /// Of a ball whose weights have settled, see `--refine`.
    #[value(skip)]
    Refined,
}

/// A connected area of the marker's colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blob {
    /// Centroid of the outline `(u, v)` [px].
    pub contour_px: Vector2<f64>,
    /// Pixels on and within the outline.
    pub area_px: f64,
    /// Minor over major axis, 1 for a disc.
    pub aspect: f64,
    /// Area over that of the ellipse with the same second moments, 1 for an ellipse, less for what is bent or partly hidden.
    pub ellipse_fill: f64,
    /// Whether it reaches to the edge of the image or of the region, so that part of it may lie outside.
    pub cut_off: bool,
    /// In pixels of the mask.
    bounds: Bounds,
}

/// What is flatter or less like an ellipse is no ball, even in motion.
const MIN_ASPECT: f64 = 0.6;
const MIN_FILL: f64 = 0.9;

impl Blob {
    /// Whether it may be a ball by its shape.
    #[must_use]
    pub fn is_round(&self) -> bool {
        self.aspect >= MIN_ASPECT && self.ellipse_fill >= MIN_FILL
    }
}

/// Standard deviation per axis of a contour's centroid [px]. On rendered balls 0.12 px under even light and 0.19 px with JPEG
/// compression; 0.20 to 0.33 px under light from one side, which shifts the contour.
pub const CONTOUR_STD_PX: f64 = 0.30;
/// Fewest pixels that a ball is fitted to: a radius of 3 px.
const FEWEST_PX: f64 = 28.0;

/// All blobs of a colour in an image, or in a region of it.
#[derive(Debug, Clone)]
pub struct Blobs<'i> {
    image: &'i RgbImage,
    region: Region,
    sampling: Option<&'i Sampling>,
    shaft: Option<Shaft>,
    mask: Bits,
    /// The blobs, the largest first.
    pub found: Vec<Blob>,
}

impl<'i> Blobs<'i> {
    /// Looks for blobs of `colour`. The clean-up removes what is narrower than 3 px.
    #[must_use]
    pub fn find(image: &'i RgbImage, region: Option<Region>, colour: &MarkerColour) -> Self {
        let nowhere = Region { x: 0, y: 0, width: 0, height: 0 };
        let region = region.unwrap_or_else(|| Region::whole(image)).clipped(image).unwrap_or(nowhere);
        let mask = colour.mask(image, region).clean();
        let mut found: Vec<Blob> = outline::outlines(&mask).iter().filter_map(|outline| blob(region, outline)).collect();
        found.sort_by(|a, b| b.area_px.total_cmp(&a.area_px));
        Self { image, region, sampling: None, shaft: None, mask, found }
    }

    /// The same of an image that was decoded from a JPEG file that holds colour so.
    #[must_use]
    pub fn sampled(self, sampling: Option<&'i Sampling>) -> Self {
        Self { sampling, ..self }
    }

    /// The same of balls on a shaft.
    #[must_use]
    pub fn on_shaft(self, shaft: Option<Shaft>) -> Self {
        Self { shaft, ..self }
    }

    /// The centre of a blob of this image, with its covariance and the radius. Where no ball fits, or the blob is small or
    /// cut off, it is the contour's.
    #[must_use]
    pub fn centre(&self, blob: &Blob, kind: Centre) -> Ball {
        let disc_px = (blob.area_px / std::f64::consts::PI).sqrt();
        let noise_px2 = Matrix2::identity() * (CONTOUR_STD_PX.powi(2) - RESPONSE_STD_PX.powi(2));
        let contour = Ball { centre_px: blob.contour_px, noise_px2, response: Response::untold(RESPONSE_STD_PX), radius_px: disc_px };
        if kind == Centre::Contour || blob.cut_off || blob.area_px < FEWEST_PX {
            return contour;
        }
        let fit = || {
            let around = Surroundings::of(self.image, self.region, &self.mask, blob.bounds, self.shaft.as_ref())?;
            let squares = self.sampling.and_then(|sampling| Squares::of(&around, sampling));
            centre::fit(&Patch::of(&around)?, squares.as_ref(), blob.contour_px, disc_px, kind == Centre::Refined)
        };
        fit().unwrap_or(contour)
    }
}

fn blob(region: Region, outline: &[Pixel]) -> Option<Blob> {
    let moments = Moments::of(outline)?;
    let range = |values: &mut dyn Iterator<Item = i32>| values.fold((i32::MAX, i32::MIN), |(low, high), v| (low.min(v), high.max(v)));
    let (left, right) = range(&mut outline.iter().map(|p| p.x));
    let (top, bottom) = range(&mut outline.iter().map(|p| p.y));
    let margin = REACH_PX as i32;
    Some(Blob {
        contour_px: moments.centroid_px + Vector2::new(f64::from(region.x), f64::from(region.y)),
        area_px: outline::pixels_within(outline, moments.area_px2),
        aspect: moments.aspect(),
        ellipse_fill: moments.ellipse_fill(),
        cut_off: left < margin || top < margin || right + margin >= region.width as i32 || bottom + margin >= region.height as i32,
        bounds: Bounds { left, top, right, bottom },
    })
}
