//! The nominal robot that ships with the project.

use super::Robot;

/// Text of the nominal file: `raven/robots/raven2-gold.yaml`.
pub const GOLD_YAML: &str = include_str!("../../robots/raven2-gold.yaml");

/// The nominal Raven-II, gold arm.
///
/// # Panics
/// Never: the file is part of the program, and a test reads it.
#[must_use]
pub fn gold() -> Robot {
    Robot::parse(std::path::Path::new("raven2-gold.yaml"), GOLD_YAML).expect("the shipped robot file is valid")
}
