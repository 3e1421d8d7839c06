//! Which effects, by evidence: a hypothesis is the nominal model, each of its numbers off by its tolerance, with none to three effects on top.
//!
//! # Where what is
//! - What recordings say against a model: [`data`] and [`rows`] of an arm, [`bench`] of a bench; [`torques`] weighs torque, and `tensions` remembers
//!   what hypotheses have in common.
//! - What may be off, and how far: [`coordinates`], with what is believed beforehand in [`sizes`] and [`prior`], and by other recordings of the
//!   rig in [`spread`].
//! - The fit of one hypothesis: [`fit`] steps down (`descent`) by `slopes`, from `starts` and `points`; [`linear`] has its Laplace evidence.
//! - The search over hypotheses: [`search`] adds effects that [`screen`] proposes and `refit` fits. Fits that stopped short are begun again: `lost`,
//!   `resized`, `close`, `again`. What could stand in is held against what was found: [`tied`], `rivals`. [`told`] is a fit that knows the effects.
//! - What counts: `weighing` says which of two hypotheses is better, by what they leave ([`leftover`]), by blocks of time (`paired`), and whether
//!   a size is beyond its scatter (`beyond`, [`clustered`]). [`outcome`] is what a search comes to.
//!
//! # Words
//! - `u`: a number's departure from the nominal model in units of its effect's prior, the slab. A number of the nominal model has a narrower one, the
//!   spike: its tolerance in the same units.
//! - Nat: unit of the natural logarithm of evidence, and of cost, half a sum of squares.
//! - Links are settled, at rest at every instant, or rolled out through their equations of motion, which takes fifty times as long.
//! - Slopes: derivatives of whitened residuals by `u`; one coordinate's are a column.
//! - A fit is close if its slopes are of rolled-out links throughout, and lost if a hypothesis that it contains is nearer to the recordings.
//! - Tempered: with what the best hypothesis leaves counting as noise.

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
