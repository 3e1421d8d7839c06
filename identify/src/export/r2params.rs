//! The controller's `r2params.yaml` with the calibrated lists added.
//!
//! The public controller reads lists of exactly eight doubles from it, in the order shoulder, elbow, insertion, unused, roll, wrist and
//! the two jaws; an integer among them is a type error that zeroes all gains. `tr_ARM` [rad/rad, rad/m at the insertion] and
//! `max_position_ARM` [rad, m at the insertion] are of that kind, `cable_coupling_ARM` is `[C01, C02, C12]` [rad/rad, m/rad, m/rad].
//! A number that was not identified is the one that stands there already, or else the one that the public controller compiles in. Every
//! other line of the lab's file stays as it is, byte for byte.

use std::collections::BTreeMap;
use std::path::Path;

use raven::robot::{Provenance, nominal};
use raven::{Error, Result, yaml};
use serde_json::Value;

use super::calibration::{Calibration, remarks};
use super::constants::Constants;

/// Ratios of the unused joint, roll, wrist and jaws, which the toolkit does not calibrate: `defines.h` of the public controller.
const TOOL_RATIO: [f64; 5] = [0.0, 5.395_18, 8.991_96, 8.991_96, 8.991_96];
/// Hard stops of the same, 330, 100, 120 and 120 deg: `tools.cpp` of the public controller.
const TOOL_HARD_STOP: [f64; 5] = [0.0, 5.759_586_531_581_287, 1.745_329_251_994_329_5, 2.094_395_102_393_195_3, 2.094_395_102_393_195_3];
/// Part of a number by which rounding may have changed it.
const ROUNDED: f64 = 1e-3;

/// What stands in a parameter file, to compare two of them.
type Parameters = BTreeMap<String, Value>;

/// A number of the robot file, as the controller has it.
struct Number {
    /// Where the robot file has it.
    key: String,
    value: f64,
    /// What the public controller compiles in.
    compiled: f64,
}

/// One of the calibrated lists.
struct List {
    key: String,
    numbers: [Number; 3],
    /// Numbers that follow, as the public controller compiles them in.
    tool: &'static [f64],
}

/// The text of `base`, which was read from `path`, with the calibrated lists in it.
///
/// # Errors
/// If the base is not the YAML of a parameter file with the arm's gains, or a number that was not identified is another one in the robot
/// file than before.
pub fn merge(path: &Path, base: &str, calibration: &Calibration) -> Result<String> {
    let before: Parameters = yaml::parse(path, base)?;
    let is_ours = ["format", "right_from_left"].into_iter().find(|key| before.contains_key(*key));
    if let Some(key) = is_ours {
        let what = if key == "format" { "robot file" } else { "camera file" };
        return Err(Error::file(
            path,
            format!("`{key}` stands in it as in a {what}; --base is the controller's own r2params.yaml, whose gains stay as they are."),
        ));
    }
    let after = &calibration.after;
    let arm = after.arm.name();
    let gains = ["kp", "kd", "ki"].map(|gain| format!("gains_{arm}_{gain}"));
    let missing: Vec<&str> = gains.iter().map(String::as_str).filter(|key| !before.get(*key).is_some_and(Value::is_array)).collect();
    if !missing.is_empty() {
        return Err(Error::file(
            path,
            format!(
                "it lacks {}, lists without which the controller sets all gains to zero; --base is the controller's own r2params.yaml.",
                missing.join(", ")
            ),
        ));
    }
    let newline = if base.contains("\r\n") { "\r\n" } else { "\n" };
    let mut text = base.to_owned();
    let mut expected = before.clone();
    for list in lists(calibration)? {
        let values = list.values(path, &before, calibration)?;
        let line = format!("{}: {}{}{newline}", list.key, yaml::list(&values), list.comment(calibration));
        text = replace(path, &text, &list.key, &line, newline)?;
        expected.insert(list.key, serde_json::json!(values));
    }
    if yaml::parse::<Parameters>(path, &text)? != expected {
        return Err(Error::file(path, "its layout is not one that lists can be put into; write each key at the start of a line."));
    }
    Ok(text)
}

