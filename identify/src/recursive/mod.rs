//! Estimating the parameters while the log goes by: the paper's dual filter, and the joint one (Haghighipanah et al. 2017, section II).
//!
//! Both carry the links' six states and the parameters; the dual filter in two filters that take turns, the joint one in a single filter.
//! The parameters are constants in units of their prior deviation, start at their prior `N(0, 1)` and have no process noise, so a
//! parameter that the motion does not excite keeps its deviation instead of winding up. An image shows the links at its stamp less the
//! latency; a state is that of the links at the instant an image shows, so that the latency is a parameter like any other.

mod dual;
mod joint;
mod links;
mod posterior;
mod scatter;
mod trace;

use nalgebra::Matrix3;
use raven::Result;
use raven::stats::chi_square_quantile;

pub use dual::Horizon;
pub use trace::{Trace, TracePoint};

use crate::batch::{Estimate, Residuals};
use crate::misfit::FALSE_CHANCE;
use crate::problem::Problem;

/// How the filters share the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sharing {
    /// A filter for the states and one for the parameters, which predicts over the given horizon.
    Dual(Horizon),
    /// One filter for both.
    Joint,
}

/// Pause between sightings [s] after which the links start anew where the cables hold them: long after they forgot where they were.
const FORGOTTEN_S: f64 = 1.0;

/// Estimates recursively; also what was believed after every sighting.
///
/// # Errors
/// If the model cannot be evaluated at the outcome.
pub fn estimate(problem: &mut Problem, sharing: Sharing) -> Result<(Estimate, Trace)> {
    Passed::over(problem, sharing)?.estimate(problem, &[])
}

/// Logs that the filters have gone over, before anything is held.
pub(crate) struct Passed(Run);

impl Passed {
    /// Lets the filters go over the logs.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(crate) fn over(problem: &mut Problem, sharing: Sharing) -> Result<Self> {
        let mut run = pass(problem, sharing)?;
        if problem.is_beside() {
            // Flaws are those about the first pass's outcome.
            problem.look_from(&run.posterior.z)?;
            run = Run { trace: run.trace, ..pass(problem, sharing)? };
        }
        Ok(Self(run))
    }

    /// The estimate, with unknowns that are `held` at their prior whatever the logs say.
    ///
    /// # Errors
    /// If the model cannot be evaluated at the outcome.
    pub(crate) fn estimate(&self, problem: &mut Problem, held: &[usize]) -> Result<(Estimate, Trace)> {
        let Self(Run { posterior, scatter, trace }) = self;
        let tempering = scatter.tempering();
        let posterior = posterior.held_at_priors(&problem.may_hold(), held, tempering);
        problem.adopt(scatter.misfit(), &posterior.z)?;
        let residuals = problem.residuals(&posterior.z)?;
        let std = posterior.std();
        let (identified, covariance) = (posterior.identified(&std), posterior.covariance());
        let estimate = Estimate { z: posterior.z, std, covariance, identified, residuals, scale: 1.0, tempering };
        Ok((estimate, trace.widened(tempering)))
    }
}

fn pass(problem: &Problem, sharing: Sharing) -> Result<Run> {
    match sharing {
        Sharing::Dual(horizon) => dual::run(problem, horizon),
        Sharing::Joint => joint::run(problem),
    }
}

/// What a pass over the logs leaves.
struct Run {
    posterior: posterior::Posterior,
    scatter: scatter::Scatter,
    trace: Trace,
}

/// Normalised square beyond which a sighting counts as false.
fn gate() -> Option<f64> {
    chi_square_quantile(3, 1.0 - FALSE_CHANCE)
}

/// Lower-triangular factor of a covariance, if it is one.
fn root(covariance: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    Some(covariance.cholesky()?.l())
}
