//! YAML as the project's files have it: read strictly, with errors that say where, and written so that YAML 1.1 readers see floats.

use std::path::Path;

use serde_path_to_error::Segment;

use crate::{Error, Result};

/// Reads YAML that was read from `path`.
///
/// # Errors
/// With line, column, the key and what stands there, if the text is not YAML or not of the type asked for.
pub fn parse<T: serde::de::DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    let mut key = None;
    let read = serde_saphyr::with_deserializer_from_str(text, |deserializer| {
        serde_path_to_error::deserialize(deserializer).map_err(|error| {
            key = Some(error.path().clone());
            error.into_inner()
        })
    });
    read.map_err(|error| {
        let all = error.without_snippet().to_string();
        let mut sentence = all.lines().next().unwrap_or_default().to_owned();
        let mut place = String::new();
        if let Some(location) = error.location() {
            let (line, column) = (location.line(), location.column());
            place = format!("line {line}, column {column}: ");
            sentence.truncate(sentence.trim_end_matches(&format!(" at line {line}, column {column}")).len());
            // As in `invalid floating point`, which says no more.
            let says_kind_alone = sentence.starts_with("invalid ") && !sentence.contains([':', ',']);
            let there = value_at(text, line, column).filter(|_| says_kind_alone);
            sentence += &there.map_or_else(String::new, |there| format!(": `{there}`"));
        }
        // Where the text itself is at fault there is no key, and within the whole file none that says more than the place.
        let key = key.filter(|key| key.iter().all(|segment| !matches!(segment, Segment::Unknown)) && key.iter().next().is_some());
        let key = key.map_or_else(String::new, |key| format!("{key}: "));
        Error::file(path, format!("{place}{key}{}.", sentence.trim_end_matches('.')))
    })
}

/// The scalar that begins at a place of a YAML text, both counted from 1.
fn value_at(text: &str, line: u64, column: u64) -> Option<&str> {
    let line = text.lines().nth(usize::try_from(line).ok()?.checked_sub(1)?)?;
    let (start, _) = line.char_indices().nth(usize::try_from(column).ok()?.checked_sub(1)?)?;
    let value = line[start..].split([',', ']', '}', '#']).next()?.trim_end();
    (!value.is_empty()).then_some(value)
}

/// A number as every YAML 1.1 reader takes for a float: with a decimal point and no exponent, `720000.0`, never `7.2e5` or `0`.
#[must_use]
pub fn float(value: f64) -> String {
    if value.is_nan() {
        return ".nan".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { ".inf" } else { "-.inf" }.to_owned();
    }
    let text = value.to_string();
    if text.contains('.') { text } else { text + ".0" }
}

/// A flow sequence of [`float`]s.
#[must_use]
pub fn list(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|&v| float(v)).collect::<Vec<_>>().join(", "))
}

/// A string as a YAML scalar, quoted where plain text could be read as something else.
#[must_use]
pub fn string(text: &str) -> String {
    let plain = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '/')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c))
        && !["true", "false", "yes", "no", "on", "off", "null", "y", "n"].contains(&text.to_ascii_lowercase().as_str());
    if plain { text.to_owned() } else { serde_json::Value::from(text).to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Robot, nominal};

    /// What is said of the nominal robot file with one of its lines changed.
    fn said(line: &str, changed: &str) -> String {
        assert!(nominal::GOLD_YAML.contains(line), "{line}");
        let error = Robot::parse(Path::new("robot.yaml"), &nominal::GOLD_YAML.replacen(line, changed, 1)).unwrap_err();
        error.to_string()
    }

    #[test]
    fn an_error_says_place_key_and_value() {
        let cases = [
            (
                "link_pulley_radius: 63.095e-3",
                "link_pulley_radius: 63 mm",
                "column 25: joints[0].link_pulley_radius: invalid floating point: `63 mm`.",
            ),
            ("arm: gold ", "arm: golden", "column 8: kinematics.arm: unknown variant `golden`, expected one of gold, green."),
            ("link_angle_12:", "link_angle_12: [1] #", "column 18: kinematics.link_angle_12: expected string scalar."),
            ("  wrist_offset:", "  # wrist_offset:", "column 3: kinematics: missing field `wrist_offset`."),
            ("hard_stop: 0.0\n", "hardstop: 0.0\n", "joints[0].hardstop: unknown field `hardstop`, expected one of name,"),
            ("name: raven2-gold\n", "", "column 1: missing field `name`."),
            ("name: raven2-gold\n", "name: a: b\n", "column 8: mapping values are not allowed in this context."),
        ];
        for (line, changed, expected) in cases {
            let said = said(line, changed);
            assert!(said.starts_with("robot.yaml: line ") && said.contains(expected), "{said}");
            assert_eq!(said.matches("line ").count(), 1, "{said}");
        }
    }

    #[test]
    fn a_key_of_a_bench_that_nobody_knows_is_refused() {
        let said = said("kind: raven ", "kind: bench\n  x: 1 ");
        assert!(said.contains("kinematics.x: unknown field `x`"), "{said}");
    }

    #[test]
    fn readers_of_yaml_1_1_see_floats_and_strings() {
        assert_eq!([720_000.0, 1e-9, 0.0, f64::NAN].map(float), ["720000.0", "0.000000001", "0.0", ".nan"]);
        assert_eq!(["shoulder", "no", "0x10", "a b"].map(string), ["shoulder", "\"no\"", "\"0x10\"", "\"a b\""]);
    }
}
