//! What may be off, how far, and what is believed of it before a recording is looked at.

pub mod coordinates;
pub mod prior;
pub mod sizes;
pub mod spread;
