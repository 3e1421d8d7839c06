//! What `raven-replay` prints and writes.

use std::f64::consts::TAU;
use std::fmt;
use std::path::Path;

use raven::Result;
use raven::effects::within_images;
use raven::filter::consistency::{self, NormalisedSquares, Whiteness};
use raven::filter::{FilterRun, Persistence, Tuning};
use raven::log::{LogWriter, Recording, topics};
use raven::plot;
use raven::robot::{Arm, Robot};
use raven::stats::TTest;
use serde::Serialize;

use crate::errors::{Estimates, JointErrors, JointRow, paired};
use crate::over_time::OverTime;

/// The machine-readable result.
#[derive(Debug, Serialize)]
pub struct Report {
    joints: Vec<JointRow>,
    paired_t: Vec<Option<TTest>>,
    logs: Vec<LogSummary>,
    /// Effects of the robot file's list that replay cannot honour.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left_out: Vec<String>,
    seconds: f64,
}

/// Part of the cameras' variance that is worth a sentence where it persists.
const PERSISTS: f64 = 0.05;

/// How consistent the filter was on one log.
#[derive(Debug, Serialize)]
pub struct LogSummary {
    log: String,
    /// Sentences about what could not be used.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    lost: Vec<String>,
    /// Whether any tip was seen, used or not.
    #[serde(skip)]
    any_seen: bool,
    tips: usize,
    refused: usize,
    restarts: usize,
    nis_mean: Option<f64>,
    nis_band95: Option<[f64; 2]>,
    nis: Option<NormalisedSquares>,
    whiteness: Option<Whiteness>,
    /// How the cameras' errors persist, as far as the filter was told.
    persistence: Option<Persistence>,
    /// What of the joints' deviations is alike in all tips [rad, rad, m], where cameras or registration say how well they are known.
    shared_std: Option<[f64; 3]>,
    nees_filter: Option<NormalisedSquares>,
    nees_smoother: Option<NormalisedSquares>,
}

impl LogSummary {
    /// From a filter's run over a log.
    pub fn new(recording: &Recording, filter: &FilterRun, tuning: Option<&Tuning>) -> Self {
        let nis = consistency::nis(filter);
        let nees = |track| recording.joint_encoders.as_ref().and_then(|reference| consistency::nees(track, reference));
        Self {
            log: recording.path.display().to_string(),
            lost: lost(recording, filter),
            any_seen: recording.seen_tips().next().is_some(),
            tips: filter.innovations.len(),
            refused: filter.innovations.iter().filter(|(_, innovation)| !innovation.accepted).count(),
            restarts: filter.restarts,
            nis_mean: nis.map(|nis| nis.mean),
            nis_band95: nis.map(|nis| nis.band95),
            nis,
            whiteness: consistency::whiteness(filter),
            persistence: tuning.map(|tuning| tuning.persistence),
            shared_std: filter.shared_std.map(Into::into),
            nees_filter: nees(&filter.filtered),
            nees_smoother: nees(&filter.smoothed),
        }
    }

    /// One sentence per kind of error that can be checked.
    fn sentences(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(nis) = self.nis else { return Ok(()) };
        writeln!(out, "{}", self.log)?;
        let [low, high] = nis.band95;
        let verdict = nis.sentence("The filter", "innovations");
        writeln!(out, "  {verdict} Mean NIS {:.2} of {} tips, 95 % band {low:.2} to {high:.2}.", nis.mean, nis.samples)?;
        if let Some(Whiteness { lag_one, band95, white }) = self.whiteness {
            let verdict = if white { "are independent" } else { "are alike from one to the next" };
            writeln!(out, "  Its innovations {verdict}: correlation {lag_one:+.3}, 95 % band +-{band95:.3}.")?;
        }
        if let Some(Persistence { part, path_m }) = self.persistence.filter(|persistence| persistence.part >= PERSISTS) {
            let (percent, path_mm) = (100.0 * part, 1e3 * path_m);
            writeln!(
                out,
                "  Of the variance of what the cameras see, {percent:.0} % persists over some {path_mm:.1} mm of the tip's path."
            )?;
        }
        if let Some([shoulder, elbow, insertion]) = self.shared_std {
            writeln!(
                out,
                "  Of its deviations {:.3} deg, {:.3} deg and {:.3} mm are what cameras and registration leave unknown, alike in all tips.",
                shoulder.to_degrees(),
                elbow.to_degrees(),
                1e3 * insertion
            )?;
        }
        for (who, nees) in [("The filter", self.nees_filter), ("The smoother", self.nees_smoother)] {
            let Some(nees) = nees else { continue };
            let [low, high] = nees.band95;
            writeln!(
                out,
                "  {} Mean NEES {:.2} of {} estimates worth {:.0} independent ones, 95 % band {low:.2} to {high:.2}.",
                nees.sentence(who, "joint errors"),
                nees.mean,
                nees.samples,
                nees.effective_samples
            )?;
        }
        Ok(())
    }
}

impl Report {
    /// Over all logs, `errors` per joint and log; empty where no log has reference encoders.
    pub fn new(robot: &Robot, errors: &[Vec<JointErrors>; 3], logs: Vec<LogSummary>, seconds: f64) -> Self {
        let known = errors.iter().zip(&robot.joints).filter(|(errors, _)| !errors.is_empty());
        let counts = counts(robot);
        let joints = known.zip(counts).map(|((errors, joint), count)| concatenate(errors).row(joint, count)).collect();
        let paired_t = errors.iter().filter(|errors| !errors.is_empty()).map(|errors| paired(errors)).collect();
        let left_out = within_images(robot).into_iter().map(|effect| effect.id.clone()).collect();
        Self { joints, paired_t, logs, left_out, seconds }
    }

