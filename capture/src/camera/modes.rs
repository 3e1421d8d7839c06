//! The modes that a camera offers.

use std::fmt;

use serde::Serialize;

/// One layout and size, with the rates it comes at.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OfferedMode {
    /// V4L2's four characters.
    pub encoding: String,
    /// Columns and rows (px).
    pub size_px: [u32; 2],
    /// Frames per second.
    pub rates_hz: Vec<f64>,
}

impl fmt::Display for OfferedMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size_px;
        let rates: Vec<String> = self.rates_hz.iter().map(|rate_hz| ((rate_hz * 100.0).round() / 100.0).to_string()).collect();
        write!(f, "{} {width}x{height} at {} frames/s", self.encoding, rates.join(", "))
    }
}
