//! Columns of the Jacobian that take rollouts: kept as long as the unknowns hardly move.

use std::collections::BTreeMap;
use std::sync::PoisonError;

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

/// Columns of the Jacobian that took rollouts, by unknown.
#[derive(Debug, Clone, Default)]
pub(super) struct Rolled {
    z: Option<DVector<f64>>,
    columns: BTreeMap<usize, Vec<Vector3<f64>>>,
}

impl Problem<'_> {
    /// Columns by rollouts, one on each side of `z` being too much work.
    pub(super) fn rolled_columns(&self, z: &DVector<f64>, wanted: &[usize]) -> Result<BTreeMap<usize, Vec<Vector3<f64>>>> {
        let rolled = |z: &DVector<f64>| {
            let predictor = Predictor::new(&self.robot(z))?;
            Ok(self.errors(&predictor, &self.lag(&predictor), z))
        };
        // The lock is never held while others may work.
        let mut known = self.rolled.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if !known.z.as_ref().is_some_and(|before| self.is_near(before, z)) {
            known = Rolled { z: Some(z.clone()), columns: BTreeMap::new() };
        }
        let missing: Vec<usize> = wanted.iter().copied().filter(|k| !known.columns.contains_key(k)).collect();
        if !missing.is_empty() {
            let here = rolled(z)?;
            let column = |k: usize| Ok((k, forward_difference(rolled, &here, z, k)?));
            known.columns.extend(missing.into_par_iter().map(column).collect::<Result<Vec<_>>>()?);
            self.rolled.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&known);
        }
        Ok(wanted.iter().filter_map(|&k| Some((k, known.columns.get(&k)?.clone()))).collect())
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
