//! Friction of a joint that holds or gives way the other way round than its file has it.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::DVector;
use raven::Result;
use raven::robot::Robot;

use super::{Joints, Problem};
use crate::batch::IDENTIFIED_BELOW;
use crate::parameters::Quantity;

/// `held_part_1`: how much of a joint's friction holds instead of giving way, where the rest of 1 is far likelier than what its file has.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldPart {
    /// Joint.
    pub joint: usize,
    /// Value of the file [1].
    pub before: f64,
    /// The one found [1].
    pub after: f64,
    /// Part of the deviation that the sightings left.
    pub left: f64,
}

impl HeldPart {
    /// Its name with its joint.
    #[must_use]
    pub fn name(&self) -> String {
        format!("held_part_{}", self.joint + 1)
    }

    /// Where it stands in the robot file.
    #[must_use]
    pub fn key(&self, robot: &Robot) -> String {
        key(robot, self.joint)
    }

    /// Deviation of two values of which either is as likely [1].
    #[must_use]
    pub fn prior_std(&self) -> f64 {
        0.5 * (self.after - self.before).abs()
    }

    /// Deviation by what the sightings say of them [1].
    #[must_use]
    pub fn std(&self) -> f64 {
        self.left * self.prior_std()
    }
}

fn key(robot: &Robot, joint: usize) -> String {
    let name = robot.joints.get(joint).map_or("", |joint| joint.name.as_str());
    format!("joints.{name}.link_friction.held_part")
}

impl Problem<'_> {
    /// Goes over to the rest of 1 of what holds, with what is most probable there, if that is clearly the likelier: nobody knows beforehand whether
    /// friction holds or creeps, which shows at the reversals that are looked at.
    pub(super) fn turn_over_held(&mut self, z: &mut DVector<f64>) -> Result<()> {
        let Some(mut other) = self.held_by_the_rest() else { return Ok(()) };
        let mut at_other = z.clone();
        other.refine(&mut at_other)?;
        let chance = 1.0 / (1.0 + (self.likelihood(z)? - other.likelihood(&at_other)?).exp());
        let left = 2.0 * (chance * (1.0 - chance)).sqrt();
        if chance > 0.5 && left <= IDENTIFIED_BELOW {
            other.held.iter_mut().for_each(|held| held.left = left);
            (*self, *z) = (other, at_other);
        }
        Ok(())
    }

    /// With what holds the other way round at the joints whose reversals are looked at; `None` where all hold by half.
    fn held_by_the_rest(&self) -> Option<Self> {
        let of_reversals = self.unknowns.iter().filter_map(|unknown| match unknown.quantity {
            Quantity::Stiffness(j) | Quantity::Coulomb(j) | Quantity::Hysteresis(j) => Some(j),
            _ => None,
        });
        let mut other = Self { joints: Joints::AtRest, rolled: Arc::default(), ..self.clone() };
        for joint in of_reversals.collect::<BTreeSet<_>>() {
            let Some(value) = other.anchored.value_mut(&key(&self.anchored, joint)) else { continue };
            let (before, after) = (*value, 1.0 - *value);
            if before != 0.5 {
                *value = after;
                other.held.push(HeldPart { joint, before, after, left: 1.0 });
            }
        }
        (!other.held.is_empty()).then_some(other)
    }

    /// What was found to hold the other way round.
    #[must_use]
    pub fn held(&self) -> &[HeldPart] {
        &self.held
    }
}
