//! Slopes of residuals by coordinates: by which links each is taken, and when a fit takes it anew.

use std::borrow::Cow;
use std::sync::Arc;

use raven::Result;
use raven::effects::{Channel, Effect, Element, Scale, Scope, Stage};
use rayon::prelude::*;

use super::{Fitter, Hypothesis, STRAINED};
use crate::evidence::recorded::rows::{ALL, Links};

/// Step of difference quotients, in units of the slab, and at most a tolerance of the file.
pub(crate) const DIFFERENCE: f64 = 0.02;
/// The slope by a number of the nominal model is taken anew when that number has moved so far, in units of the slab.
const MOVED: f64 = 0.15;

/// How a fit takes slopes by numbers that change how a joint follows its cable, at joints with an effect. A joint that is held by friction, swings
/// or floats in slack has little to do with the settled one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Following {
    /// By slopes of settled links.
    Settled,
    /// Where they are, while the others settle down.
    Held,
    /// By slopes of rolled-out links, which take fifty times as long.
    RolledOut,
    /// By slopes of rolled-out links, at all joints.
    AllRolledOut,
}

/// A column of slopes, shared between hypotheses.
pub type Column = Arc<Vec<f64>>;

/// Slopes by the free coordinates of a fit.
pub(super) struct Slopes<'f> {
    fitter: &'f Fitter<'f>,
    coordinates: Vec<Treated>,
    /// Of each, and the point at which they were taken.
    taken: Vec<Option<(Column, Arc<Vec<f64>>)>>,
}

/// A free coordinate as a fit treats it.
struct Treated {
    c: usize,
    /// Whether it is of an effect of the hypothesis.
    is_own: bool,
    /// Whether it is of one that shows in how a joint swings.
    swings: bool,
    /// Whether it is about how a joint follows its cable, and the fit is to know.
    is_of_joints: bool,
    /// Whether its effect is about how a joint follows its cable, which goes by all numbers.
    follows: bool,
    /// Numbers of the hypothesis' effects by which its slopes go, if it is about how their joint follows its cable: what creeps is a multiple
    /// of what the cable's stiffness lets it stretch.
    beside: Vec<usize>,
    links: Links,
}

impl<'f> Slopes<'f> {
    /// Before a fit from a start: those of `like` where the same coordinates are free. Of what shows in swings none are borrowed.
    pub(super) fn begun(
        fitter: &'f Fitter<'f>,
        effects: &[usize],
        free: &[usize],
        start: &[f64],
        like: Option<&Hypothesis>,
        following: Following,
    ) -> Self {
        let of_joints = if matches!(following, Following::Settled | Following::Held) { Links::Settled } else { Links::RolledOut };
        let treated = |&c: &usize| {
            let effect = fitter.coordinates.all[c].effect;
            let (is_own, followed) = (effects.contains(&effect), fitter.followed(effect));
            let follows = followed.is_some();
            let goes_with = |e: &&usize| follows && !is_own && !fitter.is_loose(**e) && fitter.followed(**e) == followed;
            let beside = effects.iter().filter(goes_with).flat_map(|&e| fitter.coordinates.of(e)).collect();
            // What does not change how joints follow has the same slopes either way.
            let own_follows = is_own && (following != Following::AllRolledOut || follows);
            let is_of_joints = own_follows || fitter.follows_as(c, effects, start, following);
            let swings = is_own && fitter.shows_in_swings(effect);
            let links = match (swings, is_of_joints) {
                (true, _) => Links::RolledOut,
                (false, true) => of_joints,
                (false, false) => Links::Settled,
            };
            Treated { c, is_own, swings, is_of_joints, follows, beside, links }
        };
        let coordinates: Vec<Treated> = free.iter().map(treated).collect();
        let like = like.map(|like| (like, Arc::new(like.u.clone())));
        let borrowed = |of: &Treated| {
            let (like, at) = like.as_ref().filter(|_| !of.swings)?;
            let k = like.free.iter().position(|&f| f == of.c)?;
            Some((like.columns[k].clone(), at.clone()))
        };
        let taken = coordinates.iter().map(borrowed).collect();
        Self { fitter, coordinates, taken }
    }

