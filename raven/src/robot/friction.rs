//! Friction of the joints: dry friction, which grows with what their cables pull, and viscous friction.
//!
//! ```text
//! (F_c + mu r_l |T|) clip(qd / v_s) + F_v qd
//! ```
//!
//! with the tension difference `T` of a joint's cable. A part of dry friction may hold its joint (`held_part`); that part is not in here but in
//! [play](super::stiction) or [grips](super::grip).

use nalgebra::Vector3;

use super::{Arm, STICTION_SPEED};

/// Dry friction of the joints [N m, N m, N] by tension differences of their cables.
#[derive(Debug, Clone, Copy)]
pub struct DryFriction {
    coulomb: Vector3<f64>,
    per_tension: Vector3<f64>,
}

impl DryFriction {
    /// At such tension differences [N].
    #[must_use]
    pub fn under(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.coulomb + self.per_tension.component_mul(&tension_n.abs())
    }

    /// Whether it grows with tension.
    #[must_use]
    pub fn grows(&self) -> bool {
        self.per_tension != Vector3::zeros()
    }

    fn part(&self, part: &Vector3<f64>) -> Self {
        Self { coulomb: self.coulomb.component_mul(part), per_tension: self.per_tension.component_mul(part) }
    }
}

impl Arm {
    /// Dry friction of the joints, what holds them included.
    #[must_use]
    pub fn dry_friction(&self) -> DryFriction {
        DryFriction {
            coulomb: Vector3::from_fn(|j, _| self.link_friction[j].coulomb),
            per_tension: Vector3::from_fn(|j, _| self.link_friction[j].per_load * self.transmission.link_radius_m[j].abs()),
        }
    }

    /// Friction of the joints by speed [N m s/rad, N m s/rad, N s/m].
    #[must_use]
    pub fn viscous_friction(&self) -> Vector3<f64> {
        Vector3::from_fn(|j, _| self.link_friction[j].viscous)
    }

    /// Speed of a joint below which its Coulomb friction fades [rad/s or m/s].
    #[must_use]
    pub fn stiction_speed(&self, j: usize) -> f64 {
        self.link_friction[j].stiction_speed.unwrap_or(STICTION_SPEED[j])
    }

    /// Which way Coulomb friction acts at joint velocities: -1 to 1 per joint. Towards rest it fades as what a step of finite length needs to
    /// stop the joint (Kikuuwe, Takesue, Sano, Mochiyama, Fujimoto 2005, eq. 16).
    #[must_use]
    pub fn rubbing(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        way(rate, &self.per_stiction_speed())
    }

    fn per_stiction_speed(&self) -> Vector3<f64> {
        Vector3::from_fn(|j, _| self.stiction_speed(j).recip())
    }
}

fn way(rate: &Vector3<f64>, per_stiction_speed: &Vector3<f64>) -> Vector3<f64> {
    rate.component_mul(per_stiction_speed).map(|way| way.clamp(-1.0, 1.0))
}

/// Friction with what does not change along a motion worked out: rollouts ask for it four times a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Friction {
    creeping: DryFriction,
    holding: DryFriction,
    /// By speed [s/rad, s/rad, s/m]: of where Coulomb friction is whole.
    per_stiction_speed: Vector3<f64>,
    viscous: Vector3<f64>,
}

impl Friction {
    pub(super) fn new(arm: &Arm) -> Self {
        let dry = arm.dry_friction();
        let held = Vector3::from_fn(|j, _| arm.link_friction[j].held_part);
        Self {
            creeping: dry.part(&held.map(|held| 1.0 - held)),
            holding: dry.part(&held),
            per_stiction_speed: arm.per_stiction_speed(),
            viscous: arm.viscous_friction(),
        }
    }

    /// Friction that does not hold [N m, N m, N] at joint velocities.
    pub(super) fn moving(&self, rate: &Vector3<f64>, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.creeping(tension_n).component_mul(&self.way(rate)) + self.viscous.component_mul(rate)
    }

    /// Coulomb friction that gives way at rest [N m, N m, N].
    pub(super) fn creeping(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.creeping.under(tension_n)
    }

    /// Coulomb friction that holds, at most [N m, N m, N].
    pub(super) fn holding(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.holding.under(tension_n)
    }

    /// Whether what holds goes by the cables' tension.
    pub(super) fn holds_by_tension(&self) -> bool {
        self.holding.grows()
    }

    /// Which way Coulomb friction acts at joint velocities, as [`Arm::rubbing`].
    pub(super) fn way(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        way(rate, &self.per_stiction_speed)
    }

    /// Whether any of it goes by the cables' tension.
    pub(super) fn goes_by_tension(&self) -> bool {
        self.creeping.grows() || self.holding.grows()
    }

    /// Friction by speed at rest [N m s/rad, N m s/rad, N s/m], under such tension differences of the cables [N].
    pub(super) fn by_speed_at_rest(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.creeping(tension_n).component_mul(&self.per_stiction_speed) + self.viscous
    }
}
