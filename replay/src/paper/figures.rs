//! The paper's figures 5 and 8 to 13, one idea per file.

use std::path::Path;

use raven::filter::FilterRun;
use raven::log::Recording;
use raven::plot::{self, Boxes, Histogram, Spread};
use raven::robot::Robot;
use raven::{Result, files};

use super::occlusion::{Run, SHARES, WAYS};
use super::trials::{ESTIMATES, TrialErrors};
use crate::errors::Estimates;
use crate::over_time::OverTime;

/// How much of a trial the figures over time show [s]; more of it could not be told apart.
const SHOWN_S: f64 = 30.0;
/// Among [`ESTIMATES`]: those that histograms and box plots show.
const SHOWN: [usize; 4] = [0, 2, 3, 4];

/// Figures 5 and 8: positions over time, and errors over time with the filter's own band of two sigma.
pub fn over_time(folder: &Path, robot: &Robot, recording: &Recording, estimates: &Estimates, run: &FilterRun) -> Result<()> {
    let reference = recording.require_joint_encoders()?;
    let (mut positions, mut errors) = (Vec::new(), Vec::new());
    for (j, joint) in robot.joints.iter().enumerate().take(3) {
        let shown = OverTime { joint, j, estimates, until_s: SHOWN_S };
        positions.push(shown.positions(Some(reference)));
        errors.push(shown.errors(reference, Some(run)));
    }
    files::write_atomic(&folder.join("figure-positions.svg"), plot::panels(&positions)?.as_bytes())?;
    files::write_atomic(&folder.join("figure-errors.svg"), plot::panels(&errors)?.as_bytes())
}

/// Figures 9 to 11: histograms of all errors, and their spread in each trial.
pub fn trials(folder: &Path, robot: &Robot, trials: &[TrialErrors]) -> Result<()> {
    let (mut histograms, mut boxes) = (Vec::new(), Vec::new());
    for (j, joint) in robot.joints.iter().enumerate().take(3) {
        let (unit, scale) = joint.display_unit();
        let values = |trial: &TrialErrors, e: usize| trial[j][e].iter().map(|(_, error)| error * scale).collect::<Vec<f64>>();
        let all = |e: usize| (ESTIMATES[e].to_owned(), trials.iter().flat_map(|trial| values(trial, e)).collect());
        let (title, x_label) = (joint.name.clone(), format!("error [{unit}]"));
        histograms.push(Histogram { title: title.clone(), x_label, series: SHOWN.map(all).into() });
        let spread = |trial: &TrialErrors, e| Spread::of(&values(trial, e).iter().map(|v| v.abs()).collect::<Vec<_>>());
        let series = SHOWN.map(|e| (ESTIMATES[e].to_owned(), trials.iter().map(|trial| spread(trial, e)).collect()));
        boxes.push(Boxes {
            title,
            x_label: "trial".to_owned(),
            y_label: format!("|error| [{unit}]"),
            groups: (1..=trials.len()).map(|trial| trial.to_string()).collect(),
            series: series.into(),
        });
    }
    files::write_atomic(&folder.join("figure-histograms.svg"), plot::histograms(&histograms)?.as_bytes())?;
    files::write_atomic(&folder.join("figure-trials.svg"), plot::boxes(&boxes)?.as_bytes())
}

/// Figures 12 and 13: spread of the errors over occlusion.
pub fn occlusion(folder: &Path, robot: &Robot, runs: &[Run]) -> Result<()> {
    let plots: Vec<Boxes> = robot
        .joints
        .iter()
        .enumerate()
        .take(3)
        .map(|(j, joint)| Boxes {
            title: joint.name.clone(),
            x_label: "marker hidden [%]".to_owned(),
            y_label: format!("|error| [{}]", joint.display_unit().0),
            groups: SHARES.iter().map(|share| format!("{:.0}", 100.0 * share)).collect(),
            series: WAYS
                .iter()
                .zip(runs.chunks(SHARES.len()))
                .map(|((name, ..), runs)| ((*name).to_owned(), runs.iter().map(|run| run.spread[j]).collect()))
                .collect(),
        })
        .collect();
    files::write_atomic(&folder.join("figure-occlusion.svg"), plot::boxes(&plots)?.as_bytes())
}
