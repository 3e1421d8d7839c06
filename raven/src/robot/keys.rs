//! Numbers of the robot file by name: what [`Provenance`](super::Provenance) calls them, and how a change of them is undone.

use super::{JointType, KinematicsKind, Observation, Robot};
use crate::Result;

/// Numbers of a joint, with their units on a revolute and on a prismatic joint.
const OF_JOINT: [(&str, [&str; 2]); 22] = [
    ("gear_ratio", ["1", "1"]),
    ("motor_capstan_radius", ["m", "m"]),
    ("link_pulley_radius", ["m", "1"]),
    ("hard_stop", ["rad", "m"]),
    ("hysteresis.half_loop", ["rad", "m"]),
    ("hysteresis.lag_at_start", ["1", "1"]),
    ("hysteresis.length", ["rad", "m"]),
    ("hysteresis.straight_part", ["1", "1"]),
    ("cable.stiffness", ["N", "N"]),
    ("cable.damping", ["N s/m", "N s/m"]),
    ("cable.exponent_length", ["m", "m"]),
    ("cable.slack", ["m", "m"]),
    ("cable.fresh_part", ["1", "1"]),
    ("motor.inertia", ["kg m^2", "kg m^2"]),
    ("motor.coulomb_friction", ["N m", "N m"]),
    ("motor.viscous_friction", ["N m s", "N m s"]),
    ("link_friction.coulomb", ["N m", "N"]),
    ("link_friction.viscous", ["N m s", "N s/m"]),
    ("link_friction.per_load", ["1", "1"]),
    ("link_friction.stiction_speed", ["rad/s", "m/s"]),
    ("link_friction.held_part", ["1", "1"]),
    ("link_friction.lag_at_start", ["1", "1"]),
];

/// A number that two versions of a robot file do not share.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Its key, such as `joints.shoulder.link_pulley_radius`.
    pub key: String,
    /// Its unit.
    pub unit: &'static str,
    /// In the one; nothing where the file left it to the model.
    pub before: Option<f64>,
    /// In the other.
    pub after: f64,
}

