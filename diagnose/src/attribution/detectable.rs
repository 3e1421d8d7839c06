//! The smallest size of each effect that recordings could have shown, and how probable it is that one is there and too small for them.
//!
//! With an effect's slope `s` projected off the other numbers of the nominal model, `S = s's - s'J (J'J + L)^-1 J's`, a size of `u` slabs is found
//! with the variance `1/S`. Where it is `N(0, t^2)` in the nominal model, the effect raises the evidence on average by
//!
//! ```text
//! ((u^2 + 1/S) (1/(1/S + t^2) - 1/(1/S + 1)) + ln((1 + S t^2) / (1 + S))) / 2
//! ```
//!
//! and by what sizes are believed to be ([`sizes`]). An effect that is too small to show leaves the evidence as it is without.

use nalgebra::DVector;
use raven::Result;
use raven::effects::{Channel, Scale};
use rayon::prelude::*;
use serde::Serialize;

use crate::evidence::fit::{Fitter, gram};
use crate::evidence::linear::dot;
use crate::evidence::outcome::Outcome;
use crate::evidence::prior;
use crate::evidence::rows::Links;
use crate::evidence::sizes;

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

/// Evidence beyond the prior odds at which an effect will be named in spite of its scatter [nat].
const SURE_NATS: f64 = 3.0;
/// Tolerances that a number of the nominal model may be off by without an effect.
const BORNE: f64 = 3.0;
/// Sizes are tried by this factor, from so many slabs on.
const TRIED: f64 = 1.02;
const LEAST: f64 = 1e-3;

/// The smallest size of one effect that would have been named.
pub(super) struct Smallest {
    pub(super) effect: usize,
    /// Coordinate of its size.
    coordinate: usize,
    /// In slabs; infinite where none shows that is to be expected.
    u: f64,
    /// Probability that the effect, if it is there, is smaller than one that is as likely named as not.
    pub(super) part_unseen: f64,
}

impl Smallest {
    /// As reports have it.
    pub(super) fn detectable(&self, fitter: &Fitter) -> Detectable {
        let sited = fitter.coordinates.sited[self.effect];
        let parameter = fitter.coordinates.parameter(self.coordinate);
        Detectable {
            id: sited.effect.id,
            joint: sited.joint(fitter.rows.robot()),
            size: self.u.is_finite().then(|| parameter.value(self.u, sited.measure)),
            unit: parameter.unit_at(sited.measure).to_owned(),
        }
    }
}

pub(super) fn smallest(fitter: &Fitter, outcome: &Outcome) -> Result<Vec<Smallest>> {
    let (rows, coordinates, none) = (fitter.rows, fitter.coordinates, &outcome.none);
    let count = coordinates.sited.len();
    let odds = prior::log(0, count) - prior::log_beyond_scatter(1, count);
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
        let sizes: Vec<usize> = coordinates.sizes(effect).collect();
        let Some(&size) = sizes.first() else { return Ok(None) };
        let mut u = none.u.clone();
        own.iter().for_each(|&c| u[c] = if matches!(coordinates.parameter(c).scale, Scale::Moment) { 0.5 } else { 0.0 });
        u[size] = 1.0;
        let channels = sited.effect.channels;
        let there = rows.residuals(&coordinates.settings(&u), Links::Settled, channels)?;
        let tip_rows = rows.tip_rows();
        let shows = |k: usize| channels.contains(if k < tip_rows { &Channel::Tip } else { &Channel::Torque });
        let slope: Vec<f64> = here.iter().zip(&there).enumerate().map(|(k, (h, t))| if shows(k) { h - t } else { 0.0 }).collect();
        let cross = DVector::from_iterator(kept.len(), kept.iter().map(|&k| dot(&slope, &none.columns[k])));
        let block = curvature.select_rows(kept.iter()).select_columns(kept.iter());
        let Some(factor) = block.cholesky() else { return Ok(None) };
        let information = (dot(&slope, &slope) - cross.dot(&factor.solve(&cross))).max(0.0);
        let spike = coordinates.all[size].spike.map_or(0.0, |t| t.powi(2));
        let shown = |wanted: f64| smallest_shown(information, spike, sizes.len(), wanted);
        let part_unseen = part_unseen(shown(odds), spike, sizes.len());
        Ok(Some(Smallest { effect, coordinate: size, u: shown(odds + SURE_NATS), part_unseen }))
    };
    let found: Result<Vec<Option<Smallest>>> = (0..count).into_par_iter().map(of_effect).collect();
    Ok(found?.into_iter().flatten().collect())
}

/// The smallest size in slabs, of one that is to be expected, that raises the evidence by `wanted` where it is found with `information`; with a
/// variance of `spike` in the nominal model, and as one of `n` sizes.
fn smallest_shown(information: f64, spike: f64, n: usize, wanted: f64) -> f64 {
    let root = (n as f64).sqrt();
    let mut tried = std::iter::successors(Some(LEAST), |u| Some(u * TRIED)).take_while(|u| *u < sizes::largest() * root);
    let shows = |u: &f64| raised_if_normal(*u, information, spike) + sizes::ln_ratio(*u / root, n) > wanted;
    tried.find(shows).unwrap_or(f64::INFINITY)
}

/// Part of an effect's sizes below `shown` slabs. What the nominal model's tolerance bears is no effect.
fn part_unseen(shown: f64, spike: f64, n: usize) -> f64 {
    let below = |u: f64| sizes::part_below(u / (n as f64).sqrt());
    let borne = below(BORNE * spike.sqrt());
    ((below(shown) - borne) / (1.0 - borne)).max(0.0)
}

/// By how much a size of `u` slabs raises the evidence on average where its prior is normal [nat].
fn raised_if_normal(u: f64, information: f64, spike: f64) -> f64 {
    let scatter = information.recip();
    let gained = (u * u + scatter) * ((scatter + spike).recip() - (scatter + 1.0).recip());
    0.5 * (gained + ((1.0 + information * spike) / (1.0 + information)).ln())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn evidence_rises_as_it_does_in_samples() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(17);
        for (u, information, spike) in [(0.3, 400.0_f64, 0.01_f64), (1.0, 9.0, 0.0), (0.05, 1e4, 0.04)] {
            let density = |found: f64, variance: f64| -0.5 * (found * found / variance + variance.ln());
            let samples = 200_000;
            let sum: f64 = (0..samples)
                .map(|_| {
                    let scatter: f64 = StandardNormal.sample(&mut rng);
                    let found = u + scatter / information.sqrt();
                    density(found, information.recip() + 1.0) - density(found, information.recip() + spike)
                })
                .sum();
            assert_relative_eq!(raised_if_normal(u, information, spike), sum / f64::from(samples), epsilon = 0.02);
        }
    }

    #[test]
    fn a_number_within_its_tolerances_does_not_show() {
        // However well it is measured: a tenth of a slab is its tolerance.
        let shown = smallest_shown(1e9, 0.01, 1, 5.0);
        assert!((0.3..0.6).contains(&shown), "{shown}");
        assert!(smallest_shown(1e9, 0.0, 1, 5.0) < 0.05);
        assert_eq!(smallest_shown(0.0, 0.0, 1, 5.0), f64::INFINITY);
        assert_eq!(part_unseen(0.3, 0.01, 1), 0.0);
        assert_relative_eq!(part_unseen(0.8, 0.0, 1), 0.5, epsilon = 1e-9);
        assert_relative_eq!(part_unseen(f64::INFINITY, 0.01, 1), 1.0);
    }
}
