//! Which effect causes the gap: hypotheses compared by their evidence.

pub mod coordinates;
pub mod data;
pub mod linear;
pub mod rows;
pub mod search;
