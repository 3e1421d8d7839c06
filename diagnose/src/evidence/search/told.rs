//! A fit that is told which effects there are: the most that any diagnosis could close of the gap, and whether it could see them at all.

use raven::Result;

use super::WITHIN_NATS;
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};

impl Fitter<'_> {
    /// Fits named effects, one after the other and at last together, and tells what each of them gains beside the others, at least [nat];
    /// `None` where the model cannot be evaluated.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn told(&self, effects: &[usize]) -> Result<Option<(Hypothesis, f64)>> {
        let Some(nominal) = self.at_nominal()? else { return Ok(None) };
        let Some(none) = self.fit(&[], &nominal.u, None)? else { return Ok(None) };
        let Some(mut point) = self.added(&nominal, &none, effects)? else { return Ok(None) };
        let mut without_one = Vec::new();
        for left_out in point.effects.clone() {
            let others = point.all_but(left_out);
            let (alone, again) = if others.is_empty() {
                (Some(none.clone()), None)
            } else {
                (self.added(&nominal, &none, &others)?, self.fit(&others, &self.without(left_out, &point.u), Some(&point))?)
            };
            let better = alone.into_iter().chain(again).max_by(|a, b| a.evidence.total_cmp(&b.evidence));
            let Some(without) = better else { return Ok(None) };
            // What it stopped short of is no evidence for the effect.
            let without = self.fitted_as(&without, &point)?.unwrap_or(without);
            // With one more effect it can do no worse: where it got lost on the way it starts again from there.
            if without.evidence > point.evidence {
                let start = self.taking(&without.u, &[left_out], &point.u);
                let again = self.fit(&point.effects, &start, Some(&without))?;
                point = again.filter(|again| again.evidence > point.evidence).unwrap_or(point);
            }
            without_one.push(without);
        }
        let gain = self.least_gain(&point, &without_one);
        if gain > WITHIN_NATS || self.leftover(&point).most() > WITHIN_NATS {
            return Ok(Some((point, gain)));
        }
        let Some((close, without_one)) = self.told_closely(&point, &without_one)? else { return Ok(Some((point, gain))) };
        let gain = self.least_gain(&close, &without_one);
        Ok(Some((if close.supersedes(&point) { close } else { point }, gain)))
    }

    /// By how much a hypothesis is more probable than each of those without one of its effects, at least, what it leaves counting as noise [nat].
    fn least_gain(&self, point: &Hypothesis, without_one: &[Hypothesis]) -> f64 {
        let leftover = self.leftover(point);
        let gain = without_one.iter().map(|without| self.tempered(point, &leftover) - self.tempered(without, &leftover));
        gain.fold(f64::INFINITY, f64::min)
    }

    /// A hypothesis and those without one of its effects, each fitted once more by slopes of rolled-out links: where little is between them, what a fit
    /// by those of settled links stopped short of is as much. `None` where one comes to nothing.
    fn told_closely(&self, point: &Hypothesis, without_one: &[Hypothesis]) -> Result<Option<(Hypothesis, Vec<Hypothesis>)>> {
        let Some(mut close) = self.fitted_closely(&point.effects, &point.u, None)? else { return Ok(None) };
        let whole = close.clone();
        let closely = |without: &Hypothesis| {
            let rest = self.taking(&whole.u, &point.effects, &without.u);
            let Some((_, start)) = self.cheapest(&without.effects, vec![without.u.clone(), rest])? else { return Ok(None) };
            self.fitted_closely(&without.effects, &start, Some(&whole))
        };
        let without_one = side_by_side(without_one, closely)?;
        for without in &without_one {
            if self.is_lost(&close, without) {
                let start = self.taking(&without.u, &point.effects, &whole.u);
                close = self.fitted_closely(&point.effects, &start, Some(without))?.filter(|h| h.cost < close.cost).unwrap_or(close);
            }
        }
        Ok((without_one.len() == point.effects.len()).then_some((close, without_one)))
    }

    /// Some effects, fitted one after the other from the nominal model, which has been fitted itself as `none`.
    fn added(&self, nominal: &Hypothesis, none: &Hypothesis, effects: &[usize]) -> Result<Option<Hypothesis>> {
        let mut point = nominal.clone();
        for &effect in effects {
            let poorer = if point.effects.is_empty() { none } else { &point };
            let Some(candidate) = self.screen_some(&point, poorer.evidence, &[effect])?.into_iter().next() else { return Ok(None) };
            let Some(hypothesis) = self.fitted_at_least(&candidate, &point, poorer)? else { return Ok(None) };
            point = hypothesis;
        }
        Ok(Some(point))
    }
}
