//! Whether the numbers of the file that nobody asked for need be off at all.
//!
//! The sightings are fitted twice, with these numbers as the file has them and off within their tolerances. Where the first fit lies among what the
//! second holds for possible, it is the one to take: numbers that are written into a file are used with the others in it, and a model that lacks something
//! puts that into whatever is free. What is claimed of it is what the second leaves unknown, and how far the two are apart:
//!
//! ```text
//! 2 (F(z) - F(z_within)) <= chi^2_m(0.99),   P = P_within + (z - z_within) (z - z_within)'
//! ```
//!
//! with the most probable `z` of the file as it is, that within its `m` tolerances, and `F` what the second minimises. Of numbers that the robot's controller has,
//! those of which both leave too much unknown stay as they were, and the first fit is made anew without them; the others stay as fitted, for what
//! follows the links is best with all of a fit.

use nalgebra::DVector;
use raven::stats::chi_square_quantile;
use raven::{Error, Result};

use crate::batch::{Cauchy, Estimate, IDENTIFIED_BELOW, Residuals};
use crate::problem::Problem;
use crate::recursive::{Passed, Sharing, Trace};

/// Part of what is possible within the tolerances among which the file must be.
const POSSIBLE: f64 = 0.99;

/// A fit, and the problem as it stands there.
#[derive(Debug, Clone)]
pub struct Fit<'a> {
    /// With the tolerances among its unknowns.
    pub problem: Problem<'a>,
    /// What was found.
    pub estimate: Estimate,
    /// What a recursive method believed after every sighting.
    pub trace: Option<Trace>,
    /// Whether the file's other numbers are left as they are.
    pub as_filed: bool,
}

/// Fits a problem without tolerances by batch, or recursively, and takes its file as it is where that is possible.
///
/// # Errors
/// If the model cannot be evaluated or the estimation within the tolerances does not settle.
pub fn fit(problem: Problem<'_>, sharing: Option<Sharing>) -> Result<Fit<'_>> {
    let mut within = problem.clone().with_tolerances()?;
    let (found, trace) = Settled::of(&mut within, sharing)?.estimate(&mut within, &[])?;
    if let Some(fit) = as_filed(problem, sharing, &within, &found)? {
        return Ok(fit);
    }
    Ok(Fit { problem: within, estimate: found, trace, as_filed: false })
}

/// The fit of the file as it is; `None` where it does not settle, or is not among what the other one, within the tolerances, holds for possible.
fn as_filed<'a>(mut filed: Problem<'a>, sharing: Option<Sharing>, within: &Problem<'a>, found: &Estimate) -> Result<Option<Fit<'a>>> {
    let settled = match Settled::of(&mut filed, sharing) {
        // What is off by much is fitted by nothing before that is free.
        Err(Error::Unsettled { .. }) => return Ok(None),
        settled => settled?,
    };
    let unknowns = within.unknowns();
    let mut held: Vec<usize> = Vec::new();
    loop {
        let (of_file, trace) = match settled.estimate(&mut filed, &held) {
            Err(Error::Unsettled { .. }) => return Ok(None),
            of_file => of_file?,
        };
        let mut z = DVector::zeros(found.z.len());
        z.rows_mut(0, of_file.z.len()).copy_from(&of_file.z);
        if !is_possible(within, found, &z)? {
            return Ok(None);
        }
        let estimate = claimed(of_file, found, z);
        let is_of_controller = |k: &usize| unknowns[*k].quantity.is_of_controller();
        let has_moved = |k: &usize| is_of_controller(k) && !estimate.identified[*k] && estimate.z[*k] != 0.0;
        match (0..unknowns.len()).filter(has_moved).max_by(|&a, &b| estimate.std[a].total_cmp(&estimate.std[b])) {
            Some(worst) => held.push(worst),
            None => {
                let problem = filed.with_tolerances_of(within, &estimate.z)?;
                return Ok(Some(Fit { problem, estimate, trace, as_filed: true }));
            }
        }
    }
}

/// Where a fit comes to before anything is held, by batch or recursively.
enum Settled {
    Batch(DVector<f64>),
    Recursive(Passed),
}

impl Settled {
    fn of(problem: &mut Problem, sharing: Option<Sharing>) -> Result<Self> {
        Ok(match sharing {
            None => Self::Batch(problem.settled()?),
            Some(sharing) => Self::Recursive(Passed::over(problem, sharing)?),
        })
    }

    /// The estimate with some unknowns at their prior, and what a recursive method believed after every sighting.
    fn estimate(&self, problem: &mut Problem, held: &[usize]) -> Result<(Estimate, Option<Trace>)> {
        Ok(match self {
            Self::Batch(z) => (problem.estimate_from(z, held)?, None),
            Self::Recursive(passed) => {
                let (estimate, trace) = passed.estimate(problem, held)?;
                (estimate, Some(trace))
            }
        })
    }
}

fn is_possible(within: &Problem, found: &Estimate, z: &DVector<f64>) -> Result<bool> {
    let loss = Cauchy { scale: found.scale };
    let cost = |z: &DVector<f64>| -> Result<f64> {
        let data: f64 = within.residuals(z)?.iter().map(|residual| loss.loss(residual)).sum();
        Ok(data / found.tempering + 0.5 * z.norm_squared())
    };
    let limit = chi_square_quantile(within.tolerances(), POSSIBLE).unwrap_or(0.0);
    Ok(2.0 * (cost(z)? - cost(&found.z)?) <= limit)
}

/// The estimate of the file as it is with what is left unknown within its tolerances.
fn claimed(of_file: Estimate, within: &Estimate, z: DVector<f64>) -> Estimate {
    let apart = &z - &within.z;
    let covariance = &within.covariance + &apart * apart.transpose();
    let std: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.sqrt()).collect();
    let is_identified =
        |(k, &std): (usize, &f64)| of_file.identified.get(k).is_some_and(|&identified| identified) && std <= IDENTIFIED_BELOW;
    let identified = std.iter().enumerate().map(is_identified).collect();
    Estimate { z, std, covariance, identified, ..of_file }
}
