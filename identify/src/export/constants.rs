//! The controller's constants as the robot file has them.

use raven::robot::{ArmSide, KinematicsKind, Robot};
use raven::{Error, Result};

/// Where each pair of joints stands in the list of couplings: `C01, C02, C12`.
pub const COUPLINGS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Constants of the first three joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Constants {
    /// Arm.
    pub arm: ArmSide,
    /// Names of the joints.
    pub joints: [String; 3],
    /// Motor angle per joint motion [rad/rad, rad/rad, rad/m].
    pub ratio: [f64; 3],
    /// Radius at the link [m, m, 1].
    pub link_radius: [f64; 3],
    /// Joint position at the hard stop [rad, rad, m].
    pub hard_stop: [f64; 3],
    /// Extra cable travel in the order of [`COUPLINGS`] [rad/rad, m/rad, m/rad].
    pub coupling: [f64; 3],
}

impl Constants {
    /// Of a robot file.
    ///
    /// # Errors
    /// If the robot is no Raven arm.
    pub fn new(robot: &Robot) -> Result<Self> {
        let arm = robot.arm()?;
        let (KinematicsKind::Raven(kinematics), [first, second, third, ..]) = (&robot.kinematics, robot.joints.as_slice()) else {
            return Err(Error::Data(format!("robot `{}` is no Raven arm: its controller has no such constants.", robot.name)));
        };
        let joints = [first, second, third];
        let coupling = robot.cable_coupling_matrix()?;
        Ok(Self {
            arm: kinematics.arm,
            joints: joints.map(|j| j.name.clone()),
            ratio: arm.transmission.ratio.into(),
            link_radius: joints.map(|j| j.link_pulley_radius),
            hard_stop: arm.hard_stop.into(),
            coupling: COUPLINGS.map(|(from, to)| coupling[(to, from)]),
        })
    }

    /// Where the robot file has what these are made of: radii, hard stops and couplings.
    #[must_use]
    pub fn keys(&self) -> [String; 9] {
        let of_joint = |j: usize, key: &str| format!("joints.{}.{key}", self.joints[j]);
        std::array::from_fn(|i| match i {
            0..3 => of_joint(i, "link_pulley_radius"),
            3..6 => of_joint(i - 3, "hard_stop"),
            _ => self.coupling_key(i - 6),
        })
    }

    /// Where the robot file has the coupling that is number `c` of [`COUPLINGS`].
    #[must_use]
    pub fn coupling_key(&self, c: usize) -> String {
        let (from, to) = COUPLINGS[c];
        format!("cable_coupling.{}.{}", self.joints[from], self.joints[to])
    }
}
