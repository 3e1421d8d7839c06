//! The smallest size of each effect that recordings could have shown, and how probable it is that one is there and too small for them.
//!
//! What a size of `u` slabs changes, over `u` and projected off the other numbers of the nominal model, is `s`; with `S = s's - s'J (J'J + L)^-1 J's` the
//! size is found with the variance `1/S`. Where it is `N(0, t^2)` in the nominal model, the effect raises the evidence on average by
//!
//! ```text
//! ((u^2 + 1/S) (1/(1/S + t^2) - 1/(1/S + 1)) + ln((1 + S t^2) / (1 + S))) / 2
//! ```
//!
//! and by what sizes are believed to be ([`sizes`]). `S` goes by `u`: play that friction takes up does nothing, and a stiff cable cannot
//! stretch less than none. It is taken where the smallest size is. An effect that has nothing but a shape changes `d_k` at `u_k`, weights `w_k` of `N(0, 1)`;
//! where `u_k` is true the evidence rises, but for chance, by
//!
//! ```text
//! ln sum_j w_j exp(D_kj - D_jj / 2),   D = d'd - d'J (J'J + L)^-1 J'd
//! ```
//!
//! An effect that is too small to show leaves the evidence as it is without.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use raven::Result;
use raven::effects::{Above, Channel, Scale, Sited};
use raven::plot::svg::figure;
use raven::stats::normal_cdf;
use rayon::prelude::*;
use serde::Serialize;

use super::NotObservable;
use super::information::{CLOSE, Information};
use crate::evidence::fit::linear::{dot, gram};
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::coordinates::ABSENT;
use crate::evidence::numbers::prior;
use crate::evidence::numbers::sizes;
use crate::evidence::outcome::Outcome;
use crate::evidence::recorded::rows::Links;

/// The smallest size of an effect that would have been named.
#[derive(Debug, Clone, Serialize)]
pub struct Detectable {
    /// Identifier.
    pub id: &'static str,
    /// As of a cause.
    pub joint: Option<String>,
    /// Of its first number; of a factor, the one above 1, or below where that is the rule; of a number that does less the larger it is, as a
    /// limit, the largest.
    pub size: f64,
    /// Unit of `size`.
    pub unit: String,
    /// How the number goes with the effect.
    #[serde(skip)]
    scale: Scale,
}

impl Detectable {
    /// The size in words, `0.62 %`, `factor 1.8` or `up to 12 N m`.
    #[must_use]
    pub fn words(&self) -> String {
        let size = self.size;
        match self.scale {
            scale if scale.is_factor() => format!("factor {}", figure(size)),
            Scale::Shape { .. } => format!("up to {} {}", figure(size), self.unit),
            _ if self.unit == "1" => format!("{} %", figure(100.0 * size)),
            _ => format!("{} {}", figure(size), self.unit),
        }
    }
}

/// Evidence beyond the prior odds at which an effect will be named in spite of its scatter [nat].
const SURE_NATS: f64 = 3.0;
/// Tolerances that a number of the nominal model may be off by without an effect.
const BORNE: f64 = 3.0;
/// Sizes are tried by this factor, from so many slabs on.
const TRIED: f64 = 1.02;
const LEAST: f64 = 1e-3;
/// After so many sizes what one changes is known well enough at the latest, however far it is from them.
const STEPS_MAX: usize = 10;
/// Shapes are tried so far from their middle, at so many places.
const REACH: f64 = 2.5;
const SHAPES: usize = 11;

/// The smallest size of one effect that would have been named.
pub(super) struct Smallest {
    pub(super) effect: usize,
    /// Coordinate of its size.
    coordinate: usize,
    /// In slabs; not finite where none shows that is to be expected.
    u: f64,
    /// Probability that the effect, if it is there, is smaller than one that is as likely named as not.
    pub(super) part_unseen: f64,
}

