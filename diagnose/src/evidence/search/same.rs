//! Hypotheses that leave the same are as likely as each other.
//!
//! Where joints stick a cost is jagged: of fits that describe the same robot each finds a place of its own to stay in, some nats from the others', and
//! slopes over a small step scatter as well, by which numbers seem to be known better than they are. Which of them is named would go by rounding. Only
//! what is believed of their effects beforehand is to tell. From the residuals `r` and slopes of the one that came to the least, with an effect in the
//! place of another one that does the same, a hypothesis is where these slopes lead it, less where they would lead that one:
//!
//! ```text
//! d_k = argmin F_k(d),   F_k(d) = |r - J_k d|^2 / 2 + |(u_k + d) / t_k|^2 / 2
//! u_k + d_k - d,   r - J_k (d_k - d),   at a cost of F + F_k(d_k) - F(d)
//! ```
//!
//! with `J_k` its slopes but for those by the effect itself.

use nalgebra::DVector;
use raven::Result;

use super::refit::LOST_NATS;
use crate::evidence::fit::linear::{Quadratic, dot, evidence};
use crate::evidence::fit::slopes::Column;
use crate::evidence::fit::{Fitter, Hypothesis, side_by_side};
use crate::evidence::recorded::rows::Links;

/// Fits of one robot end no further apart than this [nat].
const APART_NATS: f64 = 10.0;

