//! What a session is made of, beside the robot file.

use super::effect::Effect;
use super::outside::Outside;
use super::truth::Hidden;
use crate::camera::Cameras;
use crate::log::Stamp;
use crate::{Error, Result};

/// What a session is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Everything follows from it.
    pub seed: u64,
    /// Preset of hidden effects.
    pub hidden: Hidden,
    /// More hidden effects.
    pub effects: Vec<Effect>,
    /// Whether recordings hold images, or the tip as a tracker would find it.
    pub images: bool,
    /// Frames per second.
    pub rate_hz: f64,
    /// Standard deviation of a tracked coordinate, where there are no images [px].
    pub noise_px: f64,
    /// Part of the time during which something hides the marker.
    pub hidden_part: f64,
    /// First stamp.
    pub start: Stamp,
    /// Part of their tolerances by which the robot file's and the rig's numbers are off, as a standard deviation; 0 for not at all.
    pub off_nominal: f64,
    /// A cause outside the library of effects.
    pub outside: Option<Outside>,
    /// Cameras as they are believed to be; by default drawn from the seed.
    pub cameras: Option<Cameras>,
    /// Whether the joints have reference encoders: they tell the truth.
    pub joint_encoders: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 7,
            hidden: Hidden::None,
            effects: Vec::new(),
            images: false,
            rate_hz: 15.0,
            noise_px: 0.1,
            hidden_part: 0.03,
            start: Stamp::from_ros(1_750_000_000, 0),
            off_nominal: 0.0,
            outside: None,
            cameras: None,
            joint_encoders: true,
        }
    }
}

impl Options {
    /// Refuses numbers that make no sense.
    ///
    /// # Errors
    /// With the range of the number.
    pub(super) fn check(&self) -> Result<()> {
        if !(1.0..=240.0).contains(&self.rate_hz) {
            return Err(Error::Argument(format!("--rate is {}, expected 1 to 240 frames per second.", self.rate_hz)));
        }
        if !(0.0..=10.0).contains(&self.noise_px) {
            return Err(Error::Argument(format!("--noise is {}, expected 0 to 10 px.", self.noise_px)));
        }
        if !(0.0..=0.9).contains(&self.hidden_part) {
            return Err(Error::Argument(format!("--occluded is {}, expected 0 to 0.9 of the time.", self.hidden_part)));
        }
        if !(0.0..=3.0).contains(&self.off_nominal) {
            return Err(Error::Argument(format!("--off-nominal is {}, expected 0 to 3 tolerances.", self.off_nominal)));
        }
        Ok(())
    }
}
