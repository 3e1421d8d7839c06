//! The virtual lab: a Raven-II with hidden effects, two webcams, and the logs that such a session leaves.
//!
//! The plant shares nothing with the models that the estimators fit but the numbers of the robot file: it has its own equations for
//! motors, cables and friction, its own integrator and its own cameras in time. Everything follows from one seed.

mod cable;
mod controller;
mod effect;
mod film;
mod folder;
mod friction;
mod listed;
mod lot;
mod machine;
mod motion;
mod off_nominal;
mod options;
mod outside;
mod plant;
mod render;
mod rig;
mod session;
mod shutter;
mod sizes;
mod state;
mod tip;
mod trace;
mod truth;

pub use controller::{CYCLE_S, Controller, Cycle, SetPoint};
pub use effect::{Effect, EffectKind, Scope, Value};
pub use folder::{CAMERAS, LABELS, LABELS_SUM, Label, LabelEffect, Labels, Magnitude, SealedFolder};
pub use lot::{Case, Lot, sealed_set};
pub use machine::{Drive, Load, Machine};
pub use motion::{Limits, Motion, Sinusoid, Trajectory, minimum_jerk, multisine_hz};
pub use off_nominal::{SEALED_FACTOR, deviations};
pub use options::Options;
pub use outside::{Bulge, Bump, Contact, Outside, Sway, Wander};
pub use plant::{Plant, PlantState, STEP_S};
pub use render::{Board, Canvas, Renderer, Sensor, Tool};
pub use rig::Rig;
pub use session::{BOARD, Session, Written};
pub use shutter::Delays;
pub use sizes::{draw_effect, places};
pub use trace::{Recorder, Sample, Trace};
pub use truth::{Hidden, MARKER_RADIUS_M, Truth};

#[cfg(test)]
mod tests;
