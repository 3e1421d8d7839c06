//! Numbers on the command line, and what is said of one that makes no sense.

use std::fmt::Display;
use std::ops::RangeInclusive;

/// A number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    number(text, |number| number > 0.0, "above 0")
}

/// A number of 0 or more.
pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |number| number >= 0.0, "from 0 on")
}

/// A number within these ends, or one of them.
pub(crate) fn within(range: &RangeInclusive<f64>, text: &str) -> Result<f64, String> {
    number(text, |number| range.contains(&number), format_args!("from {} to {}", range.start(), range.end()))
}

fn number(text: &str, fits: impl Fn(f64) -> bool, expected: impl Display) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && fits(*number));
    number.ok_or_else(|| format!("expected a number {expected}"))
}
