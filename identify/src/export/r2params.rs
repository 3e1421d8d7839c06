//! The controller's `r2params.yaml` with the calibrated lists added.
//!
//! The public controller reads lists of exactly eight doubles from it, in the order shoulder, elbow, insertion, unused, roll, wrist and
//! the two jaws; an integer among them is a type error that zeroes all gains. `tr_ARM` [rad/rad, rad/m at the insertion] and
//! `max_position_ARM` [rad, m at the insertion] are of that kind, `cable_coupling_ARM` is `[C01, C02, C12]` [rad/rad, m/rad, m/rad].
//! Every other line of the lab's file stays as it is, byte for byte.

use std::collections::BTreeMap;
use std::path::Path;

use raven::files::{parse_yaml, yaml_list};
use raven::{Error, Result};

use super::calibration::Calibration;

/// Ratios of roll, wrist and jaws, which the toolkit does not calibrate: `defines.h` of the public controller.
const TOOL_RATIO: [f64; 4] = [5.395_18, 8.991_96, 8.991_96, 8.991_96];
/// Hard stops of roll, wrist and jaws, 330, 100, 120 and 120 deg: `tools.cpp` of the public controller.
const TOOL_HARD_STOP: [f64; 4] = [5.759_586_531_581_287, 1.745_329_251_994_329_5, 2.094_395_102_393_195_3, 2.094_395_102_393_195_3];

/// What stands in a parameter file, to compare two of them.
type Parameters = BTreeMap<String, serde_json::Value>;

/// The text of `base`, which was read from `path`, with the calibrated lists in it.
///
/// # Errors
/// If the base is not the YAML of a parameter file.
pub fn merge(path: &Path, base: &str, calibration: &Calibration) -> Result<String> {
    let before: Parameters = parse_yaml(path, base)?;
    let is_ours = ["format", "right_from_left"].into_iter().find(|key| before.contains_key(*key));
    if let Some(key) = is_ours {
        let what = if key == "format" { "robot file" } else { "camera file" };
        return Err(Error::file(
            path,
            format!("`{key}` stands in it as in a {what}; --base is the controller's own r2params.yaml, whose gains stay as they are."),
        ));
    }
    let after = &calibration.after;
    let arm = after.arm_name();
    let eight = |first: [f64; 3], tool: [f64; 4]| [&first[..], &[0.0], &tool[..]].concat();
    let lists = [
        (format!("tr_{arm}"), eight(after.ratio, TOOL_RATIO), ".link_pulley_radius"),
        (format!("cable_coupling_{arm}"), after.coupling.to_vec(), "cable_coupling."),
        (format!("max_position_{arm}"), eight(after.hard_stop, TOOL_HARD_STOP), ".hard_stop"),
    ];
    let newline = if base.contains("\r\n") { "\r\n" } else { "\n" };
    let mut text = base.to_owned();
    for (key, values, part) in &lists {
        let line = format!("{key}: {}{}{newline}", yaml_list(values), comment(calibration, part));
        text = replace(path, &text, key, &line, newline)?;
    }
    let mut expected = before;
    for (key, values, _) in &lists {
        expected.insert(key.clone(), serde_json::json!(values));
    }
    if parse_yaml::<Parameters>(path, &text)? != expected {
        return Err(Error::file(path, "its layout is not one that lists can be put into; write each key at the start of a line."));
    }
    Ok(text)
}

/// Says at the end of a line what it rests on.
fn comment(calibration: &Calibration, part: &str) -> String {
    let names: Vec<&str> = calibration.identified.iter().filter(|e| e.key.contains(part)).map(|e| e.parameter.as_str()).collect();
    if names.is_empty() {
        return "  # as before".to_owned();
    }
    let logs: Vec<&str> = calibration.logs().iter().map(|(name, _)| *name).collect();
    format!("  # {} by raven-identify from {}", names.join(", "), logs.join(", ").replace(['\n', '\r'], " "))
}

