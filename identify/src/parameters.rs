//! The quantities that can be estimated: the names users write, where they stand in the robot file, units, and scale.
//!
//! Radii, stiffness, damping and friction are positive and known to a factor, so they are estimated as logarithms; the rest as they are.

use raven::robot::{JointType, Robot};
use raven::{Error, Result};

/// One number of the robot file that can be estimated. Joints and axes count from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// `r_l1`: radius of the link's pulley [m]; the travel ratio of a prismatic joint [1]. The same as an inverse capstan radius.
    PulleyRadius(usize),
    /// `offset_1`: joint position at the hard stop [rad or m].
    HardStop(usize),
    /// `coupling_12`: cable travel of the second joint by motion of the first [rad/rad or m/rad].
    Coupling(usize, usize),
    /// `k_e1`: stiffness of the cable [N].
    Stiffness(usize),
    /// `b_e1`: damping of the cable [N s/m].
    Damping(usize),
    /// `F_c1`: Coulomb friction of the joint [N m or N].
    Coulomb(usize),
    /// `hysteresis_1`: half the loop of the cable's hysteresis, at the joint [rad or m].
    Hysteresis(usize),
    /// `rounding_1`: travel over which that loop turns after a reversal [rad or m].
    Rounding(usize),
    /// `straight_part_1`: how far it turns straight, as a play does, before it rounds off [1].
    StraightPart(usize),
    /// `latency`: by how much an image shows the past of its stamp [s].
    Latency,
    /// `rotation_x`: what the registration's rotation lacks, about an axis of frame 0 [rad].
    Rotation(usize),
    /// `translation_x`: what the registration's translation lacks [m].
    Translation(usize),
}

/// Every quantity, in the order in which results list them.
pub const ALL: [Quantity; 34] = {
    use Quantity::{
        Coulomb, Coupling, Damping, HardStop, Hysteresis, Latency, PulleyRadius, Rotation, Rounding, Stiffness, StraightPart, Translation,
    };
    [
        PulleyRadius(0),
        PulleyRadius(1),
        PulleyRadius(2),
        HardStop(0),
        HardStop(1),
        HardStop(2),
        Coupling(0, 1),
        Coupling(0, 2),
        Coupling(1, 2),
        Stiffness(0),
        Stiffness(1),
        Stiffness(2),
        Damping(0),
        Damping(1),
        Damping(2),
        Coulomb(0),
        Coulomb(1),
        Coulomb(2),
        Hysteresis(0),
        Hysteresis(1),
        Hysteresis(2),
        Rounding(0),
        Rounding(1),
        Rounding(2),
        StraightPart(0),
        StraightPart(1),
        StraightPart(2),
        Latency,
        Rotation(0),
        Rotation(1),
        Rotation(2),
        Translation(0),
        Translation(1),
        Translation(2),
    ]
};

const AXES: [&str; 3] = ["x", "y", "z"];