impl Fitter<'_> {
    /// Makes those of some close fits that can leave the same as the cheapest of them, having one effect in the place of one of its own, as likely as it.
    /// Tells which they are, it among them; nothing where there are none.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn level_the_same(&self, close: &mut [Hypothesis]) -> Result<Vec<usize>> {
        let Some(cheapest) = (0..close.len()).min_by(|&a, &b| close[a].cost.total_cmp(&close[b].cost)) else { return Ok(Vec::new()) };
        let is_near = |k: usize| close[k].cost < close[cheapest].cost + APART_NATS;
        let others: Vec<usize> = (0..close.len()).filter(|&k| k != cheapest && is_near(k)).collect();
        if others.is_empty() {
            return Ok(Vec::new());
        }
        let Some(leader) = self.with_slopes_of(close, &close[cheapest])? else { return Ok(Vec::new()) };
        let mut same = side_by_side(&others, |&k| Ok(self.as_likely_as(&leader, &close[k])?.map(|hypothesis| (k, hypothesis))))?;
        if same.is_empty() {
            return Ok(Vec::new());
        }
        same.push((cheapest, leader));
        let which = same.iter().map(|(k, _)| *k).collect();
        same.into_iter().for_each(|(k, hypothesis)| close[k] = hypothesis);
        Ok(which)
    }

    /// A hypothesis with the slopes by all that is an effect of some taken alike, as far as it has those within its tolerances: what is the same by two
    /// numbers is to have slopes that are. `None` where they give no evidence.
    fn with_slopes_of(&self, some: &[Hypothesis], hypothesis: &Hypothesis) -> Result<Option<Hypothesis>> {
        let has = |c: usize| some.iter().any(|h| h.effects.contains(&self.coordinates.all[c].effect));
        let mut with = hypothesis.clone();
        for (column, &c) in with.columns.iter_mut().zip(&hypothesis.free).filter(|(_, c)| has(**c)) {
            *column = self.smooth_slope(hypothesis, &hypothesis.u, c)?;
        }
        Ok(self.weighed_anew(with))
    }

    /// A hypothesis with an effect in the place of one of another's, where it leaves the same as that one; `None` where it does not.
    fn as_likely_as(&self, other: &Hypothesis, hypothesis: &Hypothesis) -> Result<Option<Hypothesis>> {
        let Some([found, instead]) = other.swapped(hypothesis) else { return Ok(None) };
        let mut u = self.taking(&self.without(found, &other.u), &[instead], &hypothesis.u);
        let own: Vec<usize> = self.coordinates.of(instead).filter(|c| hypothesis.free.contains(c)).collect();
        let slopes = side_by_side(&own, |&c| self.smooth_slope(hypothesis, &u, c).map(Some))?;
        let off =
            |u: &[f64]| self.exact(u).map(|here| here.iter().zip(&other.residuals).map(|(here, there)| here - there).collect::<Vec<f64>>());
        // Its effect is to do what the other one does.
        let matching = Quadratic::new(&slopes.iter().map(|slope| slope.as_slice()).collect::<Vec<_>>(), &off(&u)?);
        let at = DVector::from_iterator(own.len(), own.iter().map(|&c| u[c]));
        let Some((step, _)) = matching.minimum(&at, &self.precision(&own, &hypothesis.effects)) else { return Ok(None) };
        own.iter().zip(step.iter()).for_each(|(&c, &step)| u[c] = self.stepped(c, u[c], step));
        let off = off(&u)?;
        let is_same = 0.5 * dot(&off, &off) < LOST_NATS;
        let column = |c: &usize| {
            let of_other = || other.free.iter().position(|free| free == c).map(|k| &other.columns[k]);
            own.iter().position(|own| own == c).map(|k| &slopes[k]).or_else(of_other).cloned()
        };
        let Some(columns) = hypothesis.free.iter().map(column).collect::<Option<Vec<Column>>>().filter(|_| is_same) else {
            return Ok(None);
        };
        let mut same = Hypothesis {
            u,
            residuals: other.residuals.clone(),
            columns,
            raised: other.raised,
            is_close: other.is_close,
            ..hypothesis.clone()
        };
        let Some(((step, least), (step_of_other, least_of_other))) = self.promised_minimum(&same).zip(self.promised_minimum(other)) else {
            return Ok(None);
        };
        // What slopes promise both, and the other one did not come to, is left as it is.
        for (k, &c) in same.free.iter().enumerate() {
            let promised_both = other.free.iter().position(|&free| free == c).map_or(0.0, |k| step_of_other[k]);
            let to = self.stepped(c, same.u[c], step[k] - promised_both);
            same.residuals.iter_mut().zip(same.columns[k].iter()).for_each(|(residual, slope)| *residual -= slope * (to - same.u[c]));
            same.u[c] = to;
        }
        same.cost = other.cost + least - least_of_other;
        Ok(self.weighed_anew(same))
    }

    /// The slope by a number of a hypothesis at a point, over the deviation that it has: by rolled-out links where it changes how a joint follows its cable.
    fn smooth_slope(&self, hypothesis: &Hypothesis, u: &[f64], c: usize) -> Result<Column> {
        let links = if self.followed(self.coordinates.all[c].effect).is_some() { Links::RolledOut } else { Links::Settled };
        self.slope_over(u, c, links, hypothesis.std(c))
    }

    /// The least cost that slopes promise from where a hypothesis is [nat], with the step there.
    fn promised_minimum(&self, hypothesis: &Hypothesis) -> Option<(DVector<f64>, f64)> {
        let at = DVector::from_iterator(hypothesis.free.len(), hypothesis.free.iter().map(|&c| hypothesis.u[c]));
        hypothesis.quadratic().minimum(&at, &self.precision(&hypothesis.free, &hypothesis.effects))
    }

    /// A hypothesis with the evidence that its slopes and its cost give; `None` where they give none.
    fn weighed_anew(&self, mut hypothesis: Hypothesis) -> Option<Hypothesis> {
        let precision = self.precision(&hypothesis.free, &hypothesis.effects);
        let (evidence, covariance) = evidence(&hypothesis.quadratic().information, &precision, hypothesis.cost)?;
        hypothesis.covariance = covariance;
        let beyond_normal = self.beyond_normal(&hypothesis.effects, &|c| hypothesis.u[c], &|c| hypothesis.std(c));
        hypothesis.evidence = evidence + beyond_normal + hypothesis.raised;
        Some(hypothesis)
    }
}
