//! What recordings say against a model, whitened.

pub mod bench;
pub mod data;
pub(crate) mod noise;
pub mod rows;
mod tensions;
pub mod torques;
