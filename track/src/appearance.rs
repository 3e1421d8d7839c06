//! What the marker looks like, as the command lines of tracking and registration take it.

use std::ops::RangeInclusive;

use clap::Args;

use crate::colour::MarkerColour;
use crate::look::Marker;
use crate::marker::Centre;

/// Radius of a laparoscopic instrument of 5 mm [m].
pub const SHAFT_RADIUS_M: f64 = 0.0025;

/// Colour and size of the marker, and what it sits on.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct Appearance {
    /// Hue of the marker [deg]: 90..150 is green, 340..20 red.
    #[arg(long, value_name = "FROM..TO", default_value = "90..150", value_parser = hue)]
    pub hue: [f64; 2],
    /// Least saturation of the marker, 0 to 1.
    #[arg(long, value_name = "S", default_value_t = MarkerColour::default().min_saturation, value_parser = share, allow_negative_numbers = true)]
    pub min_saturation: f64,
    /// Least brightness of the marker, 0 to 1.
    #[arg(long, value_name = "V", default_value_t = MarkerColour::default().min_value, value_parser = share, allow_negative_numbers = true)]
    pub min_value: f64,
    /// The marker's size.
    #[command(flatten)]
    pub size: Size,
    /// Radius of the shaft that the marker sits on, which hides a part of its edge [m]; 0 without one.
    #[arg(long = "shaft-radius", value_name = "M", default_value_t = SHAFT_RADIUS_M, value_parser = shaft_radius, allow_negative_numbers = true)]
    pub shaft_radius_m: f64,
}

/// Size of the marker.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub struct Size {
    /// Radius of the marker [m].
    #[arg(long = "marker-radius", value_name = "M", default_value_t = 0.005, value_parser = radius, allow_negative_numbers = true)]
    pub marker_radius_m: f64,
}

impl Appearance {
    /// A marker that looks like this.
    #[must_use]
    pub const fn marker(&self, centre: Centre) -> Marker {
        let colour = MarkerColour { hue_deg: self.hue, min_saturation: self.min_saturation, min_value: self.min_value };
        Marker { colour, radius_m: self.size.marker_radius_m, shaft_radius_m: self.shaft_radius_m, centre }
    }

    /// As it is typed, for advice.
    #[must_use]
    pub fn options(&self) -> String {
        let Self { hue: [from, to], min_saturation, min_value, size: Size { marker_radius_m }, shaft_radius_m } = self;
        let shaft = if *shaft_radius_m == SHAFT_RADIUS_M { String::new() } else { format!(" --shaft-radius {shaft_radius_m}") };
        format!("--hue {from}..{to} --min-saturation {min_saturation} --min-value {min_value} --marker-radius {marker_radius_m}{shaft}")
    }
}

/// A number on the command line within a range; `what` is its unit and what may be wrong with it.
///
/// # Errors
/// A sentence with the text, or with the range.
pub fn number(text: &str, range: RangeInclusive<f64>, what: &str) -> Result<f64, String> {
    let value: f64 = text.trim().parse().map_err(|_| format!("`{text}` is no number"))?;
    if range.contains(&value) { Ok(value) } else { Err(format!("{value} is not between {} and {} {what}", range.start(), range.end())) }
}

fn hue(text: &str) -> Result<[f64; 2], String> {
    let (from, to) = text.split_once("..").ok_or_else(|| format!("`{text}` is no range of degrees such as 90..150"))?;
    Ok([number(from, 0.0..=360.0, "deg")?, number(to, 0.0..=360.0, "deg")?])
}

fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1.0, "")
}

fn radius(text: &str) -> Result<f64, String> {
    number(text, 5e-4..=0.1, "m; is it in millimetres?")
}

fn shaft_radius(text: &str) -> Result<f64, String> {
    number(text, 0.0..=0.1, "m; is it in millimetres?")
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        appearance: Appearance,
    }

    #[test]
    fn what_is_typed_is_what_is_looked_for_and_can_be_typed_again() {
        let typed = [
            "x",
            "--hue",
            "340..20",
            "--min-saturation",
            "0.3",
            "--min-value",
            "0.05",
            "--marker-radius",
            "0.004",
            "--shaft-radius",
            "0.004",
        ];
        let line = Line::try_parse_from(typed).unwrap().appearance;
        let marker = line.marker(Centre::Ball);
        assert_eq!(marker.colour, MarkerColour { hue_deg: [340.0, 20.0], min_saturation: 0.3, min_value: 0.05 });
        assert_eq!((line.options(), marker.radius_m, marker.shaft_radius_m), (typed[1..].join(" "), 0.004, 0.004));
        let usual = Line::try_parse_from(&typed[..9]).unwrap().appearance;
        assert_eq!((usual.options(), usual.shaft_radius_m), (typed[1..9].join(" "), SHAFT_RADIUS_M));
        assert_eq!(Line::try_parse_from(["x"]).unwrap().appearance.marker(Centre::Ball).colour, MarkerColour::default());
        for (wrong, sentence) in [
            ("--marker-radius=5", "millimetres"),
            ("--shaft-radius=-0.1", "millimetres"),
            ("--hue=green", "no range of degrees"),
            ("--min-value=2", "between 0 and 1"),
        ] {
            let refused = Line::try_parse_from(["x", wrong]).unwrap_err().to_string();
            assert!(refused.contains(sentence), "{refused}");
        }
    }
}
