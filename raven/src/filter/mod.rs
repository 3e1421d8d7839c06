//! Square-root filters: the array unscented Kalman filter and the state equations that it runs on.

mod array;
mod run;
mod srukf;
mod states;

pub use run::{FilterRun, TipAt, run};
pub use srukf::{Innovation, SquareRootUkf};
pub use states::{BiasStates, PaperStates, StateEquation};

#[cfg(test)]
mod tests;
