//! The robot as its parameter file describes it: kinematics, transmission, cables, links, and how well each number is known.

mod cable;
mod check;
mod dynamics;
mod file;
mod friction;
mod grip;
mod hysteresis;
mod keys;
mod kinematics;
mod link_model;
mod listed;
pub mod nominal;
mod rollout;
pub mod stiction;
mod transmission;
mod write;

pub use cable::Cable;
pub use check::with_unit;
pub use dynamics::{Link, LinkDynamics};
pub use file::{
    Coupling, Encoder, Joint, JointType, KinematicsKind, Motor, Observation, POSE_COVARIANCE, Provenance, Robot, Source, SourceFormat,
    Tolerances, ViscousCoulomb,
};
pub use friction::DryFriction;
pub use hysteresis::{Hysteresis, behind_hysteresis};
pub use keys::Change;
pub use kinematics::{ArmSide, Branch, Kinematics};
pub use link_model::{LinkModel, LinkState, STICTION_SPEED, stiction_speed};
pub use listed::{Cables, ListedEffect, MotorLaw, MotorLaws, TensionLaw, wound, wound_by};
pub use rollout::{HALF_WINDOW_S, MotorTrack, PAUSE_MAX_S, SteadyMotion};
pub use transmission::Transmission;

use crate::{Error, Result};

/// The first three joints of a Raven-II arm, ready to compute with.
#[derive(Debug, Clone)]
pub struct Arm {
    /// Joint angles to tip, and back.
    pub kinematics: Kinematics,
    /// Motor angles to joint angles through inextensible cables.
    pub transmission: Transmission,
    /// One cable per joint.
    pub cables: [Cable; 3],
    /// Motor inertia and friction, on the motor shaft.
    pub motors: [Motor; 3],
    /// Friction at the joint: N m or N, N m s or N s/m.
    pub link_friction: [ViscousCoulomb; 3],
    /// Rigid-body dynamics of the links.
    pub dynamics: LinkDynamics,
    /// Range of each joint, rad or m.
    pub limits: [[f64; 2]; 3],
    /// Hysteresis of each cable.
    pub hysteresis: [Hysteresis; 3],
    /// Joint angles at which the encoders are set, rad, rad, m.
    pub hard_stop: nalgebra::Vector3<f64>,
    /// What the listed effects make of recorded motors.
    pub motor_laws: MotorLaws,
}

impl Arm {
    /// Stiffness of a joint through its cable [N m/rad or N/m] under a tension difference [N].
    #[must_use]
    pub fn joint_stiffness(&self, j: usize, tension_n: f64) -> f64 {
        self.cables[j].tangent_stiffness(tension_n) * self.transmission.link_radius_m[j].powi(2)
    }
}

impl Robot {
    /// The arm of a robot of kind `raven`.
    ///
    /// # Errors
    /// If the file describes a bench, or lacks a joint, a cable, a motor or a link, or lists an effect that there is not.
    pub fn arm(&self) -> Result<Arm> {
        let wrong =
            |what: &str| Error::Data(format!("robot `{}`: {what}, but a Raven arm needs it; compare the nominal robot file.", self.name));
        let KinematicsKind::Raven(kinematics) = &self.kinematics else {
            return Err(Error::Data(format!("robot `{}` is a bench (kinematics.kind: bench): it has no tip and no arm.", self.name)));
        };
        let joints: &[Joint; 3] =
            self.joints.as_slice().try_into().map_err(|_| wrong(&format!("{} joints are given, not 3", self.joints.len())))?;
        let links: [Link; 3] =
            self.links.as_slice().try_into().map_err(|_| wrong(&format!("{} links are given, not 3", self.links.len())))?;
        let lacks = |joint: &Joint, key: &str| wrong(&format!("joints.{}.{key} is missing", joint.name));
        let mut cables = [Cable::new(1.0, 0.0); 3];
        let mut motors = [Motor::default(); 3];
        let mut link_friction = [ViscousCoulomb::default(); 3];
        let mut limits = [[0.0; 2]; 3];
        for (j, joint) in joints.iter().enumerate() {
            cables[j] = joint.cable.ok_or_else(|| lacks(joint, "cable"))?;
            motors[j] = joint.motor.ok_or_else(|| lacks(joint, "motor"))?;
            link_friction[j] = joint.link_friction.ok_or_else(|| lacks(joint, "link_friction"))?;
            limits[j] = joint.limits.ok_or_else(|| lacks(joint, "limits"))?;
        }
        Ok(Arm {
            kinematics: *kinematics,
            transmission: Transmission::new(joints, &self.cable_coupling_matrix()?),
            cables,
            motors,
            link_friction,
            dynamics: LinkDynamics::new(*kinematics, links, kinematics.gravity()).with_payload(self.payload),
            limits,
            hysteresis: std::array::from_fn(|j| joints[j].hysteresis),
            hard_stop: nalgebra::Vector3::from_fn(|j, _| joints[j].hard_stop),
            motor_laws: crate::effects::motor_laws(self)?,
        })
    }

    /// The rigid transmission of a bench, its missing joints filled up with copies of the first.
    ///
    /// # Errors
    /// If the file has no joints, or more than three.
    pub fn bench_transmission(&self) -> Result<Transmission> {
        let count = self.joints.len();
        let [Some(first), None] = [self.joints.first(), self.joints.get(3)] else {
            return Err(Error::Data(format!("robot `{}` has {count} joints; a bench has one to three.", self.name)));
        };
        let joints = std::array::from_fn(|j| self.joints.get(j).unwrap_or(first).clone());
        Ok(Transmission::new(&joints, &nalgebra::Matrix3::zeros()))
    }

    /// The coupling as a matrix: cable travel, at the joint, is `(1 + C) q`; row is the cable, column the joint that moves it.
    ///
    /// # Errors
    /// If a coupling names a joint that is not there, or itself.
    pub fn cable_coupling_matrix(&self) -> Result<nalgebra::Matrix3<f64>> {
        let index = |name: &str| {
            self.joints.iter().take(3).position(|j| j.name == name).ok_or_else(|| {
                Error::Data(format!("robot `{}`: cable_coupling names the joint `{name}`, which is not in joints.", self.name))
            })
        };
        let mut matrix = nalgebra::Matrix3::zeros();
        for coupling in &self.cable_coupling {
            let (from, to) = (index(&coupling.from)?, index(&coupling.to)?);
            if from == to {
                return Err(Error::Data(format!("robot `{}`: cable_coupling couples `{}` to itself.", self.name, coupling.from)));
            }
            matrix[(to, from)] += coupling.coefficient;
        }
        Ok(matrix)
    }

    /// The position of a joint in the file.
    ///
    /// # Errors
    /// If no joint has this name; the message lists those there are.
    pub fn joint_index(&self, name: &str) -> Result<usize> {
        self.joints.iter().position(|j| j.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.joints.iter().map(|j| j.name.as_str()).collect();
            Error::Argument(format!("robot `{}` has no joint `{name}`; it has {}.", self.name, names.join(", ")))
        })
    }
}

#[cfg(test)]
mod tests;
