//! Tests on rendered images.

mod exact;
mod marker;
mod opencv;
mod precision;
mod recordings;
mod scene;
mod shaft;
