//! Which effects, by evidence: a hypothesis is the nominal model, each of its numbers off by its tolerance, with none to three effects on top.
//!
//! # Where what is
//! - [`recorded`]: what recordings say against a model. [`recorded::data`] and [`recorded::rows`] are of an arm, [`recorded::bench`] of a bench;
//!   [`recorded::torques`] weighs torque, and `tensions` remembers what hypotheses have in common.
//! - [`numbers`]: what may be off, and how far: [`numbers::coordinates`], with what is believed beforehand in [`numbers::sizes`] and
//!   [`numbers::prior`], and by other recordings of the rig in [`numbers::spread`].
//! - [`fit`]: one hypothesis, fitted. It steps down (`descent`) by `slopes`; [`fit::linear`] has its Laplace evidence.
//! - [`search`]: over hypotheses. It adds effects that [`search::screen`] proposes, from `starts` and `points`, and `refit` fits. Fits that stopped
//!   short are begun again: `lost`, `resized`, `close`, `again`. What could stand in is held against what was found: [`search::tied`], `rivals`.
//!   [`search::told`] is a fit that knows the effects.
//! - [`weighing`]: which of two hypotheses is better, by what they leave ([`weighing::leftover`]), by blocks of time (`paired`), and whether a size is
//!   beyond its scatter (`beyond`, [`weighing::clustered`]).
//! - [`outcome`]: what a search comes to.
//! - [`left`]: what the motion before recordings left of effects that the file has.
//!
//! # Words
//! - `u`: a number's departure from the nominal model in units of its effect's prior, the slab. A number of the nominal model has a narrower one, the
//!   spike: its tolerance in the same units.
//! - Nat: unit of the natural logarithm of evidence, and of cost, half a sum of squares.
//! - Links are settled, at rest at every instant, or rolled out through their equations of motion, which takes fifty times as long.
//! - Slopes: derivatives of whitened residuals by `u`; one coordinate's are a column.
//! - A fit is close if its slopes are of rolled-out links throughout, and lost if a hypothesis that it contains is nearer to the recordings.
//! - Tempered: with what the best hypothesis leaves counting as noise.

pub mod fit;
pub mod left;
pub mod numbers;
pub mod outcome;
pub mod recorded;
pub mod search;
pub mod weighing;

#[cfg(test)]
pub(crate) mod tests;
