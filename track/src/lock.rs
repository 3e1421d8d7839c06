//! What the tracker believes: by how much the tip differs from where the motors put it.
//!
//! Wrong radii, offsets, stretch and latency make that difference centimetres at worst, and it changes slowly. A blob that asks for a
//! sudden change is no marker.

use std::collections::VecDeque;

use nalgebra::{Matrix3, Vector3};

/// How far the tip can be from the prediction at all [m]: 5 % of a radius, 2 deg of offset and of registration together make 40 mm.
pub const FARTHEST_M: f64 = 0.08;
/// Standard deviation of the change of the difference between two frames, and per time since [m, m/s]: play and stretch give way within a
/// frame, and 5 % of an arm's fastest motion is 10 mm/s.
const CHANGE_M: f64 = 0.0015;
const CHANGE_M_S: f64 = 0.02;
/// Standard deviation after a long time without sight [m].
const CHANGE_LIMIT_M: f64 = 0.025;
/// Chi-square with three degrees of freedom that is exceeded by chance in 1 of 10000.
const GATE_CHI2: f64 = 21.1;
/// After so many rejected sightings that agree with one another, they are right and the belief was wrong.
const RIVALS: usize = 10;
/// Sightings over which the size of the marker is averaged.
const SIZES: usize = 45;
/// Standard deviation of the difference before the first sighting [m].
const UNKNOWN_M: f64 = 0.03;

/// Difference of the tip from its prediction, frame 0, as last seen.
#[derive(Debug, Clone, Default)]
pub struct Lock {
    last: Option<(Vector3<f64>, f64)>,
    rival: Option<(Vector3<f64>, f64, usize)>,
}

impl Lock {
    /// The difference [m], zero before the first sighting.
    #[must_use]
    pub fn offset_m(&self) -> Vector3<f64> {
        self.last.map_or_else(Vector3::zeros, |(offset, _)| offset)
    }

    /// Whether the marker has been seen.
    #[must_use]
    pub const fn is_set(&self) -> bool {
        self.last.is_some()
    }

    /// Standard deviation per axis of the difference at a time [m].
    #[must_use]
    pub fn std_m(&self, time_s: f64) -> f64 {
        self.last.map_or(UNKNOWN_M, |(_, since)| (CHANGE_M + CHANGE_M_S * (time_s - since).abs()).min(CHANGE_LIMIT_M))
    }

    /// Distance across the line of sight within which one camera alone may take a blob for the marker [m].
    #[must_use]
    pub fn reach_m(&self, time_s: f64) -> f64 {
        if self.is_set() { GATE_CHI2.sqrt() * self.std_m(time_s) } else { FARTHEST_M }
    }

    /// Squared distance of a difference seen now from the one believed, in standard deviations; `None` if it is impossible.
    #[must_use]
    pub fn distance2(&self, offset_m: &Vector3<f64>, covariance: &Matrix3<f64>, time_s: f64) -> Option<f64> {
        if !offset_m.iter().all(|v| v.is_finite()) || offset_m.norm() > FARTHEST_M {
            return None;
        }
        let change = offset_m - self.offset_m();
        let spread = covariance + Matrix3::identity() * self.std_m(time_s).powi(2);
        let chi2 = change.dot(&(spread.try_inverse()? * change));
        (!self.is_set() || chi2 < GATE_CHI2).then_some(chi2)
    }

    /// Takes a difference that was accepted.
    pub fn accept(&mut self, offset_m: Vector3<f64>, time_s: f64) {
        self.last = Some((offset_m, time_s));
        self.rival = None;
    }

    /// Notes a possible but sudden difference; after many that agree it is believed. Returns whether it now is.
    pub fn reject(&mut self, offset_m: Vector3<f64>, covariance: &Matrix3<f64>, time_s: f64) -> bool {
        if offset_m.norm() > FARTHEST_M {
            return false;
        }
        let count = self.rival.map_or(1, |(offset, since, count)| {
            let rival = Self { last: Some((offset, since)), rival: None };
            if rival.distance2(&offset_m, covariance, time_s).is_some() { count + 1 } else { 1 }
        });
        self.rival = Some((offset_m, time_s, count));
        if count >= RIVALS {
            self.accept(offset_m, time_s);
        }
        count >= RIVALS
    }
}

/// Size of the marker in one camera, relative to what its radius and depth give, and whether it is hidden.
#[derive(Debug, Clone, Default)]
pub struct Size {
    recent: VecDeque<f64>,
    hidden: bool,
}

impl Size {
    /// Whether a blob with `share` of the expected area can be the whole marker.
    ///
    /// Before the first sighting the limits are wide: the mask's edge is a pixel off and the depth is only roughly known. Then a blob
    /// with less than 0.80 of the usual area is partly hidden, and once the marker was hidden it is whole again from 0.88 on.
    #[must_use]
    pub fn fits(&self, share: f64) -> bool {
        let Some(usual) = self.usual() else { return (0.36..2.6).contains(&share) };
        (if self.hidden { 0.88 } else { 0.80 }..1.6).contains(&(share / usual))
    }

    /// Notes that the marker is hidden, in part or altogether.
    pub const fn lost(&mut self) {
        self.hidden = true;
    }

    /// Takes the share of a blob that was accepted.
    pub fn accept(&mut self, share: f64) {
        self.hidden = false;
        if self.recent.len() == SIZES {
            self.recent.pop_front();
        }
        self.recent.push_back(share);
    }

    /// Forgets, where the belief about the marker has changed.
    pub fn forget(&mut self) {
        self.recent.clear();
    }

    /// Upper quartile of the recent sizes: partly hidden ones only make it smaller.
    fn usual(&self) -> Option<f64> {
        let mut sizes: Vec<f64> = self.recent.iter().copied().collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(3 * sizes.len() / 4).copied()
    }
}
