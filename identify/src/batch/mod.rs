//! Batch estimation: all sightings at once, the most probable values, and how well they are known.
//!
//! What the log does not determine goes back to its prior: an unknown of the robot whose posterior deviation is more than half of its
//! prior one is not identified. The worst of them is held at its prior and the rest estimated again, until all that is left is
//! identified, so that the numbers written together belong together; the deviations then carry the held ones' uncertainty. Corrections
//! of the registration are never held: they are nothing the controller loads, and without them the robot would have to make up for a
//! turned camera. Nor is what the information, if not its scatter, tells from its prior: a loop that turns once shows how, if not how well.

mod covariance;
mod gauss_newton;
mod robust;

use nalgebra::{DMatrix, DVector, Vector3};
use raven::Result;
use rayon::prelude::*;

use covariance::Curvature;
use gauss_newton::minimize;
pub use gauss_newton::{DIFFERENCE, Jacobian, central_difference, forward_difference};
pub use robust::Cauchy;

/// Ratio of posterior to prior deviation above which a log has not determined a quantity.
pub const IDENTIFIED_BELOW: f64 = 0.5;
/// Deviations by the information alone beyond which an unknown is not at its prior.
const NOT_AT_PRIOR: f64 = 3.0;
/// Relative change of the tempering that is worth another estimation, and how often.
const TEMPERING_SETTLED: f64 = 0.1;
const TEMPERINGS_MAX: usize = 4;

/// A problem with whitened three-dimensional residuals in unknowns of which each has the prior `N(0, 1)`.
pub trait Residuals: Sync {
    /// Number of unknowns.
    fn unknowns(&self) -> usize;

    /// Unknown `k`, kept where it can be. The prior itself can be.
    fn bounded(&self, _k: usize, z: f64) -> f64 {
        z
    }

    /// Values of unknown `k` on both sides of one, from which derivatives are taken there.
    fn around(&self, _k: usize, z: f64) -> [f64; 2] {
        [z - DIFFERENCE, z + DIFFERENCE]
    }

    /// Residuals at `z`, of unit covariance if model and noise are as believed.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>>;

    /// Derivatives of the residuals by the unknowns in `columns`: central differences, in parallel.
    ///
    /// # Errors
    /// As the residuals.
    fn jacobian(&self, z: &DVector<f64>, columns: &[usize]) -> Result<Jacobian> {
        columns.par_iter().map(|&k| central_difference(|z| self.residuals(z), z, k, self.around(k, z[k]))).collect()
    }

    /// The block of time of each residual, counted from 0 without holes; residuals within one may be alike.
    fn blocks(&self) -> Vec<usize>;
}

/// What a batch found out, per unknown in units of its prior deviation.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Most probable values; 0 where held.
    pub z: DVector<f64>,
    /// Standard deviations; of a held unknown what the log left of its prior's.
    pub std: Vec<f64>,
    /// Their covariance; held unknowns count as unrelated to the others.
    pub covariance: DMatrix<f64>,
    /// Whether the log determined it.
    pub identified: Vec<bool>,
    /// Whitened residuals at the estimate.
    pub residuals: Vec<Vector3<f64>>,
    /// By how much the residuals exceed their covariance, at least 1.
    pub scale: f64,
    /// By how much residuals of one block are alike: information was divided by it. At least 1.
    pub tempering: f64,
}

/// The most probable values if residuals are independent, from `start`.
///
/// # Errors
/// As [`estimate`].
pub fn most_probable(problem: &impl Residuals, start: &DVector<f64>) -> Result<DVector<f64>> {
    let all: Vec<usize> = (0..problem.unknowns()).collect();
    minimize(problem, &all, 1.0, start).map(|minimum| minimum.z)
}

/// Estimates, from `start`; unknowns of which `may_hold` is false are kept free even if they are not identified, and those that are `held` stay at their
/// prior whatever the log says.
///
/// # Errors
/// If the model cannot be evaluated or the estimation does not settle.
pub fn estimate(problem: &impl Residuals, may_hold: &[bool], held: &[usize], start: &DVector<f64>) -> Result<Estimate> {
    let n = problem.unknowns();
    let block = problem.blocks();
    let mut std = vec![1.0; n];
    let mut held = held.to_vec();
    let mut free: Vec<usize> = (0..n).filter(|k| !held.contains(k)).collect();
    let mut z = start.clone();
    held.iter().for_each(|&k| z[k] = 0.0);
    let mut tempering = 1.0;
    loop {
        let (minimum, curvature) = tempered(problem, &free, &block, &mut tempering, &z)?;
        z.clone_from(&minimum.z);
        let among_free = curvature.covariance(&free, &held);
        for (i, &k) in free.iter().enumerate() {
            std[k] = among_free[(i, i)].sqrt();
        }
        let by_information = curvature.std_by_information(&free);
        let is_lost = |(k, by_information): &(usize, &f64)| {
            may_hold[*k] && std[*k] > IDENTIFIED_BELOW && z[*k].abs() <= NOT_AT_PRIOR * **by_information
        };
        let lost = free.iter().copied().zip(&by_information).filter(is_lost).map(|(k, _)| k);
        let worst = lost.max_by(|&a, &b| std[a].total_cmp(&std[b]));
        let Some(worst) = worst else {
            let identified = (0..n).map(|k| !held.contains(&k) && std[k] <= IDENTIFIED_BELOW).collect();
            let mut covariance = DMatrix::from_diagonal(&DVector::from_iterator(n, std.iter().map(|std| std * std)));
            for (i, &k) in free.iter().enumerate() {
                free.iter().enumerate().for_each(|(j, &l)| covariance[(k, l)] = among_free[(i, j)]);
            }
            return Ok(Estimate { z, std, covariance, identified, residuals: minimum.residuals, scale: minimum.loss.scale, tempering });
        };
        free.retain(|&k| k != worst);
        held.push(worst);
    }
}

/// A minimum whose tempering is that of its own residuals.
fn tempered(
    problem: &impl Residuals,
    free: &[usize],
    block: &[usize],
    tempering: &mut f64,
    start: &DVector<f64>,
) -> Result<(gauss_newton::Minimum, Curvature)> {
    let mut start = start.clone();
    let all: Vec<usize> = (0..problem.unknowns()).collect();
    let mut round = 0;
    loop {
        let minimum = minimize(problem, free, *tempering, &start)?;
        let jacobian = problem.jacobian(&minimum.z, &all)?;
        let curvature = Curvature::new(&minimum, &jacobian, block, *tempering);
        let wanted = (*tempering * curvature.overdispersion(free)).max(1.0);
        round += 1;
        if (wanted / *tempering - 1.0).abs() <= TEMPERING_SETTLED || round == TEMPERINGS_MAX {
            return Ok((minimum, curvature));
        }
        *tempering = wanted;
        start.clone_from(&minimum.z);
    }
}

#[cfg(test)]
mod tests;
