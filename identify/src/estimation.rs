//! Estimation with weights of its own: the batch and the joints' unexplained scatter in turn, until the scatter settles.

use nalgebra::Vector3;
use raven::Result;

use crate::batch::{self, Estimate};
use crate::prediction::Problem;
use crate::scatter::{Sample, joint_scatter};

/// Relative change of the scatter that is worth another estimation, and how often.
const SCATTER_SETTLED: f64 = 0.05;
const ROUNDS_MAX: usize = 8;

/// What was estimated, and what was left.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Parameters.
    pub estimate: Estimate,
    /// Standard deviations of what the model does not explain at the joints [rad, rad, m].
    pub scatter: Vector3<f64>,
    /// Residuals at the estimate.
    pub samples: Vec<Sample>,
}

/// Estimates the unknowns of `problem`; those of which `may_hold` is false are kept free even if they are not identified.
///
/// # Errors
/// If the model cannot be evaluated or the estimation does not settle.
pub fn estimate(problem: &mut Problem<'_>, may_hold: &[bool]) -> Result<Outcome> {
    let mut round = 0;
    let mut last: Option<Vector3<f64>> = None;
    loop {
        let estimate = batch::estimate(problem, may_hold)?;
        let samples = problem.samples(&estimate.z)?;
        let scatter = joint_scatter(&samples);
        round += 1;
        let settled = last.is_some_and(|last| (0..3).all(|j| (scatter[j] - last[j]).abs() <= SCATTER_SETTLED * last[j].max(1e-6)));
        if settled || round == ROUNDS_MAX {
            return Ok(Outcome { estimate, scatter, samples });
        }
        problem.weigh(&samples, &scatter);
        last = Some(scatter);
    }
}
