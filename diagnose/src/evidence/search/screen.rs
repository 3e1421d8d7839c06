//! A first look at every effect: evidence by slopes at one point, from several starts where an effect is not smooth. Slopes are those of settled
//! links. Rolled-out ones, which take fifty times as long, take their place for dampers of joints without another law, and beside no other effect
//! for effects that let a joint float.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use raven::Result;
use raven::effects::Element;

use super::tied::has;
use crate::evidence::fit::linear::{Quadratic, dot, evidence};
use crate::evidence::fit::slopes::Column;
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::recorded::rows::{ALL, Links};

/// Of an effect's starts so many are looked at by all of its slopes.
const CLOSELY: usize = 4;

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
    /// Of the point's own hypothesis.
    model: Quadratic,
    /// What the point's own hypothesis came to when it was fitted.
    reached: f64,
    /// What the slopes promise where it is fitted, above that.
    promised: f64,
}

/// An effect where it is looked for.
struct Start<'p> {
    effect: usize,
    /// All coordinates.
    u: Vec<f64>,
    links: Links,
    /// There, in the channels that show the effect.
    residuals: Cow<'p, [f64]>,
}

impl Point<'_> {
    fn residuals(&self, links: Links) -> &[f64] {
        if links == Links::Settled { &self.settled } else { &self.base.residuals }
    }

    /// Of an effect's numbers by their slopes, before those of the point's numbers that are kept; residuals are shifted by where the effect starts.
    fn beside(&self, slopes: &[Column], kept: &[usize], shift: Option<&[f64]>) -> Quadratic {
        let Self { base, model, .. } = self;
        let (own, n) = (slopes.len(), slopes.len() + kept.len());
        let mut information = DMatrix::zeros(n, n);
        let mut score = DVector::zeros(n);
        for (a, slope) in slopes.iter().enumerate() {
            for (b, other) in slopes.iter().enumerate() {
                information[(a, b)] = dot(slope, other);
            }
            for (b, &k) in kept.iter().enumerate() {
                let product = dot(slope, &base.columns[k]);
                information[(a, own + b)] = product;
                information[(own + b, a)] = product;
            }
            score[a] = dot(slope, &base.residuals) + shift.map_or(0.0, |shift| dot(slope, shift));
        }
        for (a, &k) in kept.iter().enumerate() {
            for (b, &l) in kept.iter().enumerate() {
                information[(own + a, own + b)] = model.information[(k, l)];
            }
            score[own + a] = model.score[k] + shift.map_or(0.0, |shift| dot(&base.columns[k], shift));
        }
        let square = model.square + shift.map_or(0.0, |shift| 2.0 * dot(shift, &base.residuals) + dot(shift, shift));
        Quadratic { information, score, square }
    }
}

