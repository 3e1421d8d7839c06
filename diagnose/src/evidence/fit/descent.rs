//! Down a hypothesis' cost: Levenberg-Marquardt on exact residuals.
//!
//! ```text
//! F(u) = |r(u)|^2 / 2 + |u / t|^2 / 2,   (J'J + L + m D) d = J' r - L u,   L = diag(t^-2), D = diag(J'J + L)
//! ```
//!
//! (Nocedal and Wright 2006, chapter 10.)

use nalgebra::{DMatrix, DVector};
use raven::Result;

use super::linear::{Quadratic, dot};
use super::{Fitter, cost};

/// A fit has converged when the next step promises, or the last one brought, less than this [nat], or than this part of the cost: causes that are
/// the same are told apart by what is between fits by slopes of rolled-out links.
const PROMISE_MIN: f64 = 0.05;
const PART_MIN: f64 = 1e-4;
const CLOSE_PART_MIN: f64 = 1e-5;
/// Damping at the start, and the most before a fit gives up: slopes of settled links do not promise more than they can keep.
const DAMPING: [f64; 2] = [1e-4, 10.0];
/// How many times as much is tried next.
const MORE_DAMPING: f64 = 30.0;

/// Where the next step goes by slopes, before it is damped.
pub(super) struct Direction {
    gradient: DVector<f64>,
    curvature: DMatrix<f64>,
}

impl Direction {
    /// Keeps free numbers where they are.
    pub(super) fn hold(&mut self, held: &[usize]) {
        for &k in held {
            self.gradient[k] = 0.0;
            self.curvature.row_mut(k).fill(0.0);
            self.curvature.column_mut(k).fill(0.0);
            self.curvature[(k, k)] = 1.0;
        }
    }

    /// What the whole step promises [nat]; `None` where slopes are not finite.
    fn promise(&self) -> Option<f64> {
        let whole = self.curvature.clone().cholesky()?.solve(&self.gradient);
        Some(0.5 * self.gradient.dot(&whole))
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let damped = &self.curvature + DMatrix::from_diagonal(&(self.curvature.diagonal() * damping));
        Some(damped.cholesky()?.solve(&self.gradient))
    }
}

/// A fit on its way.
pub(super) struct Descent<'f> {
    fitter: &'f Fitter<'f>,
    free: &'f [usize],
    precision: &'f DVector<f64>,
    /// All coordinates.
    pub(super) u: Vec<f64>,
    /// Whitened residuals there.
    pub(super) residuals: Vec<f64>,
    /// `F` there [nat].
    pub(super) cost: f64,
    damping: f64,
    part_min: f64,
}

impl<'f> Descent<'f> {
    /// From a start; `None` where nothing is finite.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn begun(
        fitter: &'f Fitter<'f>,
        free: &'f [usize],
        precision: &'f DVector<f64>,
        start: &[f64],
        closely: bool,
    ) -> Result<Option<Self>> {
        let residuals = fitter.exact(start)?;
        let cost = cost(free, precision, start, &residuals);
        Ok(cost.is_finite().then(|| Self {
            fitter,
            free,
            precision,
            u: start.to_vec(),
            residuals,
            cost,
            damping: DAMPING[0],
            part_min: if closely { CLOSE_PART_MIN } else { PART_MIN },
        }))
    }

    /// Where to go from here.
    pub(super) fn direction(&self, model: &Quadratic) -> Direction {
        let at = DVector::from_iterator(self.free.len(), self.free.iter().map(|&c| self.u[c]));
        Direction {
            gradient: &model.score - self.precision.component_mul(&at),
            curvature: &model.information + DMatrix::from_diagonal(self.precision),
        }
    }

    /// A step, damped until it goes down; the next one is damped less, and if the fit `remembers` not much less where more was needed. How far it
    /// went down [nat]; `None` where slopes are not finite.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn step(&mut self, direction: &Direction, remembers: bool) -> Result<Option<f64>> {
        let Some(promise) = direction.promise() else { return Ok(None) };
        let begun_with = self.damping;
        while promise > self.least() && !self.is_stuck() {
            let Some(step) = direction.step(self.damping) else { return Ok(None) };
            let mut moved = self.u.clone();
            for (k, &c) in self.free.iter().enumerate() {
                moved[c] = self.fitter.stepped(c, self.u[c], step[k]);
            }
            let before = self.cost;
            if self.take(moved, |there, here| there.cost < here.cost)? {
                let took_more = remembers && self.damping > begun_with;
                self.damping = (self.damping / if took_more { 3.0 } else { MORE_DAMPING }).max(1e-9);
                return Ok(Some(before - self.cost));
            }
            self.damping *= MORE_DAMPING;
        }
        Ok(Some(0.0))
    }

    /// Moves moments to miscounts that readings alone show, where that explains no less: what was believed of a moment beforehand does not matter.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn settle_on_miscounts(&mut self) -> Result<()> {
        for &c in self.free {
            let Some(nearest) = self.fitter.nearest_miscount(c, self.u[c]) else { continue };
            let mut at_miscount = self.u.clone();
            at_miscount[c] = nearest;
            self.take(at_miscount, |there, here| dot(there.residuals, there.residuals) <= dot(here.residuals, here.residuals))?;
        }
        Ok(())
    }

    /// Less than this is not worth a step [nat].
    pub(super) fn least(&self) -> f64 {
        PROMISE_MIN.max(self.part_min * self.cost)
    }

    /// Whether no step goes down, however damped.
    pub(super) fn is_stuck(&self) -> bool {
        self.damping >= DAMPING[1]
    }

    /// Begins anew with little damping.
    pub(super) fn loosen(&mut self) {
        self.damping = DAMPING[0];
    }

    /// Moves to `u` if it is better there than here.
    fn take(&mut self, u: Vec<f64>, is_better: impl Fn(&Place, &Place) -> bool) -> Result<bool> {
        let residuals = self.fitter.exact(&u)?;
        let there = Place { cost: cost(self.free, self.precision, &u, &residuals), residuals: &residuals };
        let takes = is_better(&there, &Place { cost: self.cost, residuals: &self.residuals });
        if takes {
            (self.cost, self.u, self.residuals) = (there.cost, u, residuals);
        }
        Ok(takes)
    }
}

/// What two places are compared by.
struct Place<'a> {
    cost: f64,
    residuals: &'a [f64],
}
