//! The report as it is printed.

use std::fmt;

use crate::Report;
use crate::attribution;
use crate::gap::{self, Gap};
use crate::whereabouts::Place;

impl fmt::Display for Report {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.model_gap.is_empty() {
            let untracked = if self.has_images { " They have images: run raven-track on them first." } else { "" };
            writeln!(
                out,
                "Nothing in these recordings shows where joints were while their motors were recorded (an arm's tip, a bench's joint encoders): \
                 the gap at the joints cannot be seen.{untracked}"
            )?;
        } else {
            let and_model = if self.is_bench { "" } else { ", and against the model with its cables and links" };
            writeln!(out, "Gap (rms): the recordings against transmission kinematics{and_model}")?;
            let model = if self.is_bench { String::new() } else { format!(" {:>8}", "model") };
            writeln!(out, "{:<10} {:>4} {:>13}{model} {:>12} {:>13}", "channel", "unit", "transmission", "noise floor", "observations")?;
        }
        for gap in &self.model_gap {
            let Gap { channel, unit, transmission, model, noise_floor, observations } = gap;
            let model = if self.is_bench { String::new() } else { format!(" {model:>8.2}") };
            writeln!(out, "{channel:<10} {unit:>4} {transmission:>13.2}{model} {noise_floor:>12.2} {observations:>13}")?;
        }
        if let Some(against) = &self.against {
            write!(out, "\n{}", against.words())?;
        }
        write!(out, "{}", gap::motor_words(&self.motor_motion, self.against.is_some()))?;
        self.where_it_lies(out)?;
        if let Some(attribution) = &self.attribution {
            write!(out, "\n{}", attribution::words(attribution))?;
        }
        if let Some(because) = &self.no_diagnosis {
            writeln!(out, "\n{because}")?;
        }
        if !self.controller.is_empty() {
            writeln!(out, "\nThe controller's own joint angles against transmission kinematics before calibration (largest difference)")?;
        }
        for difference in &self.controller {
            writeln!(out, "{:<10} {:>4} {:>12.6}", difference.joint, difference.unit, difference.largest)?;
        }
        if self.unreachable > 0 {
            writeln!(out, "\n{} tips lie where the kinematics cannot reach and were left out of the joints' rows.", self.unreachable)?;
        }
        Ok(())
    }
}

impl Report {
    fn where_it_lies(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let phases: Vec<&Place> = self.places.iter().filter(|place| place.is_phase_of_joint()).collect();
        if !phases.is_empty() {
            let what = if self.against.is_some() { "simulation" } else { "model" };
            writeln!(out, "\nWhere the gap to the {what} lies")?;
            writeln!(out, "{:<10} {:<12} {:>4} {:>8} {:>14} {:>13}  p", "joint", "phase", "unit", "rms", "of the excess", "of the time")?;
        }
        for place in phases {
            let percent = |share: f64| format!("{:.0} %", 100.0 * share);
            let (excess, time) = (percent(place.share_of_excess), percent(place.share_of_time));
            let Place { channel, label, unit, rms, p, .. } = place;
            writeln!(out, "{channel:<10} {label:<12} {unit:>4} {rms:>8.2} {excess:>14} {time:>13}  {p:.3}")?;
        }
        if !self.where_in_words.is_empty() {
            writeln!(out)?;
        }
        self.where_in_words.iter().try_for_each(|sentence| writeln!(out, "{sentence}"))
    }
}
