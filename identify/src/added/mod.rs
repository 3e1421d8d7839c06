//! `raven-identify --add-effect`: effects that a diagnosis named, put into the robot file. The model of the new file is the old one's with
//! the effects built in; nothing is estimated here.

mod diagnosis;
mod request;

use std::fmt::Write as _;
use std::io::Write;

use raven::camera::Cameras;
use raven::cli::{self, Outcome};
use raven::effects::{Effect, Scale, Sited};
use raven::robot::{Change, KinematicsKind, Provenance, Robot};
use raven::{Error, Result};
use serde_json::json;

use crate::args::Identify;
use crate::identified::{BY_EFFECT, is_determined, remarked};
use diagnosis::Diagnosis;
use request::Request;

/// Step of difference quotients, in units of the slab.
const STEP: f64 = 1e-3;

/// An effect with its values and their standard deviations, in the order of its parameters and in their units. Values that were given by
/// hand have none: 0.
struct Sized {
    sited: Sited,
    values: Vec<f64>,
    stds: Vec<f64>,
    /// Why it may not be there, where a diagnosis says so.
    doubt: Option<String>,
    /// The recordings that were diagnosed, by file name, and SHA-256 of each.
    logs: Vec<String>,
    sha256: Vec<String>,
}

/// Writes the robot file with the effects in it.
///
/// # Errors
/// With a sentence, if an effect is unknown, not in the diagnosis, at no such joint, beyond what hardware can have, or belongs to the
/// cameras; or if a file cannot be read or written.
pub fn run(args: &Identify, out: &mut dyn Write) -> Result<Outcome> {
    args.apart()?;
    let has_table = args.has_table()?;
    let output = args.output.as_deref().ok_or_else(|| Error::Argument("-o is missing: the robot file to write.".to_owned()))?;
    let path = args.robot()?;
    let before = Robot::read(path)?;
    if matches!(before.kinematics, KinematicsKind::Bench) {
        let message = "it is a bench (kinematics.kind: bench), and effects are added to the files of arms; change its numbers by hand.";
        return Err(Error::file(path, message));
    }
    let cameras = args.cameras.as_deref().map(Cameras::read).transpose()?;
    let diagnosis = args.diagnosis.as_deref().map(Diagnosis::read).transpose()?;
    let mut robot = before.clone();
    let mut names = Vec::new();
    for text in &args.add_effect {
        let sized = Request::parse(text)?.sized(&robot, diagnosis.as_ref())?;
        let name = name(&sized.sited, &robot);
        if names.contains(&name) {
            return Err(Error::Argument(format!("--add-effect {name} is given twice; give it once, with all of its size.")));
        }
        if let Some(doubt) = &sized.doubt {
            cli::warn(&format!("{name}: {doubt}."));
        }
        names.push(name);
        robot = added(&robot, cameras.as_ref(), &sized)?;
        let Effect { id, parameters, .. } = sized.sited.effect;
        if parameters.iter().any(|parameter| parameter.scale == Scale::Moment) {
            cli::warn(&format!("{id}: its moment is a part of one recording's length; the new file is for that recording alone."));
        }
    }
    if let Some(diagnosis) = &diagnosis {
        diagnosis.check_file(path, &before, &names)?;
    }
    crate::write_robot(output, &robot, out, "take other values for the effects")?;
    let changes = before.changes_to(&robot);
    let listed = &robot.effects[before.effects.len()..];
    let report = {
        let change = |c: &Change| json!({"key": c.key, "unit": c.unit, "before": c.before, "after": c.after});
        let entry = |e: &raven::robot::ListedEffect| json!({"id": e.id, "joint": e.joint, "values": e.values});
        let (changes, listed): (Vec<_>, Vec<_>) = (changes.iter().map(change).collect(), listed.iter().map(entry).collect());
        json!({"changes": changes, "effects": listed})
    };
    let table = if has_table { table(&changes, listed) } else { String::new() };
    cli::results(out, &table, args.json.as_deref(), &report)?;
    Ok(Outcome::Done)
}

