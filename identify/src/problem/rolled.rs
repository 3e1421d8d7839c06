//! What takes rollouts: how far from rest the joints are, kept as long as the unknowns stay where they are, and columns of the Jacobian, kept as
//! long as they hardly move.

use std::collections::BTreeMap;
use std::sync::{MutexGuard, PoisonError};

use nalgebra::{DVector, Vector3};
use raven::Result;
use rayon::prelude::*;

use super::Problem;
use crate::batch::forward_difference;
use crate::parameters::Quantity;
use crate::prediction::Predictor;

/// How far the unknowns may move before columns that take rollouts are computed anew: the part of a positive one, the latency [s], and the
/// prior deviations of the rest. A column is then off by a twentieth at most, and the estimate by a twentieth of its deviation.
const PART_HELD: f64 = 0.05;
const LATENCY_HELD_S: f64 = 2e-3;
const REST_HELD: f64 = 0.5;

/// What took rollouts.
#[derive(Debug, Default)]
pub(super) struct Rolled {
    /// How far from rest the joints are [rad, rad, m], and where.
    lag: Option<(DVector<f64>, Vec<Vector3<f64>>)>,
    columns: Columns,
}

/// Columns of the Jacobian [m], by unknown, and where.
#[derive(Debug, Clone, Default)]
struct Columns {
    z: Option<DVector<f64>>,
    by_unknown: BTreeMap<usize, Vec<Vector3<f64>>>,
}

impl Problem<'_> {
    /// How far from rest the joints are at `z` [rad, rad, m], per sighting: a solver looks several times at where it stands.
    pub(super) fn rolled_lag(&self, predictor: &Predictor, z: &DVector<f64>) -> Vec<Vector3<f64>> {
        if let Some((_, lag)) = self.rolled().lag.as_ref().filter(|(at, _)| at == z) {
            return lag.clone();
        }
        let lag = self.rollout(predictor);
        self.rolled().lag = Some((z.clone(), lag.clone()));
        lag
    }

    /// Columns by rollouts, one on each side of `z` being too much work.
    pub(super) fn rolled_columns(&self, z: &DVector<f64>, wanted: &[usize]) -> Result<BTreeMap<usize, Vec<Vector3<f64>>>> {
        let mut known = self.rolled().columns.clone();
        if !known.z.as_ref().is_some_and(|before| self.is_near(before, z)) {
            known = Columns { z: Some(z.clone()), by_unknown: BTreeMap::new() };
        }
        let missing: Vec<usize> = wanted.iter().copied().filter(|k| !known.by_unknown.contains_key(k)).collect();
        if !missing.is_empty() {
            let predictor = Predictor::new(&self.robot(z))?;
            let here = self.errors(&predictor, &self.lag(&predictor, z), z);
            let rolled = |z: &DVector<f64>| {
                let predictor = Predictor::new(&self.robot(z))?;
                Ok(self.errors(&predictor, &Some(self.rollout(&predictor)), z))
            };
            let column = |k: usize| Ok((k, forward_difference(rolled, &here, z, k)?));
            known.by_unknown.extend(missing.into_par_iter().map(column).collect::<Result<Vec<_>>>()?);
            self.rolled().columns.clone_from(&known);
        }
        Ok(wanted.iter().filter_map(|&k| Some((k, known.by_unknown.get(&k)?.clone()))).collect())
    }

    /// The lock is never held while others may work.
    fn rolled(&self) -> MutexGuard<'_, Rolled> {
        self.rolled.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether columns at `a` may stand for those at `b`.
    fn is_near(&self, a: &DVector<f64>, b: &DVector<f64>) -> bool {
        self.unknowns.iter().zip((a - b).iter()).all(|(unknown, z)| match unknown.quantity {
            Quantity::Latency => unknown.spread * z.abs() <= LATENCY_HELD_S,
            quantity if quantity.is_positive() => unknown.spread * z.abs() <= PART_HELD,
            _ => z.abs() <= REST_HELD,
        })
    }
}
