//! What of a joint may be the other way round than its file has it: whether friction holds or gives way, whether a loop turns as a play does.

use std::collections::BTreeSet;
use std::iter;
use std::sync::Arc;

use nalgebra::DVector;
use raven::Result;
use raven::robot::Robot;

use super::{Joints, Problem};
use crate::batch::IDENTIFIED_BELOW;
use crate::parameters::Quantity;

/// A joint of which the other end of a range is far likelier than what its file has.
#[derive(Debug, Clone, PartialEq)]
pub struct Turned {
    /// Joint.
    pub joint: usize,
    /// What was turned over.
    pub part: Part,
    /// Value of the file.
    pub before: f64,
    /// The one found.
    pub after: f64,
    /// Part of the deviation that the sightings left.
    pub left: f64,
}

/// Numbers of a joint from one end of a range to the other, of which nobody knows beforehand at which they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// `held_part_1`: how much of the joint's friction holds instead of giving way [0 to 1].
    Held,
    /// `straight_part_1`: how far its cable's loop turns straight, as a play does, before it rounds off; 0 and 1 are looked at.
    Straight,
}

impl Part {
    /// Its name with a joint.
    #[must_use]
    pub fn name(self, joint: usize) -> String {
        let name = match self {
            Self::Held => "held_part",
            Self::Straight => "straight_part",
        };
        format!("{name}_{}", joint + 1)
    }

    /// Where it stands in the robot file.
    #[must_use]
    pub fn key(self, robot: &Robot, joint: usize) -> String {
        let name = robot.joints.get(joint).map_or("", |joint| joint.name.as_str());
        match self {
            Self::Held => format!("joints.{name}.link_friction.held_part"),
            Self::Straight => format!("joints.{name}.hysteresis.straight_part"),
        }
    }

    /// The other one; `None` of what is half this and half that.
    fn other(self, value: f64) -> Option<f64> {
        let other = match self {
            Self::Held => 1.0 - value,
            Self::Straight => f64::from(u8::from(value < 0.5)),
        };
        (value != 0.5).then_some(other)
    }
}

impl Turned {
    /// Deviation of two values of which either is as likely.
    #[must_use]
    pub fn prior_std(&self) -> f64 {
        0.5 * (self.after - self.before).abs()
    }

    /// Deviation by what the sightings say of them.
    #[must_use]
    pub fn std(&self) -> f64 {
        self.left * self.prior_std()
    }
}

impl Problem<'_> {
    /// Goes over, with what is most probable there, to whatever is likelier the other way round.
    pub(super) fn turn_over(&mut self, z: &mut DVector<f64>) -> Result<()> {
        // Each step is to what is likelier, so that there is an end to them.
        let ways = self.ways();
        let mut same = 0;
        for (part, joints) in ways.iter().cycle() {
            if same == ways.len() {
                break;
            }
            let other = self.turned_over(*part, joints);
            same = if self.take_likelier(z, other)? { 1 } else { same + 1 };
        }
        Ok(())
    }

    /// What may be the other way round, at which joints together: nobody knows beforehand whether friction holds or creeps, which shows at the
    /// reversals that are looked at, or whether a loop whose rounding is looked for turns as a play does. What holds looks much like play, so
    /// that neither is settled before the other.
    fn ways(&self) -> Vec<(Part, BTreeSet<usize>)> {
        let joints = |of: fn(Quantity) -> Option<usize>| self.unknowns.iter().filter_map(move |unknown| of(unknown.quantity));
        let of_reversals = joints(|quantity| match quantity {
            Quantity::Stiffness(j) | Quantity::Coulomb(j) | Quantity::Hysteresis(j) => Some(j),
            _ => None,
        });
        let of_loops = joints(|quantity| if let Quantity::Rounding(j) = quantity { Some(j) } else { None });
        let loops = of_loops.map(|j| (Part::Straight, BTreeSet::from([j])));
        iter::once((Part::Held, of_reversals.collect())).chain(loops).collect()
    }

    /// With a part the other way round at some joints, if there is another way at any.
    fn turned_over(&self, part: Part, joints: &BTreeSet<usize>) -> Option<Self> {
        let mut other = Self { joints: Joints::AtRest, rolled: Arc::default(), ..self.clone() };
        for &joint in joints {
            let Some(value) = other.anchored.value_mut(&part.key(&self.anchored, joint)) else { continue };
            let before = *value;
            // What is the other way round already goes back.
            if let Some(known) = other.turned.iter().position(|turned| (turned.joint, turned.part) == (joint, part)) {
                *value = other.turned.swap_remove(known).before;
            } else if let Some(after) = part.other(before) {
                *value = after;
                other.turned.push(Turned { joint, part, before, after, left: 1.0 });
            }
        }
        (other.turned != self.turned).then_some(other)
    }

    /// Goes over to another problem and what is most probable there, if that is clearly the likelier.
    fn take_likelier(&mut self, z: &mut DVector<f64>, other: Option<Self>) -> Result<bool> {
        let Some(mut other) = other else { return Ok(false) };
        let mut at_other = z.clone();
        other.refine(&mut at_other)?;
        let chance = 1.0 / (1.0 + (self.likelihood(z)? - other.likelihood(&at_other)?).exp());
        let left = 2.0 * (chance * (1.0 - chance)).sqrt();
        let is_likelier = chance > 0.5 && left <= IDENTIFIED_BELOW;
        if is_likelier {
            other.turned.iter_mut().filter(|turned| !self.turned.contains(turned)).for_each(|turned| turned.left = left);
            (*self, *z) = (other, at_other);
        }
        Ok(is_likelier)
    }

    /// What was found to be the other way round.
    #[must_use]
    pub fn turned(&self) -> &[Turned] {
        &self.turned
    }
}
