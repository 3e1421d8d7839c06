//! Identifies kinematic and cable parameters from recordings, and exports them for the controller.

pub mod batch;
pub mod motion;
pub mod parameters;
pub mod prediction;
pub mod priors;
pub mod session;
