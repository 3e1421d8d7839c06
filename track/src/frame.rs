//! A frame of which only a part may have been decoded.

use std::borrow::Cow;

use image::RgbImage;
use raven::Result;
use raven::log::{CameraFrame, Part, Stamp};

use crate::marker::Region;

/// A decoded frame.
#[derive(Debug, Clone)]
pub struct Frame {
    encoded: CameraFrame,
    image: RgbImage,
    /// Where the pixels are right; `None` is everywhere.
    part: Option<Part>,
}

impl Frame {
    /// Decodes a part of a frame, or all of it.
    ///
    /// # Errors
    /// If the frame is broken.
    pub fn decode(part: Option<Part>, encoded: CameraFrame) -> Result<Self> {
        let image = match &part {
            Some(part) => encoded.decode_rgb_part(part)?,
            None => encoded.decode_rgb_part(&EVERYTHING)?,
        };
        Ok(Self { encoded, image, part })
    }

    /// When it was taken.
    #[must_use]
    pub const fn stamp(&self) -> Stamp {
        self.encoded.stamp
    }

    /// Columns and rows.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        self.image.dimensions()
    }

    /// The whole image, decoded now if it has not been.
    #[must_use]
    pub fn whole(&self) -> Cow<'_, RgbImage> {
        match self.part {
            None => Cow::Borrowed(&self.image),
            // What could be decoded in part can be as a whole; if not, the part is what there is.
            Some(_) => self.encoded.decode_rgb_part(&EVERYTHING).map_or(Cow::Borrowed(&self.image), Cow::Owned),
        }
    }

    /// An image that is right within a region.
    #[must_use]
    pub fn at(&self, region: Region) -> Cow<'_, RgbImage> {
        let Some(part) = &self.part else { return Cow::Borrowed(&self.image) };
        let (width, height) = self.size();
        let (right, bottom) = ((region.x + region.width).min(width), (region.y + region.height).min(height));
        let has = |range: &std::ops::Range<u32>, from: u32, to: u32| from >= to || (range.start <= from && range.end >= to);
        if has(&part.columns, region.x, right) && has(&part.rows, region.y, bottom) { Cow::Borrowed(&self.image) } else { self.whole() }
    }
}

const EVERYTHING: Part = Part { columns: 0..u32::MAX, rows: 0..u32::MAX };