/// The robot with an effect, and where each changed number came from.
fn added(robot: &Robot, cameras: Option<&Cameras>, sized: &Sized) -> Result<Robot> {
    let Sized { sited, values, stds, doubt, logs, sha256 } = sized;
    let mut new = sited.added_to(robot, cameras, values)?;
    // An effect that was measured has a deviation; its shapes may be as usual.
    let is_measured = stds.iter().any(|&std| std > 0.0);
    let mut lines = Vec::new();
    for Change { key, unit, before, after } in robot.changes_to(&new) {
        let Some(prior) = before else { continue };
        let number =
            |values: &[f64]| -> Result<f64> { Ok(sited.added_to(robot, cameras, values)?.value_mut(&key).copied().unwrap_or_default()) };
        let [std, prior_std] = if is_measured { sized.deviations(after, number) } else { [0.0, tolerance(robot, sited, prior, number)?] };
        let mut line = Provenance {
            parameter: key.replace('.', "_"),
            key,
            unit: unit.to_owned(),
            value: after,
            std,
            prior,
            prior_std,
            identified: false,
            method: remarked(&method(&name(sited, robot)), doubt.clone()),
            logs: logs.clone(),
            sha256: sha256.clone(),
        };
        line.identified = is_measured && is_determined(&line, robot);
        lines.push(line);
    }
    // Newest first: undoing them in order ends at the oldest prior.
    new.calibration.splice(0..0, lines);
    Ok(new)
}

impl Sized {
    /// Deviations of the number that the values make `after`: of the diagnosis, and of the slabs under which it found them.
    fn deviations(&self, after: f64, number: impl Fn(&[f64]) -> Result<f64>) -> [f64; 2] {
        let measure = self.sited.measure;
        let (mut variance, mut prior_variance) = (0.0, 0.0);
        for (k, parameter) in self.sited.effect.parameters.iter().enumerate() {
            let u = parameter.u(self.values[k], measure);
            let moved = |step: f64| {
                let mut off = self.values.clone();
                off[k] = parameter.value(u + step, measure);
                number(&off).map_or(0.0, |moved| (moved - after).abs() / STEP)
            };
            // To the side where the number moves: at its bound a value does to one alone.
            let per_slab = moved(STEP).max(moved(-STEP));
            prior_variance += per_slab.powi(2);
            if self.stds[k] > 0.0 {
                variance += (per_slab * self.stds[k] / parameter.std(u, 1.0, measure)).powi(2);
            }
        }
        [variance.sqrt(), prior_variance.sqrt()]
    }
}

/// What a number that was `prior` is good for by the file itself: all that is known of it where values are typed.
fn tolerance(robot: &Robot, sited: &Sited, prior: f64, number: impl Fn(&[f64]) -> Result<f64>) -> Result<f64> {
    let (parameters, measure) = (sited.effect.parameters, sited.measure);
    let mut variance = 0.0;
    for (k, parameter) in parameters.iter().enumerate() {
        let u = parameter.tolerance_u(robot, sited.place, measure).unwrap_or(1.0);
        let mut at_spike: Vec<f64> = parameters.iter().map(|p| p.value(0.0, measure)).collect();
        at_spike[k] = parameter.value(u, measure);
        variance += (number(&at_spike)? - prior).powi(2);
    }
    Ok(variance.sqrt())
}

/// How a number was found that came with an effect.
fn method(name: &str) -> String {
    format!("{BY_EFFECT}{name}")
}

/// `ID` or `ID:JOINT`.
fn name(sited: &Sited, robot: &Robot) -> String {
    raven::effects::at_place(sited.effect.id, sited.joint(robot).as_deref())
}

fn table(changes: &[Change], listed: &[raven::robot::ListedEffect]) -> String {
    let mut text = String::new();
    if !changes.is_empty() {
        let _ = writeln!(text, "{:<42} {:<8} {:>14} {:>14}", "number", "unit", "before", "after");
    }
    for Change { key, unit, before, after } in changes {
        let before = before.map_or_else(|| "-".to_owned(), figure);
        let _ = writeln!(text, "{key:<42} {unit:<8} {before:>14} {:>14}", figure(*after));
    }
    for effect in listed {
        let joint = effect.joint.as_ref().map_or_else(String::new, |joint| format!(" {joint}"));
        let values: Vec<String> = effect.values.iter().map(|(name, value)| format!("{name} {}", figure(*value))).collect();
        let _ = writeln!(text, "listed in effects: {}{joint}, {}", effect.id, values.join(", "));
    }
    if text.is_empty() {
        text.push_str("Nothing changed: these values are those of the file.\n");
    }
    text
}

/// Six figures.
fn figure(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) { format!("{value:.6}") } else { format!("{value:.5e}") }
}
