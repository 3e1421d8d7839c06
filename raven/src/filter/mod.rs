//! Square-root filters: the array unscented Kalman filter and the state equations that it runs on.

mod array;
pub mod consistency;
mod persistence;
mod run;
mod shared;
mod smoother;
mod srukf;
mod states;
mod tune;
mod wander;

pub use persistence::Persistence;
pub use run::{FilterRun, JointTrack, KNOT_S, TipAt, run};
pub use smoother::{Smoothed, smooth};
pub use srukf::{Innovation, SmootherStep, SquareRootUkf};
pub use states::{BIAS_STATES, BiasStates, Friction, PaperStates, StateEquation, Tuning, Turned};
pub use wander::{Wander, travel};

#[cfg(test)]
mod tests;