impl Smallest {
    /// The size as reports have it, or why there is none.
    pub(super) fn detectable(&self, fitter: &Fitter) -> std::result::Result<Detectable, NotObservable> {
        let sited = fitter.coordinates.sited[self.effect];
        let parameter = fitter.coordinates.parameter(self.coordinate);
        let (id, joint) = (sited.effect.id, sited.joint(fitter.rows.robot()));
        if !self.u.is_finite() {
            let place = joint.map_or_else(String::new, |joint| format!(" at the {joint}"));
            return Err(NotObservable { id, because: format!("no size that is to be expected{place} would have shown") });
        }
        let size = parameter.value(side(parameter.scale) * self.u, sited.measure);
        Ok(Detectable { id, joint, size, unit: parameter.unit_at(sited.measure).to_owned(), scale: parameter.scale })
    }
}

/// On which side of the nominal model an effect is looked for.
fn side(scale: Scale) -> f64 {
    if matches!(scale, Scale::Factor { above: Above::Seldom, .. }) { -1.0 } else { 1.0 }
}

pub(super) fn smallest(fitter: &Fitter, outcome: &Outcome) -> Result<Vec<Smallest>> {
    let count = fitter.coordinates.sited.len();
    let odds = prior::log(0, count) - prior::log_beyond_scatter(1, count);
    let without = Without::new(fitter, &outcome.none)?;
    let found: Result<Vec<Option<Smallest>>> = (0..count).into_par_iter().map(|effect| without.smallest(effect, odds)).collect();
    Ok(found?.into_iter().flatten().collect())
}

/// The part of sizes that are too small, on average over the effects. Which effect there is comes before where: one that may be at three joints
/// counts as much as one that has a single place.
pub(super) fn part_unseen_of_all(smallest: &[Smallest], sited: &[Sited]) -> f64 {
    let mut by_id: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for one in smallest {
        by_id.entry(sited[one.effect].effect.id).or_default().push(one.part_unseen);
    }
    let of_each = by_id.values().map(|parts| parts.iter().sum::<f64>() / parts.len() as f64);
    of_each.sum::<f64>() / by_id.len().max(1) as f64
}

/// The nominal model, as it is fitted.
struct Without<'a> {
    fitter: &'a Fitter<'a>,
    none: &'a Hypothesis,
    /// `J'J + L` of its numbers.
    curvature: DMatrix<f64>,
    /// Residuals of settled links.
    settled: Vec<f64>,
}

impl<'a> Without<'a> {
    fn new(fitter: &'a Fitter<'a>, none: &'a Hypothesis) -> Result<Self> {
        let all: Vec<&[f64]> = none.columns.iter().map(|column| column.as_slice()).collect();
        let mut curvature = gram(&all);
        for (k, &c) in none.free.iter().enumerate() {
            curvature[(k, k)] += fitter.prior(c, &[]).map_or(0.0, |t| t.powi(-2));
        }
        let settings = fitter.coordinates.settings(&none.u);
        let settled = fitter.rows.residuals(&settings, Links::Settled, &[Channel::Tip, Channel::Torque])?;
        Ok(Self { fitter, none, curvature, settled })
    }

    /// Of one effect; `odds` are what it has to raise the evidence by to be as probable as none.
    fn smallest(&self, effect: usize, odds: f64) -> Result<Option<Smallest>> {
        let coordinates = self.fitter.coordinates;
        let sizes: Vec<usize> = coordinates.sizes(effect).collect();
        let Some(&coordinate) = sizes.first() else { return self.smallest_shape(effect, odds) };
        let spike = coordinates.all[coordinate].spike.map_or(0.0, |t| t.powi(2));
        let scale = coordinates.parameter(coordinate).scale;
        let [least, largest] = scale.limits_u();
        let of_size = |u: f64| {
            let information = self.information(effect, coordinate, &[(side(scale) * u).clamp(least, largest)])?;
            Ok(information.map(|information| information[(0, 0)].max(0.0) / u.powi(2)))
        };
        let Some(of_slab) = of_size(1.0)? else { return Ok(None) };
        let mut information = Information(vec![(1.0, of_slab)]);
        let mut shown = |wanted: f64| -> Result<f64> {
            let by = |information: &dyn Fn(f64) -> f64| smallest_shown(information, spike, sizes.len(), wanted);
            let mut steps = 0;
            loop {
                let u = by(&|u| information.at(u));
                // Where no size shows by what is known, the largest does if any.
                let mut tried = u.min(largest_tried(sizes.len()));
                // What is near may be known to change nothing, and what is a little larger not be known at all.
                let is_sure = |near: f64| u.is_infinite() || by(&|_| near) <= CLOSE.powi(2) * u;
                if steps == STEPS_MAX || information.near(tried).is_some_and(is_sure) {
                    return Ok(u);
                }
                if steps % 2 == 1 {
                    tried = information.middle(tried);
                }
                information.learn(tried, of_size(tried)?.unwrap_or(0.0));
                steps += 1;
            }
        };
        let sure = shown(odds + SURE_NATS)?;
        Ok(Some(Smallest { effect, coordinate, u: sure, part_unseen: part_unseen(shown(odds)?, spike, sizes.len()) }))
    }