impl Quantity {
    /// The name users write.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::PulleyRadius(j) => format!("r_l{}", j + 1),
            Self::HardStop(j) => format!("offset_{}", j + 1),
            Self::Coupling(from, to) => format!("coupling_{}{}", from + 1, to + 1),
            Self::Stiffness(j) => format!("k_e{}", j + 1),
            Self::Damping(j) => format!("b_e{}", j + 1),
            Self::Coulomb(j) => format!("F_c{}", j + 1),
            Self::Hysteresis(j) => format!("hysteresis_{}", j + 1),
            Self::Rounding(j) => format!("rounding_{}", j + 1),
            Self::StraightPart(j) => format!("straight_part_{}", j + 1),
            Self::Latency => "latency".to_owned(),
            Self::Rotation(axis) => format!("rotation_{}", AXES[axis]),
            Self::Translation(axis) => format!("translation_{}", AXES[axis]),
        }
    }

    /// The shorthand that selects this quantity and its kin.
    fn group(self) -> &'static str {
        match self {
            Self::PulleyRadius(_) => "r_l",
            Self::HardStop(_) => "offset",
            Self::Coupling(..) => "coupling",
            Self::Stiffness(_) => "k_e",
            Self::Damping(_) => "b_e",
            Self::Coulomb(_) => "F_c",
            Self::Hysteresis(_) | Self::Rounding(_) | Self::StraightPart(_) => "hysteresis",
            Self::Latency => "latency",
            Self::Rotation(_) | Self::Translation(_) => "registration",
        }
    }

    /// Whether it belongs to the registration of the cameras.
    #[must_use]
    pub fn is_registration(self) -> bool {
        self.group() == "registration"
    }

    /// Whether it belongs to a cable's loop of hysteresis.
    #[must_use]
    pub fn is_of_loop(self) -> bool {
        self.group() == "hysteresis"
    }

    /// Whether it may go back to its prior where the logs do not determine it. Corrections of the registration may not, or the robot would have to
    /// make up for a turned camera, nor may the way a loop turns, on which it depends what the loop's other numbers mean.
    #[must_use]
    pub fn may_hold(self) -> bool {
        !self.is_registration() && !matches!(self, Self::StraightPart(_))
    }

    /// Whether the robot's controller has it: radii, hard stops and couplings.
    #[must_use]
    pub fn is_of_controller(self) -> bool {
        matches!(self, Self::PulleyRadius(_) | Self::HardStop(_) | Self::Coupling(..))
    }

    /// Where it stands in the robot file.
    #[must_use]
    pub fn key(self, robot: &Robot) -> String {
        let joint = |j: usize| robot.joints.get(j).map_or("", |joint| joint.name.as_str());
        match self {
            Self::PulleyRadius(j) => format!("joints.{}.link_pulley_radius", joint(j)),
            Self::HardStop(j) => format!("joints.{}.hard_stop", joint(j)),
            Self::Coupling(from, to) => format!("cable_coupling.{}.{}", joint(from), joint(to)),
            Self::Stiffness(j) => format!("joints.{}.cable.stiffness", joint(j)),
            Self::Damping(j) => format!("joints.{}.cable.damping", joint(j)),
            Self::Coulomb(j) => format!("joints.{}.link_friction.coulomb", joint(j)),
            Self::Hysteresis(j) => format!("joints.{}.hysteresis.half_loop", joint(j)),
            Self::Rounding(j) => format!("joints.{}.hysteresis.length", joint(j)),
            Self::StraightPart(j) => format!("joints.{}.hysteresis.straight_part", joint(j)),
            Self::Latency => "observation.latency".to_owned(),
            Self::Rotation(axis) => format!("observation.rotation.{axis}"),
            Self::Translation(axis) => format!("observation.translation.{axis}"),
        }
    }

    /// The joint it belongs to, `shoulder->elbow` for a coupling, nothing for the cameras.
    #[must_use]
    pub fn joint(self, robot: &Robot) -> Option<String> {
        let name = |j: usize| robot.joints.get(j).map(|joint| joint.name.clone());
        match self {
            Self::PulleyRadius(j)
            | Self::HardStop(j)
            | Self::Stiffness(j)
            | Self::Damping(j)
            | Self::Coulomb(j)
            | Self::Hysteresis(j)
            | Self::Rounding(j)
            | Self::StraightPart(j) => name(j),
            Self::Coupling(from, to) => Some(format!("{}->{}", name(from)?, name(to)?)),
            Self::Latency | Self::Rotation(_) | Self::Translation(_) => None,
        }
    }

    /// The SI unit in which the file has it.
    #[must_use]
    pub fn unit(self, robot: &Robot) -> &'static str {
        let prismatic = |j: usize| robot.joints.get(j).is_some_and(|joint| joint.kind == JointType::Prismatic);
        match self {
            Self::PulleyRadius(j) => {
                if prismatic(j) {
                    "1"
                } else {
                    "m"
                }
            }
            Self::HardStop(j) | Self::Hysteresis(j) | Self::Rounding(j) => {
                if prismatic(j) {
                    "m"
                } else {
                    "rad"
                }
            }
            Self::Coupling(_, to) => {
                if prismatic(to) {
                    "m/rad"
                } else {
                    "rad/rad"
                }
            }
            Self::StraightPart(_) => "1",
            Self::Stiffness(_) => "N",
            Self::Damping(_) => "N s/m",
            Self::Coulomb(j) => {
                if prismatic(j) {
                    "N"
                } else {
                    "N m"
                }
            }
            Self::Latency => "s",
            Self::Rotation(_) => "rad",
            Self::Translation(_) => "m",
        }
    }

    /// The unit in which people read it, and how many of it make one SI unit.
    #[must_use]
    pub fn shown(self, robot: &Robot) -> (&'static str, f64) {
        match self.unit(robot) {
            "m" => ("mm", 1e3),
            "rad" => ("deg", 180.0 / std::f64::consts::PI),
            "m/rad" => ("mm/rad", 1e3),
            "s" => ("ms", 1e3),
            unit => (unit, 1.0),
        }
    }

    /// Whether it is positive and estimated as its logarithm.
    #[must_use]
    pub fn is_positive(self) -> bool {
        matches!(self, Self::PulleyRadius(_) | Self::Stiffness(_) | Self::Damping(_) | Self::Coulomb(_) | Self::Rounding(_))
    }

    /// Whether the way the links swing about their rest depends on it to first order.
    #[must_use]
    pub fn is_of_links(self) -> bool {
        matches!(self, Self::Stiffness(_) | Self::Damping(_) | Self::Coulomb(_))
    }

    /// Whether it does, or is shifted in time.
    #[must_use]
    pub fn is_dynamic(self) -> bool {
        self.is_of_links() || self == Self::Latency
    }
}

