//! The smallest size of each effect that recordings could have shown, and how probable it is that one is there and too small for them.
//!
//! With an effect's slope `s` projected off the numbers of the nominal model, `S = s's - s'J (J'J + L)^-1 J's`, a size of `u` slabs raises
//! the evidence by `u^2 S^2 / (2 (S + 1)) - ln(1 + S) / 2` on average.
//!
//! An effect that is too small to show leaves the evidence as it is without. Sizes have no scale of their own before a recording is looked
//! at: every factor is as probable as any other (Jeffreys 1946), between what would be no effect and the largest that is to be expected.

use nalgebra::DVector;
use raven::Result;
use raven::effects::{Channel, Scale};
use rayon::prelude::*;
use serde::Serialize;

use crate::evidence::fit::{Fitter, gram};
use crate::evidence::linear::dot;
use crate::evidence::prior;
use crate::evidence::rows::Links;
use crate::evidence::search::Outcome;

/// The smallest size of an effect that would have been named.
#[derive(Debug, Clone, Serialize)]
pub struct Detectable {
    /// Identifier.
    pub id: &'static str,
    /// As of a cause.
    pub joint: Option<String>,
    /// Of its first number; of a factor, the one above 1. `null` where no size that is to be expected would have shown.
    pub size: Option<f64>,
    /// Unit of `size`.
    pub unit: String,
}

/// Evidence beyond the prior odds at which an effect counts as shown [nat].
const SHOWN_NATS: f64 = 3.0;
/// Smallest size that counts as an effect and largest that is to be expected, in slabs.
const SIZES: [f64; 2] = [0.03, 3.0];

/// The smallest size of one effect that would have been named.
pub(super) struct Smallest {
    effect: usize,
    /// Coordinate of its size.
    coordinate: usize,
    /// In slabs.
    u: f64,
}

impl Smallest {
    /// Probability that an effect is smaller, if it is there.
    pub(super) fn part_unseen(&self) -> f64 {
        let [least, largest] = SIZES;
        ((self.u / least).ln() / (largest / least).ln()).clamp(0.0, 1.0)
    }

    /// As reports have it.
    pub(super) fn detectable(&self, fitter: &Fitter) -> Detectable {
        let (sited, kind) = (fitter.coordinates.sited[self.effect], fitter.coordinates.kinds[self.effect]);
        let parameter = parameter(fitter, self.coordinate);
        Detectable {
            id: sited.effect.id,
            joint: sited.joint(fitter.rows.robot()),
            size: (self.u < SIZES[1]).then(|| parameter.value(self.u, kind)),
            unit: parameter.unit_at(kind).to_owned(),
        }
    }
}

pub(super) fn smallest(fitter: &Fitter, outcome: &Outcome) -> Result<Vec<Smallest>> {
    let (rows, coordinates, none) = (fitter.rows, fitter.coordinates, &outcome.none);
    let count = coordinates.sited.len();
    let wanted = SHOWN_NATS + prior::log(0, count) - prior::log(1, count);
    let all: Vec<&[f64]> = none.columns.iter().map(|column| column.as_slice()).collect();
    let mut curvature = gram(&all);
    for (k, &c) in none.free.iter().enumerate() {
        curvature[(k, k)] += fitter.prior(c, &[]).map_or(0.0, |t| t.powi(-2));
    }
    let here = rows.residuals(&coordinates.settings(&none.u), Links::Settled, &[Channel::Tip, Channel::Torque])?;
    let of_effect = |effect: usize| -> Result<Option<Smallest>> {
        let sited = coordinates.sited[effect];
        let own: Vec<usize> = coordinates.of(effect).collect();
        let kept: Vec<usize> = (0..none.free.len()).filter(|&k| !own.contains(&none.free[k])).collect();
        let Some(size) = own.iter().position(|&c| parameter(fitter, c).scale.is_size()) else {
            return Ok(None);
        };
        let mut u = none.u.clone();
        own.iter().for_each(|&c| u[c] = if matches!(parameter(fitter, c).scale, Scale::Moment) { 0.5 } else { 0.0 });
        u[own[size]] = 1.0;
        let channels = sited.effect.channels;
        let there = rows.residuals(&coordinates.settings(&u), Links::Settled, channels)?;
        let tip_rows = rows.tip_rows();
        let shows = |k: usize| channels.contains(if k < tip_rows { &Channel::Tip } else { &Channel::Torque });
        let slope: Vec<f64> = here.iter().zip(&there).enumerate().map(|(k, (h, t))| if shows(k) { h - t } else { 0.0 }).collect();
        let cross = DVector::from_iterator(kept.len(), kept.iter().map(|&k| dot(&slope, &none.columns[k])));
        let block = curvature.select_rows(kept.iter()).select_columns(kept.iter());
        let Some(factor) = block.cholesky() else { return Ok(None) };
        let information = (dot(&slope, &slope) - cross.dot(&factor.solve(&cross))).max(0.0);
        let needed = (wanted + 0.5 * (1.0 + information).ln()) * 2.0 * (information + 1.0) / information.powi(2);
        Ok(Some(Smallest { effect, coordinate: own[size], u: needed.sqrt() }))
    };
    let found: Result<Vec<Option<Smallest>>> = (0..count).into_par_iter().map(of_effect).collect();
    Ok(found?.into_iter().flatten().collect())
}

fn parameter(fitter: &Fitter, c: usize) -> &'static raven::effects::Parameter {
    let coordinate = fitter.coordinates.all[c];
    &fitter.coordinates.sited[coordinate.effect].effect.parameters[coordinate.parameter]
}