impl Robot {
    /// The numbers in which `new` differs from this file, of those that calibration and effects can change, in the file's order and then in
    /// that of `new`; a coupling that one of them lacks is 0 there. Numbers that `new` leaves to the model are not among them, nor what follows
    /// from others (`motor_at_hard_stop`), nor limits, gravity, centres of mass, encoder counts, tolerances and listed effects.
    #[must_use]
    pub fn changes_to(&self, new: &Self) -> Vec<Change> {
        let mut keys = self.keys();
        for key in new.keys() {
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        let (mut old, mut new) = (self.clone(), new.clone());
        let number = |robot: &mut Self, key: &str| robot.value_mut(key).copied().or(key.starts_with("cable_coupling.").then_some(0.0));
        let change = |(key, unit): (String, &'static str)| {
            let (before, after) = (number(&mut old, &key), number(&mut new, &key)?);
            (before != Some(after)).then_some(Change { key, unit, before, after })
        };
        keys.into_iter().filter_map(change).collect()
    }

    /// Keys and units of the numbers that calibration and effects can change.
    fn keys(&self) -> Vec<(String, &'static str)> {
        let mut keys: Vec<(String, &str)> = [("wrist_offset", "m"), ("link_angle_12", "rad"), ("link_angle_23", "rad")]
            .map(|(key, unit)| (format!("kinematics.{key}"), unit))
            .into();
        for joint in &self.joints {
            let of_kind = usize::from(joint.kind == JointType::Prismatic);
            keys.extend(OF_JOINT.iter().map(|(key, units)| (format!("joints.{}.{key}", joint.name), units[of_kind])));
        }
        for coupling in &self.cable_coupling {
            let prismatic = self.joints.iter().any(|joint| joint.name == coupling.to && joint.kind == JointType::Prismatic);
            let unit = if prismatic { "m/rad" } else { "rad/rad" };
            keys.push((format!("cable_coupling.{}.{}", coupling.from, coupling.to), unit));
        }
        for i in 0..self.links.len() {
            keys.push((format!("links.{i}.mass"), "kg"));
            keys.extend((0..6).map(|k| (format!("links.{i}.inertia.{k}"), "kg m^2")));
        }
        keys.push(("payload".to_owned(), "kg"));
        keys.push(("observation.latency".to_owned(), "s"));
        keys.extend((0..3).map(|axis| (format!("observation.rotation.{axis}"), "rad")));
        keys.extend((0..3).map(|axis| (format!("observation.translation.{axis}"), "m")));
        keys
    }

    /// The number at a key as [`Provenance`](super::Provenance) writes it, such as `joints.shoulder.link_pulley_radius` or
    /// `cable_coupling.shoulder.elbow`.
    pub fn value_mut(&mut self, key: &str) -> Option<&mut f64> {
        let parts: Vec<&str> = key.split('.').collect();
        match parts.as_slice() {
            ["joints", name, rest @ ..] => {
                let joint = self.joints.iter_mut().find(|j| j.name == *name)?;
                match rest {
                    ["gear_ratio"] => Some(&mut joint.gear_ratio),
                    ["motor_capstan_radius"] => Some(&mut joint.motor_capstan_radius),
                    ["link_pulley_radius"] => Some(&mut joint.link_pulley_radius),
                    ["hard_stop"] => Some(&mut joint.hard_stop),
                    ["hysteresis", "lag_at_start"] => Some(&mut joint.hysteresis.lag_at_start),
                    ["hysteresis", "half_loop"] => Some(&mut joint.hysteresis.half_loop),
                    ["hysteresis", "straight_part"] => Some(&mut joint.hysteresis.straight_part),
                    ["hysteresis", "length"] => Some(&mut joint.hysteresis.length),
                    ["cable", "stiffness"] => joint.cable.as_mut().map(|c| &mut c.stiffness),
                    ["cable", "damping"] => joint.cable.as_mut().map(|c| &mut c.damping),
                    ["cable", "exponent_length"] => joint.cable.as_mut().map(|c| &mut c.exponent_length),
                    ["cable", "slack"] => joint.cable.as_mut().map(|c| &mut c.slack),
                    ["cable", "fresh_part"] => joint.cable.as_mut().map(|c| &mut c.fresh_part),
                    ["motor", "inertia"] => joint.motor.as_mut().map(|m| &mut m.inertia),
                    ["motor", "coulomb_friction"] => joint.motor.as_mut().map(|m| &mut m.coulomb_friction),
                    ["motor", "viscous_friction"] => joint.motor.as_mut().map(|m| &mut m.viscous_friction),
                    ["link_friction", "coulomb"] => joint.link_friction.as_mut().map(|f| &mut f.coulomb),
                    ["link_friction", "viscous"] => joint.link_friction.as_mut().map(|f| &mut f.viscous),
                    ["link_friction", "per_load"] => joint.link_friction.as_mut().map(|f| &mut f.per_load),
                    ["link_friction", "held_part"] => joint.link_friction.as_mut().map(|f| &mut f.held_part),
                    ["link_friction", "lag_at_start"] => joint.link_friction.as_mut().map(|f| &mut f.lag_at_start),
                    ["link_friction", "stiction_speed"] => joint.link_friction.as_mut().and_then(|f| f.stiction_speed.as_mut()),
                    _ => None,
                }
            }
            ["kinematics", key] => {
                let KinematicsKind::Raven(kinematics) = &mut self.kinematics else { return None };
                match *key {
                    "wrist_offset" => Some(&mut kinematics.wrist_offset),
                    "link_angle_12" => Some(&mut kinematics.link_angle_12),
                    "link_angle_23" => Some(&mut kinematics.link_angle_23),
                    _ => None,
                }
            }
            ["cable_coupling", from, to] => {
                self.cable_coupling.iter_mut().find(|c| c.from == *from && c.to == *to).map(|c| &mut c.coefficient)
            }
            ["links", link, rest @ ..] => {
                let link = self.links.get_mut(link.parse::<usize>().ok()?)?;
                match rest {
                    ["mass"] => Some(&mut link.mass),
                    ["inertia", k] => link.inertia.get_mut(k.parse::<usize>().ok()?),
                    _ => None,
                }
            }
            ["payload"] => Some(&mut self.payload),
            ["observation", "latency"] => Some(&mut self.observation.latency),
            ["observation", "rotation", axis] => self.observation.rotation.get_mut(axis.parse::<usize>().ok()?),
            ["observation", "translation", axis] => self.observation.translation.get_mut(axis.parse::<usize>().ok()?),
            _ => None,
        }
    }

    /// The robot as it was before anything was identified: what its controller believed when the logs were recorded. Numbers in `calibration`
    /// get their priors, and observation, listed effects and `motor_at_hard_stop` are cleared. A number that the file had left to the model has
    /// no prior there and stays, and a coupling that it lacked stays as one of 0.
    #[must_use]
    pub fn before_calibration(&self) -> Self {
        let mut robot = self.clone();
        for change in std::mem::take(&mut robot.calibration) {
            if let Some(value) = robot.value_mut(&change.key) {
                *value = change.prior;
            }
        }
        for joint in &mut robot.joints {
            joint.motor_at_hard_stop = None;
        }
        robot.observation = Observation::default();
        robot.effects.clear();
        robot
    }

    /// Keeps the motor angles at which the encoders were set by the file `before`, wherever this file's numbers would make others of the
    /// hard stop: the same logs then read the same.
    ///
    /// # Errors
    /// If either is no arm.
    pub fn keep_encoders_of(&mut self, before: &Self) -> Result<()> {
        let (was, is) = (before.arm()?.transmission.motor_at_hard_stop, self.arm()?.transmission.motor_at_hard_stop);
        for (j, joint) in self.joints.iter_mut().enumerate().take(3) {
            if was[j] != is[j] {
                joint.motor_at_hard_stop = Some(was[j]);
            }
        }
        Ok(())
    }
}
