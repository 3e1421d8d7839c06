//! A first look at every effect: evidence by slopes at one point, from several starts where an effect is not smooth. Slopes are those of settled
//! links; beside no other effect, rolled-out ones take their place for effects that let a joint float, which takes fifty times as long.

use nalgebra::{DMatrix, DVector};
use raven::Result;
use raven::effects::Element;

use super::fit::{Fitter, Hypothesis, side_by_side};
use super::linear::{Quadratic, dot, evidence};
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
    /// Of the point's own hypothesis.
    model: Quadratic,
    /// What the slopes promise where the point's own hypothesis is fitted, above what it came to.
    promised: f64,
}

impl Point<'_> {
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
            model: Quadratic::new(&columns, &base.residuals),
        };
        let precision = self.precision(&base.free, &base.effects);
        let at = DVector::from_iterator(base.free.len(), base.free.iter().map(|&c| base.u[c]));
        let promise = point.model.minimum(&at, &precision).and_then(|(_, cost)| evidence(&point.model.information, &precision, cost));
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
        let at_point: &[f64] = if links == Links::Settled { &point.settled } else { &base.residuals };
        let there = if unmoved { None } else { Some(self.rows.residuals(&self.coordinates.settings(&u), links, channels)?) };
        // The point's own slopes are of settled links.
        let slopes: Vec<Column> =
            match (unmoved && !is_rolled_out).then(|| own.iter().map(|c| base.free.iter().position(|f| f == c)).collect()) {
                Some(Some(at)) => Vec::<usize>::into_iter(at).map(|k| base.columns[k].clone()).collect(),
                _ => self.slopes_beside(&u, there.as_deref().unwrap_or(at_point), &own, links)?,
            };
        let shift = there.map(|there| self.rows.less(&there, at_point, channels));
        let kept: Vec<usize> = (0..base.free.len()).filter(|&k| !own.contains(&base.free[k])).collect();
        let model = point.beside(&slopes, &kept, shift.as_deref());
        let mut effects = [base.effects.as_slice(), &[effect]].concat();
        effects.sort_unstable();
        let coordinates: Vec<usize> = own.iter().copied().chain(kept.iter().map(|&k| base.free[k])).collect();
        let precision = self.precision(&coordinates, &effects);
        let at = DVector::from_iterator(coordinates.len(), coordinates.iter().map(|&c| u[c]));
        let Some((free_step, free_cost)) = model.minimum(&at, &precision) else { return Ok(None) };
        // The effect's own numbers go as far as they may, the others make the best of it.
        let inside =
            DVector::from_iterator(own.len(), own.iter().enumerate().map(|(a, &c)| self.kept_inside(c, u[c], free_step[a]) - u[c]));
        let is_bounded = inside.iter().zip(free_step.iter()).any(|(step, free)| (step - free).abs() > 1e-9);
        let bounded = if is_bounded { model.minimum_beside(&inside, &at, &precision) } else { Some((free_step, free_cost)) };
        let Some((step, cost)) = bounded else { return Ok(None) };
        let Some((evidence, covariance)) = evidence(&model.information, &precision, cost) else { return Ok(None) };
        coordinates.iter().zip(step.iter()).for_each(|(&c, step)| u[c] = self.kept_inside(c, u[c], *step));
        let std = |c: usize| coordinates.iter().position(|&at| at == c).map_or(1.0, |k| covariance[(k, k)].sqrt());
        let evidence = evidence + self.beyond_normal(&effects, &|c| u[c], &std) - point.promised;
        Ok(Some(Candidate { evidence, effects, start: u, doubt: point.promised.abs() }))
    }

    /// Whether an effect lets a joint float, as backlash does: without a load it settles anywhere, and only rolled-out links say where it is.
    pub(super) fn is_loose(&self, effect: usize) -> bool {
        self.coordinates.sited[effect].effect.element == Some(Element::Gap)
    }
}
