//! What `--add-effect` takes of a report `raven-diagnosis/1`. Other keys are ignored.

use std::path::{Path, PathBuf};

use raven::effects::Sited;
use raven::robot::Robot;
use raven::{Error, Result, cli, files};
use serde::Deserialize;

use crate::identified::unremarked;

/// A report.
#[derive(Debug)]
pub struct Diagnosis {
    path: PathBuf,
    report: Report,
}

#[derive(Debug, Deserialize)]
struct Report {
    format: String,
    #[serde(default)]
    verdict: Option<String>,
    #[serde(default)]
    effects: Vec<Blamed>,
    #[serde(default)]
    recordings: Vec<String>,
    #[serde(default)]
    recordings_sha256: Vec<String>,
    against: Option<Against>,
    robot: Option<RobotFile>,
}

/// What recordings were held against besides the robot file: a simulation of the user's own.
#[derive(Debug, Deserialize)]
struct Against {
    effects_of: Option<String>,
}

/// The robot file that recordings were held against.
#[derive(Debug, Deserialize)]
struct RobotFile {
    file: String,
    sha256: String,
}

/// A blamed effect.
#[derive(Debug, Deserialize)]
pub struct Blamed {
    id: String,
    /// Joint, `from->to`, `12` or `23`; none for the whole.
    pub joint: Option<String>,
    #[serde(default)]
    parameters: Vec<Estimate>,
    #[serde(default)]
    probability: Option<f64>,
    #[serde(default)]
    ties: Vec<Tie>,
}

/// What may be there in its place.
#[derive(Debug, Deserialize)]
struct Tie {
    id: String,
    joint: Option<String>,
    #[serde(default)]
    exact: bool,
}

/// Probability below which an effect is spoken of with it.
const SURE: f64 = 0.9;

/// One of its numbers.
#[derive(Debug, Deserialize)]
struct Estimate {
    name: String,
    value: f64,
    #[serde(default)]
    std: f64,
    #[serde(default)]
    unit: Option<String>,
}

impl Diagnosis {
    /// Reads a report.
    ///
    /// # Errors
    /// If it cannot be read, is none, or is about effects that the robot lacks.
    pub fn read(path: &Path) -> Result<Self> {
        let wrong = |what: String| Error::file(path, format!("{what}; expected a report that raven-diagnose --json wrote."));
        let report: Report = serde_json::from_str(&files::read_text(path)?).map_err(|e| wrong(format!("it is no report: {e}")))?;
        if report.format != "raven-diagnosis/1" {
            return Err(wrong(format!("format is `{}` and not `raven-diagnosis/1`", report.format)));
        }
        if report.against.as_ref().is_some_and(|against| against.effects_of.as_deref() == Some("simulation")) {
            let message = "against.effects_of is `simulation`: its effects are what the simulation has and the robot lacks; take them out of the \
                           simulation, and leave the robot file as it is.";
            return Err(Error::file(path, message));
        }
        Ok(Self { path: path.to_owned(), report })
    }

    /// Warns where the report is about another robot file, whose numbers its values are relative to.
    ///
    /// # Errors
    /// If the file cannot be read, or is one that has an effect of `names` from this report already.
    pub fn check_file(&self, path: &Path, robot: &Robot, names: &[String]) -> Result<()> {
        let Some(RobotFile { file, sha256 }) = &self.report.robot else { return Ok(()) };
        if files::sha256(path)? == *sha256 {
            return Ok(());
        }
        let logs = self.logs();
        let is_in =
            |name: &&String| robot.calibration.iter().any(|line| unremarked(&line.method) == super::method(name) && line.logs == logs);
        if let Some(name) = names.iter().find(is_in) {
            let message = format!(
                "{name} is in it already, from a report on the same recordings, and {} was made against {file}; diagnose with this file, or \
                 give the values after `=`.",
                self.path.display()
            );
            return Err(Error::file(path, message));
        }
        cli::warn(&format!(
            "{} was made against {file}, and {} is not that file: its values are relative to the numbers there; diagnose with this file, \
             or add all effects at once.",
            self.path.display(),
            path.display()
        ));
        Ok(())
    }

    /// File names of the recordings that it is about, as far as it says.
    #[must_use]
    pub fn logs(&self) -> Vec<String> {
        let name = |path: &String| Path::new(path).file_name().map_or_else(|| path.clone(), |name| name.to_string_lossy().into_owned());
        self.report.recordings.iter().map(name).collect()
    }

