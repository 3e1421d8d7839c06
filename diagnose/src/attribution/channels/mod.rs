//! What a hypothesis leaves of every channel, sample by sample, in the channel's own unit: measured less modelled.

mod arm;
mod bench;
#[cfg(test)]
mod tests;

use raven::Result;
use raven::effects::Channel;

use crate::evidence::recorded::rows::Observed;
use crate::evidence::recorded::settings::Setting;

/// One quantity that was measured.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measured {
    /// Joint, `tip`, or a joint's torque or force.
    pub name: String,
    /// Unit of reports.
    pub unit: &'static str,
    /// Takes errors to `unit`.
    pub scale: f64,
    /// Which side of the drive it shows.
    pub side: Channel,
    /// Whether its errors have a sign; those of the tip are distances.
    pub signed: bool,
}

/// One sample of one quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Which of [`Sampled::measured`].
    pub channel: usize,
    /// Recording.
    pub recording: usize,
    /// Time in the recording [s].
    pub time_s: f64,
    /// Measured less modelled; NaN where the model has nothing.
    pub error: f64,
    /// Variance of the measurement's noise; of a torque, the white part of its errors.
    pub variance: f64,
    /// Speed of the joint [rad/s or m/s]; 0 for the tip.
    pub rate: f64,
}

/// Recordings channel by channel.
pub(super) trait Sampled: Observed {
    /// What was measured, recorded or not.
    fn measured(&self) -> Vec<Measured>;

    /// All samples that say something, with effects in the model: the same ones in the same order whatever the effects.
    ///
    /// # Errors
    /// If the robot does not fit the recordings.
    fn samples(&self, settings: &[Setting]) -> Result<Vec<Sample>>;

    /// The recordings as they count where these effects are there, if that makes a difference.
    ///
    /// # Errors
    /// If the robot does not fit the recordings.
    fn reweighted(&self, _settings: &[Setting]) -> Result<Option<Box<dyn Sampled + '_>>> {
        Ok(None)
    }

    /// The recordings with those times alone counting that `keep` takes [s].
    fn only(&self, keep: &dyn Fn(f64) -> bool) -> Box<dyn Observed + '_>;
}