fn lists(calibration: &Calibration) -> Result<[List; 3]> {
    let (after, compiled) = (&calibration.after, Constants::new(&nominal::gold())?);
    let arm = after.arm.name();
    let of_joint = |j: usize, key: &str| format!("joints.{}.{key}", after.joints[j]);
    let ratio = |j: usize| Number { key: of_joint(j, "link_pulley_radius"), value: after.ratio[j], compiled: compiled.ratio[j] };
    let hard_stop = |j: usize| Number { key: of_joint(j, "hard_stop"), value: after.hard_stop[j], compiled: compiled.hard_stop[j] };
    let coupling = |c: usize| Number { key: after.coupling_key(c), value: after.coupling[c], compiled: compiled.coupling[c] };
    Ok([
        List { key: format!("tr_{arm}"), numbers: std::array::from_fn(ratio), tool: &TOOL_RATIO },
        List { key: format!("cable_coupling_{arm}"), numbers: std::array::from_fn(coupling), tool: &[] },
        List { key: format!("max_position_{arm}"), numbers: std::array::from_fn(hard_stop), tool: &TOOL_HARD_STOP },
    ])
}

impl List {
    /// Its numbers where `base`, which was read from `path`, is the file before.
    fn values(&self, path: &Path, base: &Parameters, calibration: &Calibration) -> Result<Vec<f64>> {
        let key = &self.key;
        let before = |i: usize| base.get(key).and_then(|list| list.get(i)?.as_f64());
        let mut values = Vec::new();
        for (i, number) in self.numbers.iter().enumerate() {
            if calibration.finding(&number.key).is_some() {
                values.push(number.value);
                continue;
            }
            let stays = before(i).unwrap_or(number.compiled);
            if (number.value - stays).abs() > ROUNDED * stays.abs() {
                let place = i + 1;
                let (there, advice) = match before(i) {
                    Some(_) => (format!("{key} has {stays} as number {place}"), String::new()),
                    None => (
                        format!("{key} has no number {place}, and the public controller compiles in {stays}"),
                        format!(" If the controller has another {key}, write it into this file."),
                    ),
                };
                let (value, source) = (number.value, &number.key);
                return Err(Error::file(
                    path,
                    format!(
                        "{there}; the robot file makes it {value} with {source}, which was not identified. Put that right, or identify \
                         it.{advice}"
                    ),
                ));
            }
            values.push(stays);
        }
        values.extend(self.tool.iter().enumerate().map(|(i, &tool)| before(self.numbers.len() + i).unwrap_or(tool)));
        Ok(values)
    }

    /// Says at the end of the line what it rests on.
    fn comment(&self, calibration: &Calibration) -> String {
        let found: Vec<&Provenance> = self.numbers.iter().filter_map(|number| calibration.finding(&number.key)).collect();
        if found.is_empty() {
            return "  # as before".to_owned();
        }
        let names: Vec<&str> = found.iter().map(|entry| entry.parameter.as_str()).collect();
        let logs: Vec<&str> = calibration.logs().iter().map(|(name, _)| *name).collect();
        let mut comment = format!("  # {} by raven-identify", names.join(", "));
        if !logs.is_empty() {
            comment += &format!(" from {}", logs.join(", "));
        }
        if found.len() < self.numbers.len() {
            comment += ", the rest as before";
        }
        for remark in remarks(found) {
            comment += &format!("; {remark}");
        }
        comment.replace(['\n', '\r'], " ")
    }
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

    const GAINS: &str = "gains_gold_kp: [1.0]\ngains_gold_kd: [1.0]\ngains_gold_ki: [1.0]\n";

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
            let (before, after, path) = (format!("{GAINS}{}", before.concat()), after.concat(), Path::new("base.yaml"));
            let calibration = calibration();
            prop_assume!(yaml::parse::<Parameters>(path, &format!("{before}{after}x: 1.0\n")).is_ok());
            let old = format!("tr_gold:\n- 1.0\n\n# inside\n- {}\n", yaml::float(calibration.after.ratio[1]));
            let text = merge(path, &format!("{before}{old}{after}x: 1.0\n"), &calibration).unwrap();
            let tail = format!("{after}x: 1.0\n");
            prop_assert!(text.starts_with(&before), "{text}");
            let rest = &text[before.len()..];
            let (line, rest) = rest.split_at(rest.find('\n').unwrap() + 1);
            prop_assert!(line.starts_with("tr_gold: [") && rest.starts_with(&tail), "{text}");
            prop_assert_eq!(rest[tail.len()..].lines().count(), 2);
        }

        #[test]
        fn any_base_is_kept_or_refused(base in "\\PC{0,60}(\n\\PC{0,20}){0,4}") {
            if let Ok(text) = merge(Path::new("base.yaml"), &format!("{GAINS}{base}"), &calibration()) {
                prop_assert!(text.contains("tr_gold: ["));
            }
        }
    }
}