impl Fitter<'_> {
    /// Evidence of every effect beside those of `base`, which hold none that is the same, best first. Slopes are taken at `base`, which need not
    /// have been fitted; the same effects came to `reached` when they were.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn screen(&self, base: &Hypothesis, reached: f64) -> Result<Vec<Candidate>> {
        let all: Vec<usize> = (0..self.coordinates.sited.len()).filter(|&effect| self.coordinates.can_be_named(effect)).collect();
        self.screen_some(base, reached, &all)
    }

    /// As [`Self::screen`], of some effects only.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn screen_some(&self, base: &Hypothesis, reached: f64, some: &[usize]) -> Result<Vec<Candidate>> {
        let columns: Vec<&[f64]> = base.columns.iter().map(|column| column.as_slice()).collect();
        let mut point = Point {
            promised: 0.0,
            reached,
            base,
            settled: self.rows.residuals(&self.coordinates.settings(&base.u), Links::Settled, &ALL)?,
            model: Quadratic::new(&columns, &base.residuals),
        };
        point.promised = self.promised(&point, &point.model, &base.free);
        let beside: Vec<usize> = some.iter().copied().filter(|&effect| !has(&self.coordinates.sited, &base.effects, effect)).collect();
        let mut candidates = side_by_side(&beside, |&effect| {
            let mut best: Option<Candidate> = None;
            for start in self.promising(&point, effect)? {
                let candidate = self.looked_at(&point, start)?;
                if let Some(candidate) = candidate.filter(|c| best.as_ref().is_none_or(|best| c.evidence > best.evidence)) {
                    best = Some(candidate);
                }
            }
            Ok(best)
        })?;
        candidates.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        Ok(candidates)
    }

    /// What a point's own hypothesis promises by slopes of these coordinates, all that it has free, above what it came to; 0 if nothing holds them.
    fn promised(&self, point: &Point, model: &Quadratic, free: &[usize]) -> f64 {
        let base = point.base;
        let precision = self.precision(free, &base.effects);
        let at = DVector::from_iterator(free.len(), free.iter().map(|&c| base.u[c]));
        let promise = model.minimum(&at, &precision).and_then(|(_, cost)| evidence(&model.information, &precision, cost));
        let beyond_normal = self.beyond_normal(&base.effects, &|c| base.u[c], &|c| base.std(c));
        promise.map_or(0.0, |(promise, _)| promise + beyond_normal - point.reached)
    }

    /// Where to look for an effect: where it promises most by its size alone, which is believed to act as it does over the whole way there.
    fn promising<'p>(&self, point: &'p Point, effect: usize) -> Result<Vec<Start<'p>>> {
        // Rolled-out links take too long to look for a damper everywhere beside each hypothesis.
        let stays = !point.base.effects.is_empty() && self.swings_beside(point.base, effect);
        let numbers = if stays { vec![self.coordinates.own(effect, &point.base.u)] } else { self.starts(effect, &point.base.u) };
        let begun: Result<Vec<Start>> = numbers.iter().map(|start| self.begun_at(point, effect, start)).collect();
        let starts = begun?;
        let sizes: Vec<usize> = self.coordinates.sizes(effect).collect();
        let is_shaped = self.coordinates.of(effect).count() > 1;
        let (&[size], true) = (sizes.as_slice(), is_shaped && starts.len() > CLOSELY) else { return Ok(starts) };
        let mut by_size: Vec<(f64, Start)> = starts.into_iter().map(|start| (self.promised_by_size(point, &start, size), start)).collect();
        by_size.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        Ok(by_size.into_iter().take(CLOSELY).map(|(_, start)| start).collect())
    }

    /// Whether an effect shows in how a joint swings that follows its cable as the nominal model has it: by another law, which may not be quite
    /// right, a damper would make good what that lacks.
    fn swings_beside(&self, base: &Hypothesis, effect: usize) -> bool {
        let joint = self.followed(effect);
        self.shows_in_swings(effect) && base.effects.iter().all(|&other| self.followed(other) != joint)
    }

    fn begun_at<'p>(&self, point: &'p Point, effect: usize, start: &[f64]) -> Result<Start<'p>> {
        let base = point.base;
        let u = self.placing(&base.u, effect, start);
        let is_rolled_out = self.swings_beside(base, effect) || base.effects.is_empty() && self.is_loose(effect);
        let links = if is_rolled_out { Links::RolledOut } else { Links::Settled };
        let residuals = if u == base.u {
            Cow::Borrowed(point.residuals(links))
        } else {
            Cow::Owned(self.rows.residuals(&self.coordinates.settings(&u), links, self.channels_of(effect, links))?)
        };
        Ok(Start { effect, u, links, residuals })
    }

    /// Evidence of an effect if its residuals go straight from the point to the start as its size does; infinite if it is the size of the point, which
    /// says nothing of how far it is worth going.
    fn promised_by_size(&self, point: &Point, start: &Start, size: usize) -> f64 {
        let from = point.base.u[size];
        let over = start.u[size] - from;
        if over == 0.0 {
            return f64::INFINITY;
        }
        let channels = self.channels_of(start.effect, start.links);
        let mut slope = self.rows.less(point.residuals(start.links), &start.residuals, channels);
        slope.iter_mut().for_each(|slope| *slope /= over);
        let mut u = start.u.clone();
        u[size] = from;
        let seen = self.weighed(point, start.effect, u, &[size], &[Arc::new(slope)], None);
        seen.map_or(f64::NEG_INFINITY, |seen| seen.evidence)
    }

    fn looked_at(&self, point: &Point, start: Start) -> Result<Option<Candidate>> {
        let Start { effect, u, links, residuals } = start;
        let base = point.base;
        let own: Vec<usize> = self.coordinates.of(effect).collect();
        let unmoved = u == base.u;
        // The point's own slopes are of settled links.
        let slopes: Vec<Column> =
            match (unmoved && links == Links::Settled).then(|| own.iter().map(|c| base.free.iter().position(|f| f == c)).collect()) {
                Some(Some(at)) => Vec::<usize>::into_iter(at).map(|k| base.columns[k].clone()).collect(),
                _ => self.slopes_beside(&u, &residuals, &own, links)?,
            };
        let shift = (!unmoved).then(|| self.rows.less(&residuals, point.residuals(links), self.channels_of(effect, links)));
        Ok(self.weighed(point, effect, u, &own, &slopes, shift.as_deref()))
    }

    /// An effect at its best near `u` by slopes of its `own` numbers, beside all that the point has free.
    fn weighed(
        &self,
        point: &Point,
        effect: usize,
        mut u: Vec<f64>,
        own: &[usize],
        slopes: &[Column],
        shift: Option<&[f64]>,
    ) -> Option<Candidate> {
        let base = point.base;
        let is_other = |&k: &usize| self.coordinates.all[base.free[k]].effect != effect;
        let kept: Vec<usize> = (0..base.free.len()).filter(is_other).collect();
        let model = point.beside(slopes, &kept, shift);
        let mut effects = [base.effects.as_slice(), &[effect]].concat();
        effects.sort_unstable();
        let coordinates: Vec<usize> = own.iter().copied().chain(kept.iter().map(|&k| base.free[k])).collect();
        let precision = self.precision(&coordinates, &effects);
        // By other slopes of its numbers the point's own hypothesis promises something else.
        let is_free_there = shift.is_none() && coordinates.len() == base.free.len() && own.iter().all(|c| base.free.contains(c));
        let promised = if is_free_there { self.promised(point, &model, &coordinates) } else { point.promised };
        let at = DVector::from_iterator(coordinates.len(), coordinates.iter().map(|&c| u[c]));
        let (free_step, free_cost) = model.minimum(&at, &precision)?;
        // The effect's own numbers go as far as they may, the others make the best of it.
        let inside = DVector::from_iterator(own.len(), own.iter().enumerate().map(|(a, &c)| self.stepped(c, u[c], free_step[a]) - u[c]));
        let is_bounded = inside.iter().zip(free_step.iter()).any(|(step, free)| (step - free).abs() > 1e-9);
        let (step, cost) = if is_bounded { model.minimum_beside(&inside, &at, &precision)? } else { (free_step, free_cost) };
        let (evidence, covariance) = evidence(&model.information, &precision, cost)?;
        coordinates.iter().zip(step.iter()).for_each(|(&c, step)| u[c] = self.stepped(c, u[c], *step));
        let std = |c: usize| coordinates.iter().position(|&at| at == c).map_or(1.0, |k| covariance[(k, k)].sqrt());
        let evidence = evidence + self.beyond_normal(&effects, &|c| u[c], &std) - promised;
        Some(Candidate { evidence, effects, start: u, doubt: promised.abs() })
    }

    /// Whether an effect lets a joint float, as backlash does: without a load it settles anywhere, and only rolled-out links say where it is.
    pub(crate) fn is_loose(&self, effect: usize) -> bool {
        self.coordinates.sited[effect].effect.element == Some(Element::Gap)
    }
}
