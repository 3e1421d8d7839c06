//! Experiment D: what it costs when the marker is hidden, for a filter that goes on by its model and for the paper's switch.

use std::path::Path;

use raven::Result;
use raven::plot::Spread;
use raven::robot::Robot;
use rayon::prelude::*;
use serde::Serialize;

use super::{figures, read};
use crate::errors::{JointErrors, rms_of};
use crate::estimate::{Settings, estimate};
use crate::{FilterKind, Occlusion};

/// Shares of the time in which the marker is hidden.
pub const SHARES: [f64; 6] = [0.0, 0.1, 0.2, 0.4, 0.6, 0.8];

/// What is compared.
pub const WAYS: [(&str, FilterKind, Occlusion); 4] = [
    ("twelve states", FilterKind::Bias, Occlusion::Skip),
    ("twelve states, switch", FilterKind::Bias, Occlusion::Kinematics),
    ("six states", FilterKind::Paper, Occlusion::Skip),
    ("six states, switch", FilterKind::Paper, Occlusion::Kinematics),
];

/// One way of filtering under one share of occlusion.
#[derive(Debug, Clone, Serialize)]
pub struct Run {
    /// Its name in [`WAYS`].
    pub way: &'static str,
    /// Share of [`SHARES`].
    pub occluded: f64,
    /// RMS error per joint, in display units.
    pub rms: [f64; 3],
    /// By how much that is more than without occlusion.
    pub cost_percent: [f64; 3],
    /// By how much it is less than what the controller believed.
    pub improvement_percent: [f64; 3],
    /// Of the magnitude of the errors.
    #[serde(skip)]
    pub spread: [Option<Spread>; 3],
}

/// What experiment D found.
#[derive(Debug, Serialize)]
pub struct Occlusions {
    joints: Vec<String>,
    units: Vec<&'static str>,
    rms_as_recorded: [f64; 3],
    runs: Vec<Run>,
}

impl Occlusions {
    /// Replays a log in every way under every share, and leaves a figure beside it.
    ///
    /// # Errors
    /// If the log cannot be read or lacks reference encoders.
    pub fn run(robot: &Robot, log: &Path, settings: &Settings) -> Result<Self> {
        let recording = read(log, robot)?;
        let reference = recording.require_joint_encoders()?;
        let scale: Vec<f64> = robot.joints.iter().map(|joint| joint.display_unit().1).collect();
        let tasks: Vec<_> = WAYS.iter().flat_map(|way| SHARES.map(|share| (*way, share))).collect();
        let done = tasks.into_par_iter().map(|((way, filter, occlusion), occluded)| {
            let (estimates, _) = estimate(&recording, robot, &Settings { filter, occlusion, occlude: occluded, ..*settings })?;
            let errors = [0, 1, 2].map(|j| JointErrors::new(&estimates, reference, j));
            let rms = [0, 1, 2].map(|j| rms_of(&errors[j].filter).map_or(f64::NAN, |rms| rms * scale[j]));
            let believed = [0, 1, 2].map(|j| rms_of(&errors[j].believed).map_or(f64::NAN, |rms| rms * scale[j]));
            let spread = [0, 1, 2].map(|j| Spread::of(&errors[j].filter.iter().map(|(_, e)| e.abs() * scale[j]).collect::<Vec<_>>()));
            let improvement_percent = [0, 1, 2].map(|j| 100.0 * (1.0 - rms[j] / believed[j]));
            Ok((Run { way, occluded, rms, cost_percent: [0.0; 3], improvement_percent, spread }, believed))
        });
        let done: Vec<(Run, [f64; 3])> = done.collect::<Result<_>>()?;
        let rms_as_recorded = done.first().map_or([f64::NAN; 3], |(_, believed)| *believed);
        let mut runs: Vec<Run> = done.into_iter().map(|(run, _)| run).collect();
        // Every way starts with no occlusion.
        for way in runs.chunks_mut(SHARES.len()) {
            let open = way[0].rms;
            way.iter_mut().for_each(|run| run.cost_percent = [0, 1, 2].map(|j| 100.0 * (run.rms[j] / open[j] - 1.0)));
        }
        let name = |j: &raven::robot::Joint| j.name.clone();
        let occlusions = Self {
            joints: robot.joints.iter().map(name).collect(),
            units: robot.joints.iter().map(|j| j.display_unit().0).collect(),
            rms_as_recorded,
            runs,
        };
        figures::occlusion(log.parent().unwrap_or(Path::new(".")), robot, &occlusions.runs)?;
        Ok(occlusions)
    }

    /// The table.
    #[must_use]
    pub fn text(&self) -> String {
        let mut lines = vec!["Experiment D: RMS error, and its change against no occlusion, by share of the time hidden".to_owned()];
        for (j, (joint, unit)) in self.joints.iter().zip(&self.units).enumerate() {
            let shares = SHARES.map(|share| format!("{:>17.0} %", 100.0 * share)).concat();
            lines.push(format!("{:<22}{shares}", format!("{joint} [{unit}]")));
            for way in self.runs.chunks(SHARES.len()) {
                let cells = way.iter().map(|run| format!("{:>9.4} {:>+7.1} %", run.rms[j], run.cost_percent[j]));
                let name = way.first().map_or("", |run| run.way);
                lines.push(format!("{name:<22} {}", cells.collect::<Vec<_>>().join(" ")));
            }
            lines.push(format!("{:<22} {:>9.4}", "as recorded", self.rms_as_recorded[j]));
        }
        lines.join("\n") + "\n"
    }
}
