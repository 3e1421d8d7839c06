//! A C header that overrides what the public controller compiles in (`defines.h`, `fwd_cable_coupling.h`; lengths in millimetres).
//!
//! All arms are compiled from one set of radii: the green arm's ratios are made of them and the other arms' names stand for the green
//! ones. The header therefore gives the calibrated arm its ratios as numbers and keeps the other arms' ratios at what they were.
//!
//! ```text
//! r_l1 = PARTIAL_PULLEY_LINK1_RADIUS = 62.5 + CABLE_RADIUS_1050
//! r_l2 = PARTIAL_PULLEY_LINK2_RADIUS * CAPSTAN_LINK2_LARGE_RADIUS / CAPSTAN_LINK2_SMALL_RADIUS
//! ```

use std::fmt::Write as _;

use raven::robot::ArmSide;
use raven::yaml;

use super::calibration::{Calibration, remarks};
use super::constants::COUPLINGS;

/// `CABLE_RADIUS_1050` [mm], which both pulley radii add by themselves.
const CABLE_RADIUS_MM: f64 = 0.595;
/// `CAPSTAN_LINK2_LARGE_RADIUS / CAPSTAN_LINK2_SMALL_RADIUS`.
const LINK2_CAPSTANS: f64 = 8.415 / 6.195;

/// Names of ratios and hard stops.
const JOINTS: [&str; 3] = ["SHOULDER", "ELBOW", "Z_INS"];

/// The header's text.
#[must_use]
pub fn header(calibration: &Calibration) -> String {
    let mut header = Header { text: opening(calibration) };
    let (before, after) = (&calibration.before, &calibration.after);
    for (j, joint) in JOINTS.into_iter().enumerate() {
        if before.ratio[j] == after.ratio[j] {
            continue;
        }
        header.comment(&format!("r_l{}{}", j + 1, deviation(calibration, &format!("joints.{}.link_pulley_radius", after.joints[j]))));
        if let Some(bare) = bare_radius_mm(j, after.link_radius[j]) {
            let old = bare_radius_mm(j, before.link_radius[j]).map_or_else(String::new, |mm| format!("({mm:.4} + CABLE_RADIUS_1050)"));
            header.define(&format!("PARTIAL_PULLEY_LINK{}_RADIUS", j + 1), &format!("({bare:.6} + CABLE_RADIUS_1050)"), &old);
        }
        let ratio = |value: f64| format!("(float)({})", yaml::float(value));
        header.define(&format!("{joint}_TR_{}_ARM", after.arm.name().to_uppercase()), &ratio(after.ratio[j]), &ratio(before.ratio[j]));
        for (other, maybe) in others(after.arm) {
            header.keep(&format!("{joint}_TR_{other}_ARM"), &ratio(before.ratio[j]), *maybe);
        }
    }
    for (j, joint) in JOINTS.into_iter().enumerate() {
        if before.hard_stop[j] != after.hard_stop[j] {
            header.comment(&format!("offset_{}{}", j + 1, deviation(calibration, &format!("joints.{}.hard_stop", after.joints[j]))));
            let number = |value: f64| format!("({})", yaml::float(value));
            header.define(&format!("{joint}_MAX_ANGLE"), &number(after.hard_stop[j]), &number(before.hard_stop[j]));
        }
    }
    for (c, (from, to)) in COUPLINGS.into_iter().enumerate() {
        if before.coupling[c] != after.coupling[c] {
            header.comment(&format!("coupling_{}{}{}", from + 1, to + 1, deviation(calibration, &after.coupling_key(c))));
            let number = |value: f64| format!("(float)({})", yaml::float(value));
            header.define(&format!("CABLE_COUPLING_{from}{to}"), &number(after.coupling[c]), &number(before.coupling[c]));
        }
    }
    header.text
}

/// The part of a pulley radius [mm] that stands in the source before the cable is added; nothing for the insertion, which has none.
fn bare_radius_mm(joint: usize, link_radius: f64) -> Option<f64> {
    match joint {
        0 => Some(link_radius * 1e3 - CABLE_RADIUS_MM),
        1 => Some(link_radius * 1e3 / LINK2_CAPSTANS - CABLE_RADIUS_MM),
        _ => None,
    }
}

/// The other arms, and whether only some controllers have them.
fn others(arm: ArmSide) -> &'static [(&'static str, bool)] {
    match arm {
        // Blue and orange stand for green.
        ArmSide::Gold => &[("GREEN", false)],
        ArmSide::Green => &[("GOLD", false), ("BLUE", true), ("ORANGE", true)],
    }
}

fn opening(calibration: &Calibration) -> String {
    let mut text = format!(
        "/* Calibrated constants of the Raven-II's {} arm, by raven-identify. Lengths in mm, angles in rad, insertion in m.\n *\n \
         * Include this file last in include/raven/defines.h, before its #endif, and take the CABLE_COUPLING lines that it\n \
         * replaces out of include/raven/fwd_cable_coupling.h; then compile. Hard stops and couplings are shared by all arms,\n \
         * ratios are not.\n *\n * Logs:\n",
        calibration.after.arm.name()
    );
    for (name, sha256) in calibration.logs() {
        let _ = writeln!(text, "{}", format!(" *   {} {sha256}", name.replace("*/", "* /")).trim_end());
    }
    for remark in remarks(&calibration.identified) {
        let _ = writeln!(text, " * {}", remark.replace("*/", "* /"));
    }
    text.push_str(" */\n\n#ifndef CABLE_RADIUS_1050\n#define CABLE_RADIUS_1050 (1.19 / 2.0)\n#endif\n");
    text
}

/// Value and deviation of the finding at a key, as a comment goes on.
fn deviation(calibration: &Calibration, key: &str) -> String {
    calibration.finding(key).map_or_else(String::new, |e| format!(": {} +- {} {}", e.value, e.std, e.unit))
}

struct Header {
    text: String,
}

impl Header {
    fn comment(&mut self, comment: &str) {
        let _ = write!(self.text, "\n/* {} */\n", comment.replace("*/", "* /"));
    }

    fn define(&mut self, name: &str, value: &str, old: &str) {
        let _ = write!(self.text, "/* was {name} {old} */\n#undef {name}\n#define {name} {value}\n");
    }

    fn keep(&mut self, name: &str, value: &str, only_if_there: bool) {
        let (open, close) = if only_if_there { (format!("#ifdef {name}\n"), "#endif\n") } else { (String::new(), "") };
        let _ = write!(self.text, "/* stays as it was */\n{open}#undef {name}\n#define {name} {value}\n{close}");
    }
}