    /// Of an effect that has nothing but a shape, and does less the larger that is.
    fn smallest_shape(&self, effect: usize, odds: f64) -> Result<Option<Smallest>> {
        let mut own = self.fitter.coordinates.of(effect).filter(|&c| self.none.u[c] == ABSENT);
        let Some(coordinate) = own.next() else { return Ok(None) };
        let at = |k: usize| REACH * (2.0 * k as f64 / (SHAPES - 1) as f64 - 1.0);
        let tried: Vec<f64> = (0..SHAPES).map(at).collect();
        let Some(information) = self.information(effect, coordinate, &tried)? else { return Ok(None) };
        let raised = raised_by_shapes(&tried, &information);
        let mildest = |wanted: f64| mildest_shown(&tried, &raised, wanted);
        Ok(Some(Smallest { effect, coordinate, u: mildest(odds + SURE_NATS), part_unseen: 1.0 - normal_cdf(mildest(odds)) }))
    }

    /// Of what an effect changes with each value of a coordinate, projected off the other numbers: `D` above.
    fn information(&self, effect: usize, coordinate: usize, values: &[f64]) -> Result<Option<DMatrix<f64>>> {
        let coordinates = self.fitter.coordinates;
        // What is as free without the effect says nothing of it either.
        let is_aside = |c: usize| coordinates.all[c].effect != effect || coordinates.all[c].is_unknown();
        let kept: Vec<usize> = (0..self.none.free.len()).filter(|&k| is_aside(self.none.free[k])).collect();
        let changes: Result<Vec<Vec<f64>>> = values.iter().map(|&value| self.change(effect, coordinate, value)).collect();
        let changes = changes?;
        let changes: Vec<&[f64]> = changes.iter().map(Vec::as_slice).collect();
        let cross = DMatrix::from_fn(kept.len(), changes.len(), |k, i| dot(changes[i], &self.none.columns[kept[k]]));
        let block = self.curvature.select_rows(kept.iter()).select_columns(kept.iter());
        let Some(factor) = block.cholesky() else { return Ok(None) };
        Ok(Some(gram(&changes) - cross.tr_mul(&factor.solve(&cross))))
    }

    /// What so much more of an effect changes in the channels that it shows in.
    fn change(&self, effect: usize, coordinate: usize, value: f64) -> Result<Vec<f64>> {
        let Fitter { rows, coordinates, .. } = self.fitter;
        let mut u = self.none.u.clone();
        coordinates.of(effect).filter(|&c| matches!(coordinates.parameter(c).scale, Scale::Moment)).for_each(|c| u[c] = 0.5);
        u[coordinate] = if u[coordinate] == ABSENT { value } else { u[coordinate] + value };
        let (links, here) = if self.fitter.shows_in_swings(effect) || self.fitter.followed(effect).is_some() {
            (Links::RolledOut, &self.none.residuals)
        } else {
            (Links::Settled, &self.settled)
        };
        let channels = self.fitter.channels_of(effect, links);
        let residuals = rows.residuals(&coordinates.settings(&u), links, channels)?;
        let tip_rows = rows.tip_rows();
        let shows = |k: usize| channels.contains(if k < tip_rows { &Channel::Tip } else { &Channel::Torque });
        let changed = here.iter().zip(&residuals).enumerate();
        Ok(changed.map(|(k, (here, there))| if shows(k) { here - there } else { 0.0 }).collect())
    }
}

