//! Whole calibrations of simulated cameras, rendered boards, the commands, and real pictures where they are at hand.

mod align;
mod anywhere;
mod apart;
mod commands;
mod corners;
mod coverage;
mod exact;
mod from_motion;
mod halves;
mod hard;
mod incomplete;
mod marker;
mod real;
mod scene;
mod simulated;
mod validated;

use image::GrayImage;

use crate::board::BoardSize;
use crate::corners::{Sighting, search};

/// The board in an image.
fn find(image: &GrayImage, size: BoardSize) -> Option<Sighting> {
    search(image, size).0
}
