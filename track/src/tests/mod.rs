//! Tests on rendered images.

mod marker;
mod scene;
