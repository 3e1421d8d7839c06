//! Which effects, by evidence.

mod again;
pub mod bench;
mod beyond;
mod close;
pub mod clustered;
pub mod coordinates;
pub mod data;
mod descent;
pub mod fit;
pub mod leftover;
pub mod linear;
mod lost;
pub mod outcome;
mod paired;
mod points;
pub mod prior;
mod refit;
mod resized;
mod rivals;
pub mod rows;
pub mod screen;
pub mod search;
pub mod sizes;
mod slopes;
pub mod spread;
mod starts;
mod tensions;
pub mod tied;
pub mod told;
pub mod torques;
mod weighing;

#[cfg(test)]
pub(crate) mod tests;
