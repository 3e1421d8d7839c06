//! A first look at every effect: evidence by slopes at one point, from several starts where an effect is not smooth. Slopes are those of settled
//! links; beside no other effect, rolled-out ones take their place for effects that let a joint float, which takes fifty times as long.

use std::cmp::Ordering;

use nalgebra::{DMatrix, DVector};
use raven::Result;
use raven::effects::{Channel, Element, Scale};

use super::fit::{Fitter, Hypothesis, gram, side_by_side};
use super::linear::{dot, evidence, minimum};
use super::rows::{ALL, Links};
use super::slopes::Column;
use super::tied::has;

/// A hypothesis as the screen saw it.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Effects, in rising order.
    pub effects: Vec<usize>,
    /// `ln Z` [nat].
    pub evidence: f64,
    /// Where a fit should start.
    pub start: Vec<f64>,
    /// By how much slopes at the same point were wrong about the point's own hypothesis [nat].
    pub doubt: f64,
}

/// The point from which effects are looked at.
struct Point<'a> {
    base: &'a Hypothesis,
    settled: Vec<f64>,
    information: DMatrix<f64>,
    score: DVector<f64>,
    square: f64,
    /// What the slopes promise where the point's own hypothesis is fitted, above what it came to.
    promised: f64,
}

impl Fitter<'_> {
    /// Evidence of every effect beside those of `base`, which hold none that is the same, best first. Slopes are taken at `base`, which need not
    /// have been fitted; the same effects came to `reached` when they were.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn screen(&self, base: &Hypothesis, reached: f64) -> Result<Vec<Candidate>> {
        let all: Vec<usize> = (0..self.coordinates.sited.len()).collect();
        self.screen_some(base, reached, &all)
    }

    /// As [`Self::screen`], of some effects only.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn screen_some(&self, base: &Hypothesis, reached: f64, some: &[usize]) -> Result<Vec<Candidate>> {
        let columns: Vec<&[f64]> = base.columns.iter().map(|column| column.as_slice()).collect();
        let mut point = Point {
            promised: 0.0,
            base,
            settled: self.rows.residuals(&self.coordinates.settings(&base.u), Links::Settled, &ALL)?,
            information: gram(&columns),
            score: DVector::from_iterator(columns.len(), columns.iter().map(|column| dot(column, &base.residuals))),
            square: dot(&base.residuals, &base.residuals),
        };
        let precision = self.precision(&base.free, &base.effects);
        let at = DVector::from_iterator(base.free.len(), base.free.iter().map(|&c| base.u[c]));
        let promise = minimum(&point.information, &point.score, point.square, &at, &precision)
            .and_then(|(_, cost)| evidence(&point.information, &precision, cost));
        point.promised =
            promise.map_or(0.0, |(promise, _)| promise + self.beyond_normal(&base.effects, &|c| base.u[c], &|c| base.std(c)) - reached);
        let beside: Vec<usize> = some.iter().copied().filter(|&effect| !has(&self.coordinates.sited, &base.effects, effect)).collect();
        let mut candidates = side_by_side(&beside, |&effect| {
            let mut best: Option<Candidate> = None;
            for start in self.starts(effect, &base.u) {
                let candidate = self.looked_at(&point, effect, &start)?;
                if let Some(candidate) = candidate.filter(|c| best.as_ref().is_none_or(|best| c.evidence > best.evidence)) {
                    best = Some(candidate);
                }
            }
            Ok(best)
        })?;
        candidates.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        Ok(candidates)
    }

    fn looked_at(&self, point: &Point, effect: usize, start: &[f64]) -> Result<Option<Candidate>> {
        let base = point.base;
        let own: Vec<usize> = self.coordinates.of(effect).collect();
        let mut u = self.placing(&base.u, effect, start);
        let unmoved = own.iter().all(|&c| u[c] == base.u[c]);
        let is_rolled_out = base.effects.is_empty() && (self.is_loose(effect) || self.shows_in_swings(effect));
        let links = if is_rolled_out { Links::RolledOut } else { Links::Settled };
        let channels = self.channels_of(effect, links);
        // The point's own slopes are of settled links.
        let slopes: Vec<Column> =
            match (unmoved && !is_rolled_out).then(|| own.iter().map(|c| base.free.iter().position(|f| f == c)).collect()) {
                Some(Some(at)) => Vec::<usize>::into_iter(at).map(|k| base.columns[k].clone()).collect(),
                _ => self.slopes(&u, &own, links)?,
            };
        // Links tell by how much the start differs from the point, rolled-out ones where the point is.
        let shift = if unmoved {
            None
        } else {
            let mut there = self.rows.residuals(&self.coordinates.settings(&u), links, channels)?;
            let here = if links == Links::Settled { &point.settled } else { &base.residuals };
            let (tip, torque) = there.split_at_mut(self.rows.tip_rows());
            let (tip_here, torque_here) = here.split_at(self.rows.tip_rows());
            for (channel, there, here) in [(Channel::Tip, tip, tip_here), (Channel::Torque, torque, torque_here)] {
                let shows = channels.contains(&channel);
                there.iter_mut().zip(here).for_each(|(there, here)| *there = if shows { *there - here } else { 0.0 });
            }
            Some(there)
        };
        let kept: Vec<usize> = (0..base.free.len()).filter(|&k| !own.contains(&base.free[k])).collect();
        let n = own.len() + kept.len();
        let mut information = DMatrix::zeros(n, n);
        let mut score = DVector::zeros(n);
        for (a, slope) in slopes.iter().enumerate() {
            for (b, other) in slopes.iter().enumerate() {
                information[(a, b)] = dot(slope, other);
            }
            for (b, &k) in kept.iter().enumerate() {
                let product = dot(slope, &base.columns[k]);
                information[(a, own.len() + b)] = product;
                information[(own.len() + b, a)] = product;
            }
            score[a] = dot(slope, &base.residuals) + shift.as_ref().map_or(0.0, |shift| dot(slope, shift));
        }
        for (a, &k) in kept.iter().enumerate() {
            for (b, &l) in kept.iter().enumerate() {
                information[(own.len() + a, own.len() + b)] = point.information[(k, l)];
            }
            score[own.len() + a] = point.score[k] + shift.as_ref().map_or(0.0, |shift| dot(&base.columns[k], shift));
        }
        let square = point.square + shift.as_ref().map_or(0.0, |shift| 2.0 * dot(shift, &base.residuals) + dot(shift, shift));
        let mut effects = [base.effects.as_slice(), &[effect]].concat();
        effects.sort_unstable();
        let coordinates: Vec<usize> = own.iter().copied().chain(kept.iter().map(|&k| base.free[k])).collect();
        let precision = self.precision(&coordinates, &effects);
        let at = DVector::from_iterator(n, coordinates.iter().map(|&c| u[c]));
        let Some((free_step, free_cost)) = minimum(&information, &score, square, &at, &precision) else { return Ok(None) };
        let inside: Vec<f64> = own.iter().enumerate().map(|(a, &c)| self.kept_inside(c, u[c], free_step[a]) - u[c]).collect();
        let bounded = inside.iter().enumerate().any(|(a, step)| (step - free_step[a]).abs() > 1e-9);
        let (step, cost) = if bounded {
            // The effect's own numbers go as far as they may, the others make the best of it.
            let m = own.len();
            let d = DVector::from_vec(inside);
            let (ww, ow, oo) = (
                information.view((0, 0), (m, m)).into_owned(),
                information.view((m, 0), (n - m, m)).into_owned(),
                information.view((m, m), (n - m, n - m)).into_owned(),
            );
            let own_score = score.rows(0, m).into_owned();
            let left = square - 2.0 * own_score.dot(&d) + d.dot(&(&ww * &d));
            let moved = at.rows(0, m) + &d;
            let prior = 0.5 * moved.component_mul(&moved).dot(&precision.rows(0, m));
            let rest = score.rows(m, n - m) - ow * &d;
            let Some((others, cost)) = minimum(&oo, &rest, left, &at.rows(m, n - m).into_owned(), &precision.rows(m, n - m).into_owned())
            else {
                return Ok(None);
            };
            (DVector::from_iterator(n, d.iter().chain(others.iter()).copied()), cost + prior)
        } else {
            (free_step, free_cost)
        };
        let Some((evidence, covariance)) = evidence(&information, &precision, cost) else { return Ok(None) };
        coordinates.iter().zip(step.iter()).for_each(|(&c, step)| u[c] = self.kept_inside(c, u[c], *step));
        let std = |c: usize| coordinates.iter().position(|&at| at == c).map_or(1.0, |k| covariance[(k, k)].sqrt());
        let evidence = evidence + self.beyond_normal(&effects, &|c| u[c], &std) - point.promised;
        Ok(Some(Candidate { evidence, effects, start: u, doubt: point.promised.abs() }))
    }

    /// Whether an effect lets a joint float, as backlash does: without a load it settles anywhere, and only rolled-out links say where it is.
    pub(super) fn is_loose(&self, effect: usize) -> bool {
        self.coordinates.sited[effect].effect.element == Some(Element::Gap)
    }

    /// How many shapes an effect is looked for with.
    pub(super) fn shapes_looked_at(&self, effect: usize) -> usize {
        let parameters = self.coordinates.sited[effect].effect.parameters;
        let mut starts = self.starts(effect, &self.nowhere());
        for start in &mut starts {
            start.iter_mut().zip(parameters).filter(|(_, parameter)| parameter.scale.is_size()).for_each(|(value, _)| *value = 0.0);
        }
        starts.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        starts.dedup();
        starts.len()
    }

    /// Where to start looking for an effect: its numbers in units of their slabs.
    pub(super) fn starts(&self, effect: usize, base: &[f64]) -> Vec<Vec<f64>> {
        let parameters = self.coordinates.sited[effect].effect.parameters;
        let alone = parameters.len() == 1;
        let shaped = parameters.iter().any(|p| !p.scale.is_size());
        let counted = parameters.iter().any(|p| matches!(p.scale, Scale::Whole { .. }));
        let sizes_vanish = parameters.iter().any(|p| matches!(p.scale, Scale::Offset(_) | Scale::Magnitude(_) | Scale::Part));
        // A limit has no slope where nothing reaches it, and far too much where everything does.
        let fine: Vec<f64> = (-10..=8).map(|k| 0.25 * f64::from(k)).collect();
        let happens = parameters.iter().any(|p| matches!(p.scale, Scale::Moment));
        let seen = if happens { self.rows.miscounts(self.coordinates.sited[effect].joint_measured()) } else { &[] };
        let moments: Vec<f64> = (0..10).map(|k| 0.05 + 0.1 * f64::from(k)).chain(seen.iter().copied()).collect();
        let is_cheap = self.coordinates.sited[effect].effect.channels == [Channel::Torque];
        let mut starts: Vec<Vec<f64>> = vec![Vec::new()];
        for (parameter, c) in parameters.iter().zip(self.coordinates.of(effect)) {
            let whole = parameter.scale.whole();
            let values: &[f64] = match parameter.scale {
                _ if self.coordinates.all[c].is_unknown() => &base[c..=c],
                // What may be a hundred times the nominal value has slopes that say nothing of it.
                Scale::Factor { size, .. } if size > 2.0 => &[base[c], -1.2, 0.8, 1.6, 2.4, 3.2],
                Scale::Factor { .. } => &[base[c], -1.2, 0.8, 1.6],
                // A whole number has no slope in any case, and what the size does is as it is for the other sign.
                Scale::Offset(_) if counted => &[0.5],
                // Beside a shape the size must not vanish, or the shape has no slope.
                Scale::Offset(_) if shaped => &[-0.5, 0.5],
                // Where the nominal model has borne it so far.
                Scale::Offset(_) => &base[c..=c],
                Scale::Part => &[0.5, 1.0],
                Scale::Magnitude(_) if shaped => &[0.5, 1.5],
                Scale::Magnitude(_) => &[0.15, 0.5, 1.5],
                Scale::Shape { .. } if alone && is_cheap => &fine,
                Scale::Shape { .. } if alone => &[-2.5, -1.5, -0.5, 0.5, 1.5],
                // A second shape is left to the fit.
                Scale::Shape { .. } if starts[0].iter().zip(parameters).any(|(_, p)| p.scale.is_shape()) => &[0.0],
                Scale::Shape { .. } => &[-1.0, 0.0, 1.0],
                // Where the size vanishes, nothing has been anywhere.
                Scale::State { .. } if !sizes_vanish => &[0.0],
                Scale::State { .. } => &[0.0, 1.0],
                Scale::Whole { .. } => &whole,
                Scale::Moment => &moments,
            };
            starts = starts.iter().flat_map(|start| values.iter().map(move |v| [start.as_slice(), &[*v]].concat())).collect();
        }
        starts
    }
}
