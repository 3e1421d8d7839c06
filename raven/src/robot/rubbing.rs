//! Friction of the joints, with what does not change along a motion worked out: rollouts ask for it four times a step.

use nalgebra::Vector3;

use super::Arm;

/// Dry friction of the joints [N m, N m, N] under tension differences of their cables [N].
#[derive(Debug, Clone, Copy)]
struct Dry {
    coulomb: Vector3<f64>,
    per_tension: Vector3<f64>,
}

impl Dry {
    fn part(arm: &Arm, part: impl Fn(usize) -> f64) -> Self {
        let per_load = |j: usize| arm.link_friction[j].per_load * arm.transmission.link_radius_m[j].abs();
        Self {
            coulomb: Vector3::from_fn(|j, _| part(j) * arm.link_friction[j].coulomb),
            per_tension: Vector3::from_fn(|j, _| part(j) * per_load(j)),
        }
    }

    fn under(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.coulomb + self.per_tension.component_mul(&tension_n.abs())
    }
}

/// Friction of three joints.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rubbing {
    creeping: Dry,
    holding: Dry,
    /// By speed [s/rad, s/rad, s/m]: of where Coulomb friction is whole.
    per_stiction_speed: Vector3<f64>,
    viscous: Vector3<f64>,
}

impl Rubbing {
    pub(super) fn new(arm: &Arm) -> Self {
        let held = |j: usize| arm.link_friction[j].held_part;
        Self {
            creeping: Dry::part(arm, |j| 1.0 - held(j)),
            holding: Dry::part(arm, held),
            per_stiction_speed: Vector3::from_fn(|j, _| arm.stiction_speed(j).recip()),
            viscous: Vector3::from_fn(|j, _| arm.link_friction[j].viscous),
        }
    }

    /// Friction that does not hold [N m, N m, N] at joint velocities.
    pub(super) fn moving_n(&self, rate: &Vector3<f64>, tension_n: &Vector3<f64>) -> Vector3<f64> {
        let way = rate.component_mul(&self.per_stiction_speed).map(|way| way.clamp(-1.0, 1.0));
        self.creeping_n(tension_n).component_mul(&way) + self.viscous.component_mul(rate)
    }

    /// Coulomb friction that gives way at rest [N m, N m, N].
    pub(super) fn creeping_n(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.creeping.under(tension_n)
    }

    /// Coulomb friction that holds, at most [N m, N m, N].
    pub(super) fn holding_n(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.holding.under(tension_n)
    }

    /// Whether what holds goes by the cables' tension.
    pub(super) fn holds_by_tension(&self) -> bool {
        self.holding.per_tension != Vector3::zeros()
    }
}
