//! What no robot has: the numbers of its file held against hardware, each refused with what may be meant.

use nalgebra::Matrix6;

use super::{Coupling, Joint, JointType, KinematicsKind, Observation, Provenance, Robot};

impl Robot {
    /// The first number that no hardware has, in a sentence.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.format != "raven-robot/1" {
            return Err(format!("format is `{}`, expected `raven-robot/1`.", self.format));
        }
        if self.joints.is_empty() {
            return Err("joints is empty; name at least one.".to_owned());
        }
        let arm = matches!(self.kinematics, KinematicsKind::Raven(_));
        if arm {
            self.check_kinds()?;
        }
        for (j, joint) in self.joints.iter().enumerate() {
            check_name(j, &joint.name)?;
            if self.joints[..j].iter().any(|other| other.name == joint.name) {
                return Err(format!("joints has the name `{}` twice; every key goes by it, so give each joint its own.", joint.name));
            }
            check_joint(joint, arm)?;
        }
        for Coupling { from, to, coefficient } in &self.cable_coupling {
            within(&format!("cable_coupling.{from}.{to}"), *coefficient, [-10.0, 10.0], "rad/rad or m/rad", "millimetres")?;
        }
        if let Some(encoder) = self.encoder {
            within("encoder.counts_per_revolution", encoder.counts_per_revolution, [1.0, 1e9], "counts", "another unit")?;
        }
        for (key, value, unit) in self.tolerances.numbers() {
            within(&format!("tolerances.{key}"), value, [1e-9, 10.0], unit, "percent or another unit")?;
        }
        self.observation.check()?;
        if let KinematicsKind::Raven(kinematics) = &self.kinematics {
            for (key, angle) in [("link_angle_12", kinematics.link_angle_12), ("link_angle_23", kinematics.link_angle_23)] {
                within(&format!("kinematics.{key}"), angle, [0.05, 3.1], "rad", "degrees")?;
            }
            within("kinematics.wrist_offset", kinematics.wrist_offset, [-2.0, 2.0], "m", "millimetres")?;
            let gravity = kinematics.gravity().norm();
            within("the length of kinematics.gravity", gravity, [0.0, 20.0], "m/s^2", "cm/s^2")?;
            let coupling = self.cable_coupling_matrix().map_err(|e| e.to_string())?;
            if (nalgebra::Matrix3::identity() + coupling).determinant().abs() < 0.1 {
                return Err("cable_coupling ties two joints together; its coefficients are too large.".to_owned());
            }
        }
        within("payload", self.payload, [0.0, 100.0], "kg", "grams")?;
        for (i, link) in self.links.iter().enumerate() {
            within(&format!("links[{i}].mass"), link.mass, [1e-6, 100.0], "kg", "grams")?;
            for center in link.center_of_mass {
                within(&format!("links[{i}].center_of_mass"), center, [-10.0, 10.0], "m", "millimetres")?;
            }
            if !link.inertia.iter().all(|v| v.is_finite()) || link.inertia_matrix().cholesky().is_none() {
                let inertia = link.inertia;
                return Err(format!(
                    "links[{i}].inertia is {inertia:?}, which no body has; expected a positive definite [xx, yy, zz, xy, xz, yz] about the \
                     centre of mass."
                ));
            }
        }
        self.check_calibration()?;
        crate::effects::check_listed(self)
    }

    /// The closed form of an arm's kinematics has two angles and a length.
    fn check_kinds(&self) -> Result<(), String> {
        const ARM: [JointType; 3] = [JointType::Revolute, JointType::Revolute, JointType::Prismatic];
        let expected =
            "kinematics.kind is raven, an arm of two revolute joints and then a prismatic one. Correct it, or write kind: bench.";
        if self.joints.len() != ARM.len() {
            return Err(format!("joints has {} entries, expected {}: {expected}", self.joints.len(), ARM.len()));
        }
        let name = |kind: JointType| if kind == JointType::Revolute { "revolute" } else { "prismatic" };
        match self.joints.iter().zip(ARM).find(|(joint, kind)| joint.kind != *kind) {
            Some((joint, kind)) => Err(format!("joints.{}.type is {}, expected {}: {expected}", joint.name, name(joint.kind), name(kind))),
            None => Ok(()),
        }
    }

    /// Holds `calibration` against the numbers it is about: each is there, and was one that hardware can have before.
    fn check_calibration(&self) -> Result<(), String> {
        if self.calibration.is_empty() {
            return Ok(());
        }
        let mut robot = self.clone();
        for Provenance { key, value, prior, .. } in &self.calibration {
            if robot.value_mut(key).is_none() {
                return Err(format!(
                    "calibration has {key}, a number that the file does not have; correct the key, or take the entry out."
                ));
            }
            if let Some((field, number)) = [("value", value), ("prior", prior)].iter().find(|(_, number)| !number.is_finite()) {
                return Err(format!("calibration of {key}: {field} is {number}, expected a number; restore what was there before."));
            }
        }
        self.before_calibration().check().map_err(|sentence| format!("as it was before its calibration, by prior: {sentence}"))
    }
}