    /// Takes those anew that no longer hold at a point, and if it `renews` all that are about how joints follow their cables.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(super) fn take_anew(&mut self, u: &[f64], renews: bool) -> Result<()> {
        let is_stale = |k: &usize| self.taken[*k].as_ref().is_none_or(|(_, at)| self.has_moved(*k, u, at)) || renews && self.is_old(*k, u);
        let stale: Vec<usize> = (0..self.coordinates.len()).filter(is_stale).collect();
        let here = Arc::new(u.to_vec());
        for links in [Links::Settled, Links::RolledOut] {
            let stale: Vec<usize> = stale.iter().copied().filter(|&k| self.coordinates[k].links == links).collect();
            let coordinates: Vec<usize> = stale.iter().map(|&k| self.coordinates[k].c).collect();
            for (&k, column) in stale.iter().zip(self.fitter.slopes(u, &coordinates, links)?) {
                self.taken[k] = Some((column, here.clone()));
            }
        }
        Ok(())
    }

    /// Whether a coordinate has moved too far from where its slopes were taken. Slopes by what belongs to a law go by how much there is of it:
    /// where friction holds nothing, it does not matter where it held a joint.
    fn has_moved(&self, k: usize, u: &[f64], at: &[f64]) -> bool {
        let Treated { c, is_own, ref beside, .. } = self.coordinates[k];
        let most = if is_own { 0.0 } else { MOVED };
        let moved = |c: usize| (u[c] - at[c]).abs() > most;
        let coordinate = self.fitter.coordinates.all[c];
        let is_of_law = coordinate.is_unknown() || !self.fitter.scale(c).is_size();
        moved(c) || is_of_law && self.fitter.coordinates.of(coordinate.effect).any(moved) || beside.iter().copied().any(moved)
    }

    /// Whether slopes about how a joint follows its cable are from somewhere else.
    fn is_old(&self, k: usize, u: &[f64]) -> bool {
        self.coordinates[k].follows && self.taken[k].as_ref().is_some_and(|(_, at)| **at != u)
    }

    /// Whether any are.
    pub(super) fn are_old(&self, u: &[f64]) -> bool {
        (0..self.coordinates.len()).any(|k| self.is_old(k, u))
    }

    /// Which coordinates are about how joints follow their cables, as far as the fit is to know.
    pub(super) fn of_joints(&self) -> Vec<usize> {
        (0..self.coordinates.len()).filter(|&k| self.coordinates[k].is_of_joints).collect()
    }

    /// As they are: one column per free coordinate.
    pub(super) fn columns(&self) -> Vec<Column> {
        self.taken.iter().flatten().map(|(column, _)| column.clone()).collect()
    }
}

