//! Tracks the coloured marker on the tool in both cameras and triangulates the tip.

pub mod centre;
pub mod colour;
pub mod marker;
pub mod mask;
pub mod patch;

#[cfg(test)]
mod tests;
