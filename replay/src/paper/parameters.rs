//! Experiments A and B: parameters from a sinusoid and from a task motion, beside what the simulation had hidden.

use std::path::Path;

use raven::Result;
use raven::robot::Robot;
use serde::Serialize;
use serde_json::Value;

use crate::chain::{self, Chain, TRUTH, identify};

/// The shoulder's ratio, what the two softer cables and their friction make of load and reversals, and the cameras' latency.
const SINUSOID: &str = "r_l1,k_e2,k_e3,F_c2,hysteresis_3,rounding_3,latency";
/// The same with the stiffest cable, to see what a task motion says of it.
const TASK: &str = "r_l1,k_e,F_c2,hysteresis_3,rounding_3,latency";

/// One identified number.
#[derive(Debug, Serialize)]
struct Found {
    experiment: &'static str,
    parameter: String,
    value: f64,
    std: f64,
    identified: bool,
    truth: Option<f64>,
    error_percent: Option<f64>,
}

/// What experiments A and B found.
#[derive(Debug, Serialize)]
pub struct Parameters {
    found: Vec<Found>,
}

impl Parameters {
    /// Identifies; `a.yaml` and `b.yaml` are left in the folder.
    ///
    /// # Errors
    /// If identification fails.
    pub fn identify(chain: &mut Chain<'_>, folder: &Path) -> Result<Self> {
        let files = "--robot {robot.yaml} --cameras {cameras.yaml}";
        chain.say("Experiment A: parameters from a sinusoid")?;
        chain.step("raven-identify", identify, &format!("{{sinusoid.mcap}} {files} --parameters {SINUSOID} -o {{a.yaml}}"))?;
        // The paper's recursive method with its traces.
        let traces = "--method dual --parameters r_l1 --plot {figure-parameters.svg} -o {dual.yaml}";
        chain.step("raven-identify", identify, &format!("{{sinusoid.mcap}} {files} {traces}"))?;
        chain.say("Experiment B: cable parameters from a task motion")?;
        chain.step("raven-identify", identify, &format!("{{fls.mcap}} {files} --parameters {TASK} -o {{b.yaml}}"))?;
        let truth = chain::read_json(&folder.join(TRUTH))?;
        let mut found = Vec::new();
        for (experiment, file) in [("A", "a.yaml"), ("B", "b.yaml")] {
            let robot = Robot::read(&folder.join(file))?;
            found.extend(robot.calibration.iter().map(|line| {
                let truth = hidden(&truth, &line.parameter, &robot);
                Found {
                    experiment,
                    parameter: line.parameter.clone(),
                    value: line.value,
                    std: line.std,
                    identified: line.identified,
                    truth,
                    error_percent: truth.map(|truth| 100.0 * (line.value / truth - 1.0)),
                }
            }));
        }
        let parameters = Self { found };
        chain.say(&parameters.text())?;
        Ok(parameters)
    }

    fn text(&self) -> String {
        let mut text = format!(
            "{:<11} {:<10} {:>12} {:>10} {:>12} {:>9}  {}",
            "experiment", "parameter", "found", "std", "hidden", "error", "identified"
        );
        for line in &self.found {
            let (Some(truth), Some(error)) = (line.truth, line.error_percent) else { continue };
            let digits = if truth.abs() < 1.0 { 5 } else { 0 };
            text += &format!(
                "\n{:<11} {:<10} {:>12.digits$} {:>10.digits$} {:>12.digits$} {:>7.2} %  {}",
                line.experiment,
                line.parameter,
                line.value,
                line.std,
                truth,
                error,
                if line.identified { "yes" } else { "no" }
            );
        }
        text + "\n"
    }
}

/// What was hidden under the name of a parameter; the friction in `F_c` stands for play as well and has no single true value.
fn hidden(truth: &Value, parameter: &str, robot: &Robot) -> Option<f64> {
    let joint = |digit: &str| digit.parse::<usize>().ok().and_then(|number| robot.joints.get(number.checked_sub(1)?)).map(|j| &j.name);
    let at = |table: &str, digit: &str| truth.get(table)?.get(joint(digit)?)?.as_f64();
    match parameter {
        // A tip is of the moment between both images, and the right one is late by more.
        "latency" => Some(truth.get("latency_s")?.as_f64()? + 0.5 * truth.get("right_minus_left_s")?.as_f64()?),
        name => [("r_l", "link_pulley_radius_m"), ("k_e", "cable_stiffness_n"), ("hysteresis_", "hysteresis_half")]
            .iter()
            .find_map(|(prefix, table)| at(table, name.strip_prefix(prefix)?)),
    }
}