/// What a user asked to be estimated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selection {
    /// The quantities, in the order of [`ALL`].
    pub quantities: Vec<Quantity>,
    /// Whether the user named them: a named hard stop is looked for, an unnamed one estimated along within its tolerance.
    pub named: bool,
}

impl Default for Selection {
    /// The first pulley, the hard stops and the latency.
    fn default() -> Self {
        let default = |q: &Quantity| matches!(q, Quantity::PulleyRadius(0) | Quantity::HardStop(_) | Quantity::Latency);
        Self { quantities: ALL.into_iter().filter(default).collect(), named: false }
    }
}

impl Selection {
    /// From names and shorthands (`r_l`, `offset`, `coupling`, `k_e`, `b_e`, `F_c`, `hysteresis`, `registration`, `all`).
    ///
    /// # Errors
    /// If a name is unknown; the message lists those there are.
    pub fn named(names: &[String]) -> Result<Self> {
        // A space after the comma is none of the name.
        let names: Vec<&str> = names.iter().map(|name| name.trim()).collect();
        for name in &names {
            if *name != "all" && !ALL.iter().any(|q| q.name() == *name || q.group() == *name) {
                let known: Vec<String> = ALL.iter().map(|q| q.name()).collect();
                return Err(Error::Argument(format!(
                    "--parameters has `{name}`; known are {}, the groups r_l, offset, coupling, k_e, b_e, F_c, hysteresis, registration, and all.",
                    known.join(", ")
                )));
            }
        }
        let wanted = |q: &Quantity| names.iter().any(|name| *name == "all" || *name == q.name() || *name == q.group());
        Ok(Self { quantities: ALL.into_iter().filter(wanted).collect(), named: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raven::robot::nominal;

    #[test]
    fn every_key_stands_in_the_nominal_file() {
        let mut robot = nominal::gold();
        for quantity in ALL {
            let key = quantity.key(&robot);
            assert!(robot.value_mut(&key).is_some(), "{} is not at {key}", quantity.name());
        }
    }

    #[test]
    fn names_and_groups_select() {
        let names = |list: &[&str]| {
            let list: Vec<String> = list.iter().map(|s| (*s).to_owned()).collect();
            Selection::named(&list).map(|s| s.quantities.iter().map(|q| q.name()).collect::<Vec<_>>().join(" "))
        };
        assert_eq!(names(&["k_e2", "r_l"]).unwrap(), "r_l1 r_l2 r_l3 k_e2");
        assert_eq!(names(&["r_l1", " latency"]).unwrap(), "r_l1 latency");
        assert_eq!(names(&["registration", "coupling_12"]).unwrap().split(' ').count(), 7);
        assert_eq!(names(&["all"]).unwrap().split(' ').count(), ALL.len());
        let error = names(&["r_l4"]).unwrap_err().to_string();
        assert!(error.contains("`r_l4`") && error.contains("coupling_23"), "{error}");
        assert!(matches!(names(&["r_mc"]), Err(Error::Argument(_))));
    }
}
