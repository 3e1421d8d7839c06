//! What recordings say against a model, whitened.

pub mod bench;
pub mod data;
pub(crate) mod noise;
pub mod rows;
pub mod settings;
mod tensions;
pub mod torques;