    /// Sentences about what could not be used.
    pub fn lost(&self) -> impl Iterator<Item = &String> {
        self.logs.iter().flat_map(|log| &log.lost)
    }
}

impl fmt::Display for Report {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.joints.is_empty() {
            writeln!(out, "No reference encoders in these logs (/joint_encoders): nothing to compare with.")?;
        } else {
            writeln!(out, "RMS error against the joint encoders")?;
            writeln!(
                out,
                "{:<10} {:>4} {:>12} {:>12} {:>10} {:>10} {:>10} {:>12} {:>10}",
                "joint", "unit", "as recorded", "kinematics", "camera", "filter", "smoother", "improvement", "paired P"
            )?;
        }
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
        for (row, t) in self.joints.iter().zip(&self.paired_t) {
            writeln!(
                out,
                "{:<10} {:>4} {:>12} {:>12} {:>10} {:>10} {:>10} {:>12} {:>10}",
                row.joint,
                row.unit,
                number(row.rms_kinematic),
                number(row.rms_kinematic_identified),
                number(row.rms_camera),
                number(row.rms_filter),
                number(row.rms_smoother),
                row.improvement_percent.map_or_else(|| "-".to_owned(), |v| format!("{v:.1} %")),
                t.map_or_else(|| "-".to_owned(), |t| format!("{:.1e}", t.p)),
            )?;
        }
        for log in &self.logs {
            if log.tips == 0 {
                let (which, advice) =
                    if log.any_seen { ("could be used", "") } else { ("was seen", " `raven-track` finds tips in images.") };
                writeln!(out, "{} has no tip that {which}: the filter and the smoother follow the motors alone.{advice}", log.log)?;
            }
            log.sentences(out)?;
        }
        for id in &self.left_out {
            writeln!(out, "{id} is in the robot file's list of effects and left out here: a tip is taken for one point at one time.")?;
        }
        Ok(())
    }
}

/// What of a log could not be used, in sentences.
fn lost(recording: &Recording, filter: &FilterRun) -> Vec<String> {
    let name = recording.name();
    let of_tips = [(filter.without_covariance, "whose covariance is none"), (filter.in_pauses, "in pauses of the robot's messages")];
    let of_tips = of_tips.iter().filter(|(count, _)| *count > 0);
    let of_tips = of_tips.map(|(count, which)| format!("{name}: {count} sightings {which} were left out."));
    recording.unusable().into_iter().chain(of_tips).collect()
}

/// What one count of each motor's encoder is at the joint [rad or m].
fn counts(robot: &Robot) -> [f64; 3] {
    let per_turn = robot.encoder.map(|encoder| encoder.counts_per_revolution);
    let of_joint = |arm: Arm| arm.transmission.ratio.map(|ratio| per_turn.map_or(0.0, |counts| TAU / (counts * ratio.abs()))).into();
    robot.arm().map_or([0.0; 3], of_joint)
}

fn concatenate(errors: &[JointErrors]) -> JointErrors {
    let mut all = JointErrors::default();
    for log in errors {
        all.believed.extend(&log.believed);
        all.kinematic.extend(&log.kinematic);
        all.camera.extend(&log.camera);
        all.filter.extend(&log.filter);
        all.smoother.extend(&log.smoother);
    }
    all
}

/// Writes the three estimates as joint states, beside the log's metadata, the robot's file and the cameras'.
///
/// # Errors
/// If a file that was not computed has that name, or the disk is full.
pub fn write_log(path: &Path, recording: &Recording, robot: &Robot, cameras: Option<&[u8]>, estimates: &Estimates) -> Result<()> {
    let mut log = LogWriter::computed(path)?;
    log.metadata("session", &recording.session)?;
    let names: Vec<&str> = robot.joints.iter().map(|j| j.name.as_str()).collect();
    for (topic, estimate) in [
        (topics::ESTIMATE_KINEMATIC, &estimates.kinematic),
        (topics::ESTIMATE_CAMERA, &estimates.camera),
        (topics::ESTIMATE_FILTER, &estimates.filter),
    ] {
        for (time_s, joints) in estimate.time_s.iter().zip(&estimate.joints) {
            log.joint_states(topic, recording.start.plus_seconds(*time_s), &names, joints.as_slice(), None)?;
        }
    }
    log.made_with(&robot.to_yaml(), cameras)?;
    log.finish()
}

/// Estimates and errors of all joints over time, as SVG.
///
/// # Errors
/// If it cannot be drawn.
pub fn plot(recording: &Recording, robot: &Robot, estimates: &Estimates) -> Result<String> {
    let reference = recording.joint_encoders.as_ref();
    let panels = robot.joints.iter().take(3).enumerate().flat_map(|(j, joint)| {
        let over_time = OverTime { joint, j, estimates, until_s: f64::INFINITY };
        [Some(over_time.positions(reference)), reference.map(|reference| over_time.errors(reference, None))]
    });
    plot::panels(&panels.flatten().collect::<Vec<_>>())
}