/// Puts `line` where the top-level `key` stands, or at the end.
fn replace(path: &Path, text: &str, key: &str, line: &str, newline: &str) -> Result<String> {
    let lines: Vec<&str> = text.split_inclusive('\n').collect();
    let mut places = (0..lines.len()).filter(|&i| is_key(lines[i], key));
    let Some(start) = places.next() else {
        let ending = if text.is_empty() || text.ends_with('\n') { "" } else { newline };
        return Ok(format!("{text}{ending}{line}"));
    };
    if let Some(again) = places.next() {
        return Err(Error::file(path, format!("{key} stands in lines {} and {}; leave one of them.", start + 1, again + 1)));
    }
    let mut end = start + 1;
    for (i, next) in lines.iter().enumerate().skip(start + 1) {
        let content = next.trim_end();
        if content.starts_with([' ', '\t', '-', ']']) && !content.trim_start().is_empty() && !content.starts_with("---") {
            // Comments indented below the list belong to it, those at the margin only if the list goes on.
            end = i + 1;
        } else if !(content.is_empty() || content.starts_with('#')) {
            break;
        }
    }
    Ok([&lines[..start].concat(), line, &lines[end..].concat()].concat())
}

/// Whether a line begins with a top-level key.
fn is_key(line: &str, key: &str) -> bool {
    [key.to_owned(), format!("\"{key}\""), format!("'{key}'")]
        .iter()
        .any(|key| line.strip_prefix(key.as_str()).is_some_and(|rest| rest.trim_start().starts_with(':')))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use raven::robot::{Provenance, nominal};

    fn calibration() -> Calibration {
        let mut robot = nominal::gold();
        robot.joints[0].link_pulley_radius = 0.059;
        robot.calibration.push(Provenance {
            parameter: "r_l1".to_owned(),
            key: "joints.shoulder.link_pulley_radius".to_owned(),
            unit: "m".to_owned(),
            value: 0.059,
            std: 1e-5,
            prior: 0.063095,
            prior_std: 0.0063,
            identified: true,
            method: "batch".to_owned(),
            logs: vec!["a\nb.mcap".to_owned()],
            sha256: vec![String::new()],
        });
        Calibration::new(Path::new("identified.yaml"), &robot).unwrap()
    }

    fn chunk() -> impl Strategy<Value = String> {
        prop_oneof![
            Just("# a comment\n".to_owned()),
            Just("\n".to_owned()),
            "[a-f]{1,8}: [0-9]\\.[0-9]\n".prop_map(|line| format!("x{line}")),
            "y[a-f]{1,8}:\n- 0\\.[0-9]\n# between\n\n- 1\\.5 # after\n",
            "z[a-f]{1,8}: \\[1\\.0,\n  2\\.0]\n",
        ]
    }

    proptest! {
        #[test]
        fn all_but_the_calibrated_lists_stays(before in prop::collection::vec(chunk(), 0..6), after in prop::collection::vec(chunk(), 0..6)) {
            let (before, after, path) = (before.concat(), after.concat(), Path::new("base.yaml"));
            prop_assume!(parse_yaml::<Parameters>(path, &format!("{before}{after}x: 1.0\n")).is_ok());
            let old = "tr_gold:\n- 1.0\n\n# inside\n- 2.0\n";
            let text = merge(path, &format!("{before}{old}{after}x: 1.0\n"), &calibration()).unwrap();
            let tail = format!("{after}x: 1.0\n");
            prop_assert!(text.starts_with(&before), "{text}");
            let rest = &text[before.len()..];
            let (line, rest) = rest.split_at(rest.find('\n').unwrap() + 1);
            prop_assert!(line.starts_with("tr_gold: [") && rest.starts_with(&tail), "{text}");
            prop_assert_eq!(rest[tail.len()..].lines().count(), 2);
        }

        #[test]
        fn any_base_is_kept_or_refused(base in "\\PC{0,60}(\n\\PC{0,20}){0,4}") {
            if let Ok(text) = merge(Path::new("base.yaml"), &base, &calibration()) {
                prop_assert!(text.contains("tr_gold: ["));
            }
        }
    }
}