/// The largest size that is tried [slabs].
fn largest_tried(n: usize) -> f64 {
    sizes::largest() * (n as f64).sqrt()
}

/// The smallest size in slabs, of one that is to be expected, that raises the evidence by `wanted` where it is found with the `information` of its
/// size; with a variance of `spike` in the nominal model, and as one of `n` sizes.
fn smallest_shown(information: &dyn Fn(f64) -> f64, spike: f64, n: usize, wanted: f64) -> f64 {
    let mut tried = std::iter::successors(Some(LEAST), |u| Some(u * TRIED)).take_while(|u| *u < largest_tried(n));
    let shows = |u: &f64| raised_if_normal(*u, information(*u), spike) + sizes::ln_ratio(*u / (n as f64).sqrt(), n) > wanted;
    tried.find(shows).unwrap_or(f64::INFINITY)
}

/// Part of an effect's sizes below `shown` slabs. What the nominal model's tolerance bears is no effect.
fn part_unseen(shown: f64, spike: f64, n: usize) -> f64 {
    let below = |u: f64| sizes::part_below(u / (n as f64).sqrt());
    let borne = below(BORNE * spike.sqrt());
    ((below(shown) - borne) / (1.0 - borne)).max(0.0)
}

/// By how much each shape that is tried raises the evidence where it is the true one [nat].
fn raised_by_shapes(tried: &[f64], information: &DMatrix<f64>) -> Vec<f64> {
    let sum: f64 = tried.iter().map(|u| (-0.5 * u * u).exp()).sum();
    let of = |k: usize| {
        let logs = tried.iter().enumerate().map(|(j, u)| information[(k, j)] - 0.5 * (information[(j, j)] + u * u));
        let highest = logs.clone().fold(f64::NEG_INFINITY, f64::max);
        highest + (logs.map(|log| (log - highest).exp()).sum::<f64>() / sum).ln()
    };
    (0..tried.len()).map(of).collect()
}

