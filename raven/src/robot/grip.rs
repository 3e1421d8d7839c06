//! Friction that holds, where links are rolled out: bristles that bend a little before they slide.
//!
//! ```text
//! f_j = clip(s_j (q_j - a_j) + d_j qd_j, -F_j, F_j)      a_j follows so that |q_j - a_j| <= F_j / s_j
//! ```
//!
//! A joint at rest stays where it is under any force up to its dry friction `F`, and one that slides is slowed down by all of it: a link that
//! swings on a soft cable comes to rest, which the [play](super::stiction) of what drives it cannot do. Elasto-plastic friction (Dupont, Hayward,
//! Armstrong, Altpeter, IEEE Transactions on Automatic Control 47, 2002, with a sharp onset of sliding).

use nalgebra::Vector3;

use super::Arm;

/// By how much a bristle is stiffer than the cable that pulls at it: the play of a joint is rounded by so small a part of it.
const STIFFER: f64 = 100.0;

/// Bristles of the three joints; none where friction does not hold.
#[derive(Debug, Clone, Copy)]
pub struct Grip {
    /// `s` [N m/rad, N m/rad, N/m].
    pub stiffness: Vector3<f64>,
    /// `d` [N m s/rad, N m s/rad, N s/m]: half of the critical one.
    pub damping: Vector3<f64>,
}

impl Grip {
    /// Of an arm, its joints with so much inertia [kg m^2, kg m^2, kg].
    #[must_use]
    pub fn new(arm: &Arm, inertia: &Vector3<f64>) -> Self {
        let stiffness =
            Vector3::from_fn(|j, _| if arm.link_friction[j].held_part > 0.0 { STIFFER * arm.joint_stiffness(j, 0.0) } else { 0.0 });
        Self { stiffness, damping: stiffness.component_mul(inertia).map(f64::sqrt) }
    }

    /// Friction [N m, N m, N] of joints that are held at `anchor`, up to `limit`.
    #[must_use]
    pub fn friction(&self, anchor: &Vector3<f64>, position: &Vector3<f64>, rate: &Vector3<f64>, limit: &Vector3<f64>) -> Vector3<f64> {
        let bent = self.stiffness.component_mul(&(position - anchor)) + self.damping.component_mul(rate);
        bent.zip_map(limit, within)
    }

    /// Where joints are held that rest at `position` against so much friction [N m, N m, N].
    #[must_use]
    pub fn anchor(&self, position: &Vector3<f64>, friction: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|j, _| if self.stiffness[j] > 0.0 { position[j] - friction[j] / self.stiffness[j] } else { position[j] })
    }

    /// Where joints are held that have come to `position` from where they were held before.
    #[must_use]
    pub fn slid(&self, anchor: &Vector3<f64>, position: &Vector3<f64>, limit: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|j, _| {
            let reach = if self.stiffness[j] > 0.0 { limit[j] / self.stiffness[j] } else { 0.0 };
            position[j] - within(position[j] - anchor[j], reach)
        })
    }
}

/// A value no farther from zero than `most`. As two comparisons: [`f64::min`] takes care of numbers that are none, for which a step's every stage
/// would wait, and [`f64::clamp`] panics at a limit that is none.
fn within(value: f64, most: f64) -> f64 {
    let below = if value < most { value } else { most };
    if below > -most { below } else { -most }
}
