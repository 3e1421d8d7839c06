//! What recordings say of the robot file's own numbers: those that are off by more than the file allows them, whatever the verdict.

use serde::Serialize;

use super::Estimate;
use super::conclusion::estimate;
use crate::evidence::fit::{Fitter, Hypothesis};

/// A number is moved if it is off by more than so many of its tolerances, and of what it scatters by.
const TOLERANCES: f64 = 1.0;
const DEVIATIONS: f64 = 2.0;

/// A number of the robot file that recordings move.
#[derive(Debug, Clone, Serialize)]
pub struct FileNumber {
    /// The effect that it would be if it were off by far more.
    pub id: &'static str,
    /// Joint, `from->to`, `12` or `23`; nothing for the whole.
    pub joint: Option<String>,
    /// Where it is best, on top of what the file has or as a factor on it.
    #[serde(flatten)]
    pub estimate: Estimate,
    /// By how many of its tolerances it is off.
    pub tolerances: f64,
}

/// The numbers that a hypothesis moves and that no effect of it is about, farthest first; with the deviations of its free coordinates.
pub(super) fn file_numbers(fitter: &Fitter, hypothesis: &Hypothesis, deviations: &[f64]) -> Vec<FileNumber> {
    let coordinates = fitter.coordinates;
    let of = |(&c, &std): (&usize, &f64)| {
        let coordinate = coordinates.all[c];
        let tolerance = coordinates.tolerance(c).filter(|_| coordinates.is_of_file(c, &hypothesis.effects))?;
        let (sited, u) = (&coordinates.sited[coordinate.effect], hypothesis.u[c]);
        let is_moved = u.abs() > TOLERANCES * tolerance && u.abs() > DEVIATIONS * std;
        is_moved.then(|| FileNumber {
            id: sited.effect.id,
            joint: sited.joint(fitter.rows.robot()),
            estimate: estimate(fitter, hypothesis, c, std),
            tolerances: u / tolerance,
        })
    };
    let mut moved: Vec<FileNumber> = hypothesis.free.iter().zip(deviations).filter_map(of).collect();
    moved.sort_by(|a, b| b.tolerances.abs().total_cmp(&a.tolerances.abs()));
    moved
}
