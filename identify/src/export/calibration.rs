//! What may leave the house: the constants before and after, and what each change rests on.

use std::path::Path;

use raven::robot::{Provenance, Robot};
use raven::{Error, Result};

use super::constants::{COUPLINGS, Constants};
use crate::args::Format;
use crate::identified::{is_determined, left, remark};
use crate::parameters;

/// How far a pulley may be from its drawing: cable and groove wear give a few per cent, another robot's pulley more.
const RADIUS_OFF: f64 = 0.15;
/// How far hard stops may be from the believed ones [rad, rad, m]; two arms of one lab differed by 6.75 deg.
const HARD_STOP_OFF: [f64; 3] = [0.262, 0.262, 0.03];
/// How far couplings may be from the computed ones [rad/rad, m/rad, m/rad].
const COUPLING_OFF: [f64; 3] = [0.15, 0.03, 0.03];

/// The controller's constants before and after, and where the changes come from.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// What the controller has.
    pub before: Constants,
    /// What it should have.
    pub after: Constants,
    /// The numbers that logs determined, by the newest finding of each.
    pub identified: Vec<Provenance>,
    /// Those that were looked for and stay as they were.
    undetermined: Vec<String>,
}

impl Calibration {
    /// Of the robot file at `path`.
    ///
    /// # Errors
    /// If nothing was identified, a number changed without having been, a deviation is none, or a number is not one the hardware can have.
    pub fn new(path: &Path, robot: &Robot) -> Result<Self> {
        let refuse = |message: String| Err(Error::file(path, message));
        let mut file = robot.clone();
        let mut identified: Vec<Provenance> = Vec::new();
        let mut undetermined: Vec<(&str, String)> = Vec::new();
        // Keys whose number is accounted for; one that a log left as it was may have been determined by a log before.
        let mut settled: Vec<&str> = Vec::new();
        for entry in &robot.calibration {
            if settled.contains(&entry.key.as_str()) {
                continue;
            }
            let Some(value) = file.value_mut(&entry.key).copied() else {
                return refuse(format!("calibration names {}, which the file does not have; identify anew.", entry.key));
            };
            let name = format!("{} ({})", entry.parameter, entry.key);
            for (field, deviation) in [("std", entry.std), ("prior_std", entry.prior_std)] {
                if !(0.0..f64::INFINITY).contains(&deviation) {
                    return refuse(format!(
                        "calibration has {field}: {deviation} for {name}, which is no standard deviation; identify anew."
                    ));
                }
            }
            let determined = entry.identified && is_determined(entry, robot);
            if determined && value != entry.value {
                return refuse(format!("{name} is {value}, but its calibration found {}; identify anew.", entry.value));
            }
            if determined {
                settled.push(&entry.key);
                identified.push(entry.clone());
                continue;
            }
            let is_typed = entry.std == 0.0;
            // What the controller does not have may stay as fitted.
            let stays_as_fitted = parameters::ALL.iter().all(|quantity| !quantity.is_of_controller() || quantity.key(robot) != entry.key);
            if stays_as_fitted {
                settled.push(&entry.key);
            } else if value != entry.prior {
                let (reason, advice) = if is_typed {
                    ("has no deviation: it was typed by hand and not identified".to_owned(), "identify it from a recording")
                } else {
                    let left =
                        left(entry, robot).map_or_else(String::new, |left| format!(" ({:.0} % of its deviation is left)", 100.0 * left));
                    (format!("was not identified{left}"), "identify from a log with more motion")
                };
                return refuse(format!(
                    "{name} {reason}, yet it is {value} and not the {} from before; put that back, or {advice}.",
                    entry.prior
                ));
            }
            if undetermined.iter().all(|(key, _)| *key != entry.key) {
                let reason = match left(entry, robot) {
                    None => "it has no deviation from before".to_owned(),
                    Some(_) if is_typed => "it was typed by hand".to_owned(),
                    Some(left) => format!("the log left {:.0} % of its deviation", 100.0 * left),
                };
                undetermined.push((entry.key.as_str(), format!("{} was not identified ({reason})", entry.parameter)));
            }
        }
        undetermined.retain(|(key, _)| identified.iter().all(|entry| entry.key != *key));
        let undetermined: Vec<String> = undetermined.into_iter().map(|(_, sentence)| sentence).collect();
        if identified.is_empty() {
            let reasons = if undetermined.is_empty() { "it has no calibration".to_owned() } else { undetermined.join("; ") };
            return refuse(format!("there is nothing to export: {reasons}. Run raven-identify on a log with more motion."));
        }
        let (before, after) = (Constants::new(&robot.before_calibration())?, Constants::new(robot)?);
        possible(&before, &after).map_err(|message| Error::file(path, message))?;
        Ok(Self { before, after, identified, undetermined })
    }