/// The largest shape that raises the evidence by `wanted`.
fn mildest_shown(tried: &[f64], raised: &[f64], wanted: f64) -> f64 {
    let Some(last) = raised.iter().rposition(|raised| *raised > wanted) else { return f64::NEG_INFINITY };
    let Some(next) = raised.get(last + 1) else { return tried[last] };
    tried[last] + (tried[last + 1] - tried[last]) * (raised[last] - wanted) / (raised[last] - next)
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
    use crate::evidence::numbers::coordinates::Coordinates;
    use crate::evidence::tests::{Seen, tips};
    use approx::assert_relative_eq;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use raven::effects::Size;

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
    fn shapes_raise_the_evidence_as_they_do_in_samples() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(18);
        let tried = [-1.0, 0.0, 1.0];
        let weights = tried.map(|u: f64| (-0.5 * u * u).exp());
        // What the shapes change, in two residuals of unit noise.
        let changes = [[6.0, 1.0], [2.0, 1.5], [0.1, 0.0]];
        let information = DMatrix::from_fn(3, 3, |k, j| dot(&changes[k], &changes[j]));
        let raised = raised_by_shapes(&tried, &information);
        for (k, change) in changes.iter().enumerate() {
            let samples = 100_000;
            let sum: f64 = (0..samples)
                .map(|_| {
                    let seen = change.map(|d| d + Distribution::<f64>::sample(&StandardNormal, &mut rng));
                    let likelihood = |d: &[f64; 2]| (dot(d, &seen) - 0.5 * dot(d, d)).exp();
                    let of_all: f64 = changes.iter().zip(weights).map(|(d, w)| w * likelihood(d)).sum();
                    (of_all / weights.iter().sum::<f64>()).ln()
                })
                .sum();
            let mean = sum / f64::from(samples);
            // But for chance, which where little shows adds as much as it takes.
            assert_relative_eq!(raised[k], mean, epsilon = 0.3);
        }
    }

    #[test]
    fn the_mildest_shape_that_shows_is_between_those_tried() {
        let tried = [-1.0, 0.0, 1.0];
        assert_relative_eq!(mildest_shown(&tried, &[9.0, 5.0, 1.0], 4.0), 0.25);
        assert_relative_eq!(mildest_shown(&tried, &[9.0, 8.0, 7.0], 4.0), 1.0);
        let none = mildest_shown(&tried, &[3.0, 1.0, 0.0], 4.0);
        assert_relative_eq!(1.0 - normal_cdf(none), 1.0);
    }

    #[test]
    fn what_an_effect_would_show_does_not_go_by_how_far_its_number_is_strained() {
        let rows = Seen::new(&[("joint-offset", [0, 0])], |numbers: &[Option<&[f64]>], _| {
            tips(|k| k.sin() * (0.9 - numbers[0].map_or(0.0, |u| u[0])))
        });
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let none = fitter.fit(&[], &fitter.nowhere(), None).unwrap().unwrap();
        let information = |u: f64| {
            let none = Hypothesis { u: vec![u], ..none.clone() };
            Without::new(&fitter, &none).unwrap().information(0, 0, &[1.0]).unwrap().unwrap()[(0, 0)]
        };
        assert_relative_eq!(information(0.8), information(0.0), max_relative = 1e-9);
    }

    #[test]
    fn what_small_sizes_do_not_change_would_not_have_shown() {
        let rows = Seen::new(&[("backlash", [1, 0])], |numbers: &[Option<&[f64]>], _| {
            tips(|k| -9.0 * k.sin() * numbers[0].map_or(0.0, |u| (u[0] - 0.5).max(0.0)))
        });
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let fitter = Fitter::new(&rows, &coordinates);
        let none = fitter.fit(&[], &fitter.nowhere(), None).unwrap().unwrap();
        let smallest = smallest(&fitter, &Outcome::begun(none, 1)).unwrap();
        assert!((0.5..0.7).contains(&smallest[0].u), "{}", smallest[0].u);
    }

    #[test]
    fn a_cable_that_would_have_shown_is_a_soft_one() {
        let rows = Seen::new(&[("cable-stretch", [1, 0])], |_: &[Option<&[f64]>], _| tips(|k| k.sin()));
        let coordinates = Coordinates::new(&rows.robot, &rows);
        let smallest = Smallest { effect: 0, coordinate: 0, u: 1.0, part_unseen: 0.0 };
        let fitter = Fitter::new(&rows, &coordinates);
        let said = smallest.detectable(&fitter).unwrap();
        assert_eq!((said.words().as_str(), said.joint.as_deref()), ("factor 0.247", Some("elbow")));
        let none = Smallest { u: f64::INFINITY, ..smallest }.detectable(&fitter).unwrap_err();
        assert_eq!((none.id, none.because.as_str()), ("cable-stretch", "no size that is to be expected at the elbow would have shown"));
    }

    #[test]
    fn sizes_are_said_as_what_they_are() {
        let said = |scale: Scale, unit: &str| Detectable { id: "x", joint: None, size: 1.8, unit: unit.to_owned(), scale }.words();
        assert_eq!(said(Scale::factor(1.0), "1"), "factor 1.80");
        assert_eq!(said(Scale::Offset(Size::of(1.0)), "1"), "180 %");
        assert_eq!(said(Scale::Offset(Size::of(1.0)), "m"), "1.80 m");
        assert_eq!(said(Scale::Shape { middle: 1.0, size: 1.0 }, "N m"), "up to 1.80 N m");
    }

    #[test]
    fn a_number_within_its_tolerances_does_not_show() {
        // However well it is measured: a tenth of a slab is its tolerance.
        let shown = smallest_shown(&|_| 1e9, 0.01, 1, 5.0);
        assert!((0.3..0.6).contains(&shown), "{shown}");
        assert!(smallest_shown(&|_| 1e9, 0.0, 1, 5.0) < 0.05);
        assert_eq!(smallest_shown(&|_| 0.0, 0.0, 1, 5.0), f64::INFINITY);
        assert_eq!(part_unseen(0.3, 0.01, 1), 0.0);
        assert_relative_eq!(part_unseen(0.8, 0.0, 1), 0.5, epsilon = 1e-9);
        assert_relative_eq!(part_unseen(f64::INFINITY, 0.01, 1), 1.0);
    }
}