    /// SHA-256 of each of these; empty where it does not say.
    #[must_use]
    pub fn sha256_of_logs(&self) -> Vec<String> {
        let said = |k: usize| self.report.recordings_sha256.get(k).cloned().unwrap_or_default();
        (0..self.report.recordings.len()).map(said).collect()
    }

    /// The blamed effect of an identifier, at a joint if one is given.
    ///
    /// # Errors
    /// If it is not blamed, or at several joints.
    pub fn find(&self, id: &str, joint: Option<&str>) -> Result<&Blamed> {
        let found: Vec<&Blamed> =
            self.report.effects.iter().filter(|e| e.id == id && (joint.is_none() || e.joint.as_deref() == joint)).collect();
        let names = |effects: &mut dyn Iterator<Item = &Blamed>| effects.map(Blamed::name).collect::<Vec<_>>().join(", ");
        let wrong = |message: String| Err(Error::file(&self.path, message));
        match found[..] {
            [only] => Ok(only),
            [] if self.report.effects.is_empty() => {
                wrong(format!("effects is empty: the report blames nothing, so it has no values for {id}."))
            }
            [] => {
                let at = joint.map_or_else(String::new, |joint| format!(":{joint}"));
                let blamed = names(&mut self.report.effects.iter());
                wrong(format!("{id}{at} is not among its effects, which are {blamed}; add one of them, or give the values after `=`."))
            }
            _ => wrong(format!("{id} is among its effects at several places; write one of {}.", names(&mut found.iter().copied()))),
        }
    }

    /// Why a blamed effect may not be there, as far as the report says.
    #[must_use]
    pub fn doubt(&self, blamed: &Blamed) -> Option<String> {
        let probability = blamed.probability.filter(|probability| *probability < SURE);
        let probability = probability.map(|probability| format!("the diagnosis gives it a probability of {probability:.2}"));
        let same: Vec<String> =
            blamed.ties.iter().filter(|tie| tie.exact).map(|tie| raven::effects::at_place(&tie.id, tie.joint.as_deref())).collect();
        let same = (!same.is_empty()).then(|| format!("no recording of motors and tip tells it from {}", same.join(" or ")));
        let verdict = self.report.verdict.as_ref().filter(|verdict| *verdict != "explained");
        let verdict = verdict.map(|verdict| format!("the verdict was `{verdict}`"));
        let doubts: Vec<String> = [probability, same, verdict].into_iter().flatten().collect();
        (!doubts.is_empty()).then(|| doubts.join(", "))
    }

    /// Values and standard deviations of a blamed effect, in the order and units of the library. What the motion before the recording left is
    /// as usual: the file is for other recordings too.
    ///
    /// # Errors
    /// If one is missing, or in a unit that is not known.
    pub fn values(&self, blamed: &Blamed, sited: &Sited) -> Result<(Vec<f64>, Vec<f64>)> {
        let measure = sited.measure;
        let both = |parameter: &raven::effects::Parameter| {
            let wrong = |message: String| Error::file(&self.path, format!("effects, {}: {message}", blamed.name()));
            let estimate = blamed.parameters.iter().find(|estimate| estimate.name == parameter.name && !parameter.scale.is_state());
            match (estimate, parameter.usual(measure)) {
                (Some(estimate), _) => {
                    let expected = parameter.unit_at(measure);
                    let unit = estimate.unit.as_deref().unwrap_or(expected);
                    let scale = scale(unit, expected).ok_or_else(|| {
                        wrong(format!("`{}` is in {unit}, expected {expected}; give the value after `=`.", parameter.name))
                    })?;
                    Ok((scale * estimate.value, (scale * estimate.std).abs()))
                }
                (None, Some(usual)) => Ok((usual, 0.0)),
                (None, None) => Err(wrong(format!("it has no parameter `{}`; give the values after `=`.", parameter.name))),
            }
        };
        sited.effect.parameters.iter().map(both).collect::<Result<Vec<_>>>().map(|pairs| pairs.into_iter().unzip())
    }
}

impl Blamed {
    fn name(&self) -> String {
        raven::effects::at_place(&self.id, self.joint.as_deref())
    }
}

/// What takes a unit of a report to that of the library.
fn scale(unit: &str, expected: &str) -> Option<f64> {
    match (unit, expected) {
        _ if unit == expected => Some(1.0),
        ("deg", "rad") => Some(std::f64::consts::PI / 180.0),
        ("mm", "m") | ("ms", "s") => Some(1e-3),
        ("%", "1") => Some(1e-2),
        ("ppm", "s/s") => Some(1e-6),
        _ => None,
    }
}
