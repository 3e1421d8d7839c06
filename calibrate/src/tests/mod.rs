//! Whole calibrations of simulated cameras, rendered boards, the commands, and real pictures where they are at hand.

mod commands;
mod corners;
mod coverage;
mod exact;
mod halves;
mod hard;
mod marker;
mod real;
mod scene;
mod simulated;
mod validated;
