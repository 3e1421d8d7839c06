//! The library under raven-cal's programs.
//!
//! The Raven-II's encoders sit on the motors; cables, pulleys and friction lie between them and the joints. This crate holds what every
//! program needs to look at that gap: logs, the robot's model, cameras, a simulator, filters and reports. Frames, units and symbols
//! are fixed in `docs/conventions.md`.

pub mod camera;
pub mod cli;
pub mod effects;
pub mod error;
pub mod files;
pub mod filter;
pub mod interrupted;
pub mod log;
pub mod observation;
pub mod plot;
pub mod robot;
pub mod simulation;
pub mod stats;
pub mod yaml;

pub use error::{Error, Result};