impl Fitter<'_> {
    /// Slopes of the residuals' negative by coordinates at a point.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn slopes(&self, u: &[f64], coordinates: &[usize], links: Links) -> Result<Vec<Column>> {
        coordinates.par_iter().map(|&c| self.slope(u, None, c, links, self.difference(c))).collect()
    }

    /// The slope of the residuals' negative by a coordinate over a deviation to either side, where that is more than a difference quotient's step: what
    /// joints that stick make jagged is smooth then.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(crate) fn slope_over(&self, u: &[f64], c: usize, links: Links, deviation: f64) -> Result<Column> {
        self.slope(u, None, c, links, deviation.max(self.difference(c)))
    }

    /// As [`Self::slopes`] for half the price and not as close: to one side of a point whose residuals are known.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub(crate) fn slopes_beside(&self, u: &[f64], residuals: &[f64], coordinates: &[usize], links: Links) -> Result<Vec<Column>> {
        coordinates.par_iter().map(|&c| self.slope(u, Some(residuals), c, links, self.difference(c))).collect()
    }

    /// Step of a difference quotient.
    fn difference(&self, c: usize) -> f64 {
        self.coordinates.tolerance(c).map_or(DIFFERENCE, |tolerance| tolerance.min(DIFFERENCE))
    }

    fn slope(&self, u: &[f64], here: Option<&[f64]>, c: usize, links: Links, step: f64) -> Result<Column> {
        if matches!(self.scale(c), Scale::Whole { .. }) {
            return Ok(Arc::new(vec![0.0; self.rows.tip_rows() + self.rows.torque_rows()]));
        }
        let coordinate = self.coordinates.all[c];
        let channels = self.channels_of(coordinate.effect, links);
        // A magnitude has no other side of zero, and no state more than the motion could leave.
        let [least, largest] = self.scale(c).limits_u();
        let (from, to) = ((u[c] - step).max(least), (u[c] + step).min(largest));
        let (from, to) = match here {
            None => (from, to),
            Some(_) if to > u[c] => (u[c], to),
            Some(_) => (from, u[c]),
        };
        let at = |value: f64| match here {
            Some(here) if value == u[c] => Ok(Cow::Borrowed(here)),
            _ => {
                let mut moved = u.to_vec();
                moved[c] = value;
                self.rows.residuals(&self.coordinates.settings(&moved), links, channels).map(Cow::Owned)
            }
        };
        let mut slope = self.rows.less(&at(from)?, &at(to)?, channels);
        slope.iter_mut().for_each(|slope| *slope /= to - from);
        Ok(Arc::new(slope))
    }

    /// Whether a number of the nominal model is about how a joint of `effects` follows its cable, or any joint if the fit is to treat all;
    /// where there are no effects, any whose number is strained.
    fn follows_as(&self, c: usize, effects: &[usize], start: &[f64], following: Following) -> bool {
        let effect = self.coordinates.all[c].effect;
        let element = self.coordinates.sited[effect].effect.element;
        if following == Following::AllRolledOut {
            return matches!(element, Some(Element::Spring | Element::Dashpot | Element::Slider));
        }
        // Settled links say nothing of a damper that would be worth holding it for.
        let swings = following == Following::RolledOut && element == Some(Element::Dashpot);
        let follows = matches!(element, Some(Element::Spring | Element::Slider)) || swings;
        let with_effect = |&e: &usize| self.followed(e).is_some_and(|joint| Some(joint) == self.followed(effect));
        follows && if effects.is_empty() { self.strain(c, start) > STRAINED } else { effects.iter().any(with_effect) }
    }

    /// The joint whose way to follow its cable an effect changes.
    pub(crate) fn followed(&self, effect: usize) -> Option<usize> {
        let sited = &self.coordinates.sited[effect];
        let Effect { scope, stage, channels, .. } = sited.effect;
        let changes = *scope == Scope::Joint && matches!(stage, Stage::Transmission | Stage::Link) && channels.contains(&Channel::Tip);
        changes.then(|| sited.joint_measured())
    }

    /// Whether an effect shows in how a joint swings: settled links have a damper let it lag, and of one that is smaller have the sign wrong.
    pub(crate) fn shows_in_swings(&self, effect: usize) -> bool {
        self.coordinates.sited[effect].effect.element == Some(Element::Dashpot)
    }

    /// Channels in which links of this kind show an effect: how a joint swings on its cable is in its motor's torque as well. How it bounces in
    /// slack is, too, but so jagged that slopes say nothing of it.
    pub(crate) fn channels_of(&self, effect: usize, links: Links) -> &'static [Channel] {
        let swings = links == Links::RolledOut && self.followed(effect).is_some() && !self.is_loose(effect);
        if swings { &ALL } else { self.coordinates.sited[effect].effect.channels }
    }
}