    /// The finding behind a key of the robot file.
    #[must_use]
    pub fn finding(&self, key: &str) -> Option<&Provenance> {
        self.identified.iter().find(|entry| entry.key == key)
    }

    /// Logs that the findings rest on, with their SHA-256, each once.
    #[must_use]
    pub fn logs(&self) -> Vec<(&str, &str)> {
        let mut logs = Vec::new();
        for entry in &self.identified {
            for log in entry.logs.iter().zip(&entry.sha256).map(|(name, hash)| (name.as_str(), hash.as_str())) {
                if !logs.contains(&log) {
                    logs.push(log);
                }
            }
        }
        logs
    }

    /// Whether a format carries the finding at a key.
    #[must_use]
    pub fn carries(&self, format: Format, key: &str) -> bool {
        self.after.keys().iter().any(|known| known == key) || format == Format::Rosparam
    }

    /// Sentences about what a format does not carry.
    #[must_use]
    pub fn left_out(&self, format: Format) -> Vec<String> {
        let mut sentences: Vec<String> = self.undetermined.iter().map(|what| format!("{what}; the number from before stays.")).collect();
        // Where cameras stand is nothing that a controller could have.
        let missed = |entry: &&Provenance| !self.carries(format, &entry.key) && !entry.key.starts_with("observation.");
        let without: Vec<&str> = self.identified.iter().filter(missed).map(|entry| entry.parameter.as_str()).collect();
        if !without.is_empty() {
            sentences.push(format!("the controller has no constant for {}; they are not in this file.", without.join(", ")));
        }
        if format == Format::Defines && self.before.hard_stop != self.after.hard_stop {
            sentences.push("all arms share the constants of the hard stops: the header moves the other arm's too.".to_owned());
        }
        if format == Format::Defines && self.before.coupling != self.after.coupling {
            sentences.push("all arms share the coupling constants: the header changes the other arm's too.".to_owned());
        }
        sentences
    }
}

/// What is to be said of how findings were made, each sentence once and with the parameters that it is about.
pub fn remarks<'a>(findings: impl IntoIterator<Item = &'a Provenance>) -> Vec<String> {
    let mut remarks: Vec<(&str, Vec<&str>)> = Vec::new();
    for entry in findings {
        let Some(sentence) = remark(&entry.method) else { continue };
        match remarks.iter_mut().find(|(known, _)| *known == sentence) {
            Some((_, parameters)) => parameters.push(&entry.parameter),
            None => remarks.push((sentence, vec![entry.parameter.as_str()])),
        }
    }
    let line = |(sentence, parameters): &(&str, Vec<&str>)| format!("{}: {sentence}", parameters.join(", ")).replace(['\n', '\r'], " ");
    remarks.iter().map(line).collect()
}

/// Refuses what no such hardware has.
fn possible(before: &Constants, after: &Constants) -> Result<(), String> {
    for j in 0..3 {
        let joint = &after.joints[j];
        let radius = after.link_radius[j] / before.link_radius[j] - 1.0;
        if off_by_more(radius, RADIUS_OFF) {
            return Err(format!(
                "joints.{joint}.link_pulley_radius is {}, {:+.1} % from {}; more than {:.0} % is no pulley of this robot. Look at gear \
                 ratio, capstan and registration.",
                after.link_radius[j],
                100.0 * radius,
                before.link_radius[j],
                100.0 * RADIUS_OFF
            ));
        }
        let ratio = after.ratio[j] / before.ratio[j] - 1.0;
        if off_by_more(ratio, RADIUS_OFF) {
            return Err(format!(
                "the transmission ratio of {joint} is {:+.1} % from before; that is no transmission of this robot.",
                100.0 * ratio
            ));
        }
        let stop = after.hard_stop[j] - before.hard_stop[j];
        if off_by_more(stop, HARD_STOP_OFF[j]) {
            return Err(format!(
                "joints.{joint}.hard_stop is {}, {stop:+.3} from before; more than {} is no hard stop of this robot. Was it homed?",
                after.hard_stop[j], HARD_STOP_OFF[j]
            ));
        }
        let coupling = after.coupling[j] - before.coupling[j];
        if off_by_more(coupling, COUPLING_OFF[j]) {
            let (from, to) = COUPLINGS[j];
            return Err(format!(
                "cable_coupling from {} to {} is {}, {coupling:+.4} from before; more than {} is no cable routing of this robot.",
                after.joints[from], after.joints[to], after.coupling[j], COUPLING_OFF[j]
            ));
        }
    }
    Ok(())
}

fn off_by_more(difference: f64, limit: f64) -> bool {
    difference.is_nan() || difference.abs() > limit
}