impl Observation {
    fn check(&self) -> Result<(), String> {
        within("observation.latency", self.latency, [-10.0, 10.0], "s", "milliseconds")?;
        for angle in self.rotation {
            within("observation.rotation", angle, [-4.0, 4.0], "rad", "degrees")?;
        }
        for distance in self.translation {
            within("observation.translation", distance, [-10.0, 10.0], "m", "millimetres")?;
        }
        match self.pose_covariance() {
            Some(covariance) if !is_covariance(&covariance) => {
                Err("observation.covariance is that of no pose; take it out, or identify the robot again.".to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// Whether this may be the covariance of something, however its digits were rounded.
fn is_covariance(matrix: &Matrix6<f64>) -> bool {
    const ROUNDING: f64 = 1e-6;
    let std = matrix.diagonal().map(f64::sqrt);
    let correlation = Matrix6::from_fn(|i, j| if i == j { 1.0 + ROUNDING } else { matrix[(i, j)] / (std[i] * std[j]) });
    std.iter().all(|std| *std > 0.0 && std.is_finite()) && correlation.cholesky().is_some()
}

/// Keys part names by `.`, effects on command lines by `:`, `->` and `=`.
fn check_name(j: usize, name: &str) -> Result<(), String> {
    if name.is_empty() {
        return Err(format!("joints[{j}].name is empty; every key goes by it, so name the joint."));
    }
    match [".", ":", "->", "="].into_iter().find(|sign| name.contains(sign)) {
        Some(sign) => Err(format!("joints has the name `{name}`, and `{sign}` parts the keys that go by it; write `_` instead.")),
        None => Ok(()),
    }
}

fn check_joint(joint: &Joint, arm: bool) -> Result<(), String> {
    let key = |field: &str| format!("joints.{}.{field}", joint.name);
    within(&key("gear_ratio"), joint.gear_ratio, [1e-3, 1e4], "1", "the inverse ratio")?;
    let radius_max = if arm { 0.5 } else { 1.0 };
    within(&key("motor_capstan_radius"), joint.motor_capstan_radius, [1e-4, radius_max], "m", "millimetres")?;
    // A prismatic joint has 1 by definition, and what identification makes of it.
    let link_max = if arm && joint.kind == JointType::Revolute { 0.5 } else { 1.5 };
    within(&key("link_pulley_radius"), joint.link_pulley_radius, [1e-4, link_max], "m", "millimetres")?;
    let (position_max, unit, meant) = match joint.kind {
        JointType::Revolute => (2.0 * std::f64::consts::PI, "rad", "degrees"),
        JointType::Prismatic => (2.0, "m", "millimetres"),
    };
    within(&key("hard_stop"), joint.hard_stop, [-position_max, position_max], unit, meant)?;
    if let Some(angle) = joint.motor_at_hard_stop {
        within(&key("motor_at_hard_stop"), angle, [-1e9, 1e9], "rad", "another unit")?;
    }
    if let Some(limits) = joint.limits {
        for limit in limits {
            within(&key("limits"), limit, [-position_max, position_max], unit, meant)?;
        }
        if limits[0] >= limits[1] {
            return Err(format!("{} is [{}, {}]; the first must be the smaller one.", key("limits"), limits[0], limits[1]));
        }
    }
    if let Some(cable) = joint.cable {
        within(&key("cable.stiffness"), cable.stiffness, [1.0, 1e9], "N", "another unit")?;
        within(&key("cable.damping"), cable.damping, [0.0, 1e7], "N s/m", "another unit")?;
        within(&key("cable.exponent_length"), cable.exponent_length, [1e-6, 10.0], "m", "millimetres")?;
        within(&key("cable.slack"), cable.slack, [0.0, 0.1], "m", "millimetres")?;
        within(&key("cable.fresh_part"), cable.fresh_part, [-30.0, 30.0], "1", "percent")?;
    }
    within(&key("hysteresis.half_loop"), joint.hysteresis.half_loop, [-0.2, 0.2], unit, meant)?;
    within(&key("hysteresis.length"), joint.hysteresis.length, [1e-5, 1.0], unit, meant)?;
    within(&key("hysteresis.straight_part"), joint.hysteresis.straight_part, [-1.0, 1.0], "1", "percent")?;
    within(&key("hysteresis.lag_at_start"), joint.hysteresis.lag_at_start, [-1.0, 1.0], "1", "percent")?;
    if let Some(motor) = joint.motor {
        within(&key("motor.inertia"), motor.inertia, [1e-9, 1e4], "kg m^2", "g cm^2")?;
        within(&key("motor.coulomb_friction"), motor.coulomb_friction, [0.0, 1e4], "N m", "another unit")?;
        within(&key("motor.viscous_friction"), motor.viscous_friction, [0.0, 1e4], "N m s", "another unit")?;
    }
    if let Some(friction) = joint.link_friction {
        within(&key("link_friction.coulomb"), friction.coulomb, [0.0, 1e4], "N m or N", "another unit")?;
        within(&key("link_friction.viscous"), friction.viscous, [0.0, 1e4], "N m s or N s/m", "another unit")?;
        within(&key("link_friction.per_load"), friction.per_load, [0.0, 2.0], "1", "percent")?;
        within(&key("link_friction.held_part"), friction.held_part, [0.0, 1.0], "1", "percent")?;
        within(&key("link_friction.lag_at_start"), friction.lag_at_start, [-1.0, 1.0], "1", "percent")?;
        if let Some(speed) = friction.stiction_speed {
            within(&key("link_friction.stiction_speed"), speed, [1e-9, 1e6], "rad/s or m/s", "another unit")?;
        }
    }
    Ok(())
}

fn within(key: &str, value: f64, [low, high]: [f64; 2], unit: &str, meant: &str) -> Result<(), String> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(format!("{key} is {value}, expected {}. Is it in {meant}?", with_unit(&format!("{low} to {high}"), unit)))
}

/// Numbers with their unit, where they have one: that of a ratio is `1`.
#[must_use]
pub fn with_unit(numbers: &str, unit: &str) -> String {
    if unit == "1" { numbers.to_owned() } else { format!("{numbers} {unit}") }
}
