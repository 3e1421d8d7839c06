//! What a filter knows at the end, in units of prior deviations, and what becomes of unknowns that the logs did not determine.

use nalgebra::{DMatrix, DVector};

use crate::batch::IDENTIFIED_BELOW;

/// A normal distribution of `z`, some of which may be held at their prior.
pub struct Posterior {
    /// Mean; 0 where held.
    pub z: DVector<f64>,
    covariance: DMatrix<f64>,
    held: Vec<bool>,
}

impl Posterior {
    /// With nothing held.
    pub fn new(z: DVector<f64>, covariance: DMatrix<f64>) -> Self {
        let held = vec![false; z.len()];
        Self { z, covariance, held }
    }

    /// Puts unknowns back to their prior, those that are `held` whatever the log says and then the worst, until all that may be held and is free is
    /// identified. Information that neighbours share was counted `tempering` times too often; priors were not.
    ///
    /// The rest moves as if the held ones had been known to be there, `z_f - P_fh P_hh^-1 z_h`, and its covariance gains what the prior
    /// deviations of the held ones amount to (consider covariance; Tapley, Schutz, Born 2004, section 6).
    pub fn held_at_priors(&self, may_hold: &[bool], held: &[usize], tempering: f64) -> Self {
        let n = self.z.len();
        let mut held = held.to_vec();
        loop {
            let (z, conditional, along) = self.given(&held);
            let std = |k: usize| (tempering * conditional[(k, k)].max(0.0)).sqrt();
            let worst = (0..n).filter(|k| may_hold[*k] && !held.contains(k)).max_by(|a, b| std(*a).total_cmp(&std(*b)));
            match worst.filter(|k| std(*k) > IDENTIFIED_BELOW) {
                Some(k) => held.push(k),
                None => {
                    let mut covariance = conditional * tempering + &along * along.transpose();
                    for &k in &held {
                        covariance.row_mut(k).fill(0.0);
                        covariance.column_mut(k).fill(0.0);
                        covariance[(k, k)] = self.covariance[(k, k)] * tempering;
                    }
                    return Self { z, covariance, held: (0..n).map(|k| held.contains(&k)).collect() };
                }
            }
        }
    }

    /// Mean and covariance given that `held` are at their priors, and how the others move with them.
    fn given(&self, held: &[usize]) -> (DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
        let across = self.covariance.select_columns(held);
        let within = across.select_rows(held);
        let Some(inverse) = within.cholesky().map(|factor| factor.inverse()) else {
            return (self.z.clone(), self.covariance.clone(), across);
        };
        let along = &across * inverse;
        let mut z = &self.z - &along * self.z.select_rows(held);
        held.iter().for_each(|&k| z[k] = 0.0);
        let conditional = &self.covariance - &along * across.transpose();
        (z, conditional, along)
    }

    /// Standard deviations.
    pub fn std(&self) -> Vec<f64> {
        // Never wider than the prior.
        self.covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt().min(1.0)).collect()
    }

    /// Covariance, with the deviations of [`Self::std`].
    pub fn covariance(&self) -> DMatrix<f64> {
        let std = self.std();
        let scale = DVector::from_fn(std.len(), |k, _| std[k] / self.covariance[(k, k)].max(f64::MIN_POSITIVE).sqrt());
        DMatrix::from_fn(std.len(), std.len(), |k, l| scale[k] * scale[l] * self.covariance[(k, l)])
    }

    /// Which unknowns the logs determined.
    pub fn identified(&self, std: &[f64]) -> Vec<bool> {
        std.iter().zip(&self.held).map(|(&std, &held)| !held && std <= IDENTIFIED_BELOW).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn holding_one_of_a_tied_pair_moves_the_other_and_widens_it() {
        // Only the sum a + b is known, to 0.1: P = 1 - h h' / (h'h + r).
        let h = DVector::from_vec(vec![1.0, 1.0, 0.0]);
        let covariance = DMatrix::identity(3, 3) - &h * h.transpose() / (2.0 + 0.01);
        let posterior = Posterior::new(&covariance * &h * 2.0 / 0.01, covariance.clone());
        let free = posterior.held_at_priors(&[false, true, true], &[], 1.0);
        assert_eq!(free.held, [false, true, true]);
        assert_relative_eq!(free.z[0], 2.0, epsilon = 0.05);
        assert_eq!((free.z[1], free.z[2]), (0.0, 0.0));
        // a = (a + b) - b: the sum's 0.1 and the prior deviation of b.
        assert_relative_eq!(free.std()[0], 1.0, epsilon = 0.01);
        assert_eq!(free.identified(&[0.1, 0.1, 0.1]), [true, false, false]);
        let of_all = free.covariance();
        assert_eq!((of_all[(0, 1)], of_all[(2, 1)]), (0.0, 0.0), "held ones count as unrelated");
        assert!(of_all.cholesky().is_some());
    }

    #[test]
    fn what_is_known_stays_as_it_is() {
        let z = DVector::from_vec(vec![0.3, -1.0]);
        let covariance = DMatrix::from_row_slice(2, 2, &[0.04, 0.01, 0.01, 0.09]);
        let same = Posterior::new(z.clone(), covariance).held_at_priors(&[true, true], &[], 2.0);
        assert_eq!(same.z, z);
        assert_relative_eq!(same.std()[1], 0.18_f64.sqrt(), epsilon = 1e-12);
    }

    #[test]
    fn what_neighbours_share_makes_unknowns_less_sure_and_not_the_priors_of_those_that_are_held() {
        // The second is known to 0.3 and takes 0.3 of what the third, which nothing is known of, is off.
        let covariance = DMatrix::from_row_slice(3, 3, &[0.04, 0.0, 0.0, 0.0, 0.18, 0.3, 0.0, 0.3, 1.0]);
        let z = DVector::from_vec(vec![0.2, 0.5, 1.0]);
        let held = |tempering: f64| Posterior::new(z.clone(), covariance.clone()).held_at_priors(&[true; 3], &[], tempering);
        let sure = held(2.0);
        assert_eq!(sure.held, [false, false, true]);
        assert_relative_eq!(sure.z[1], 0.2, epsilon = 1e-12);
        // What is left of 0.18 given the third, twice, and what that may be off by, once.
        assert_relative_eq!(sure.std()[1], (2.0 * 0.09_f64 + 0.09).sqrt(), epsilon = 1e-12);
        // Of a third of the information it is no longer identified, and stays where it was believed to be.
        let doubted = held(3.0);
        assert_eq!((doubted.held.as_slice(), doubted.z[1]), ([false, true, true].as_slice(), 0.0));
        assert_eq!(doubted.identified(&doubted.std()), [true, false, false]);
    }
}
