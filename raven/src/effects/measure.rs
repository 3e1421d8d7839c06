//! What the sizes of the library are measured in at one place.
//!
//! The library states sizes of forces, speeds and capstans as a Raven has them. A bench may be a thousand times as strong, and its motor may
//! be a slide: what it did in the recordings tells by how much its sizes are larger. What happens in a cable is measured in the load that it
//! bears and in its stretch under it: those of one arm's joints differ by a factor of ten.

use nalgebra::Vector3;

use crate::robot::{JointType, KinematicsKind, Robot};

/// Typical of a Raven's motion: torque on the shaft [N m] and after the gear box [N m], speed of the motor [rad/s].
const SHAFT_NM: f64 = 0.008;
const DRIVE_NM: f64 = 0.1;
const MOTOR_RAD_S: f64 = 20.0;
/// Force [N m or N] and speed [rad/s or m/s] of the joint.
const JOINT_FORCE: f64 = 1.0;
const JOINT_RATE: f64 = 0.3;
/// Radius of its capstans [m].
const CAPSTAN_M: f64 = 5.675e-3;
/// Force of a cable under gravity [N], and stretch under it [m].
const CABLE: Load = Load { force_n: 10.0, stretch_m: 2e-4 };

/// Units of the library that go by the robot, and what they are.
pub const UNITS: [(&str, &str); 13] = [
    ("joint", "rad, or m of a prismatic joint"),
    ("joint/rad", "rad, or m of a prismatic joint, per rad of the other joint"),
    ("joint force", "N m, or N of a prismatic joint"),
    ("joint viscosity", "N m s, or N s/m of a prismatic joint"),
    ("joint compliance", "rad/(N m), or m/N of a prismatic joint"),
    ("shaft torque", "N m on the motor's shaft"),
    ("shaft viscosity", "N m s on the motor's shaft"),
    ("shaft inertia", "kg m^2 on the motor's shaft"),
    ("motor speed", "rad/s of the motor's shaft"),
    ("drive torque", "N m after the gear box"),
    ("capstan length", "m of cable at the capstan"),
    ("cable load", "parts of what the joint's cable bears under gravity [N]"),
    ("cable stretch", "parts of by how much it stretches under that [m]; `1/cable stretch` its inverse"),
];

/// What a cable bears.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Load {
    /// Difference of its two sides [N].
    force_n: f64,
    /// Stretch [m].
    stretch_m: f64,
}

impl Load {
    /// Of the cable of joint `j` under gravity: rms over poses in the middle of the joints' ranges. A Raven's where a file does not say.
    fn of_arm(robot: &Robot, j: usize) -> Self {
        // Listed effects have sizes themselves, and gravity does not depend on them.
        let mut bare = robot.clone();
        bare.effects.clear();
        let Ok(arm) = bare.arm() else { return CABLE };
        let part = |k: usize, axis: usize| if k >> axis & 1 == 1 { 0.75 } else { 0.25 };
        let pose = |k: usize| Vector3::from_fn(|i, _| arm.limits[i][0] + part(k, i) * (arm.limits[i][1] - arm.limits[i][0]));
        let force = |k: usize| arm.transmission.tension_n(&arm.dynamics.gravity(&pose(k)))[j];
        let forces: Vec<f64> = (0..8).map(force).collect();
        crate::stats::rms(&forces).map_or(CABLE, |force_n| Self::of_cable(robot, j, force_n))
    }

    fn of_cable(robot: &Robot, j: usize, force_n: f64) -> Self {
        let stretch_m = robot.joints.get(j).and_then(|joint| joint.cable).map_or(f64::INFINITY, |cable| 0.5 * force_n / cable.stiffness);
        let usable = |value: f64, typical: f64| if value.is_finite() && value > 0.0 { value } else { typical };
        Self { force_n: usable(force_n, CABLE.force_n), stretch_m: usable(stretch_m, CABLE.stretch_m) }
    }
}

/// What sizes are measured in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// Whether joint-side numbers are angles or travels.
    pub joint: JointType,
    /// The same of the motor.
    pub motor: JointType,
    /// How many times a Raven's: torque on the shaft, torque after the gear box, force at the joint.
    forces: [f64; 3],
    /// Speed of the motor, speed of the joint.
    rates: [f64; 2],
    /// Radius of the capstan.
    capstan: f64,
    cable: Load,
}

impl Measure {
    /// Of a Raven.
    #[must_use]
    pub const fn raven(joint: JointType) -> Self {
        Self { joint, motor: JointType::Revolute, forces: [1.0; 3], rates: [1.0; 2], capstan: 1.0, cable: CABLE }
    }

    /// Of joint `j` of a robot whose joint-side numbers are of some kind; a Raven's own sizes hold for all but its cables.
    #[must_use]
    pub fn of_arm(robot: &Robot, j: usize, joint: JointType) -> Self {
        Self { cable: Load::of_arm(robot, j), ..Self::raven(joint) }
    }

    /// Of joint `j` of a robot whose drive delivered `torque_rms` after the gear box [N m, or N of a slide] at `rate_rms` of its motor
    /// [rad/s or m/s]: a Raven's own sizes hold for it whatever it did.
    #[must_use]
    pub fn of(robot: &Robot, j: usize, torque_rms: f64, rate_rms: f64) -> Self {
        let Some(joint) = robot.joints.get(j) else { return Self::raven(JointType::Revolute) };
        if matches!(robot.kinematics, KinematicsKind::Raven(_)) {
            return Self::of_arm(robot, j, joint.kind);
        }
        // Without torque, or without motion, nothing that is measured in it can show.
        let positive = |value: f64| if value > 0.0 { value } else { 1.0 };
        let joint_force = torque_rms * joint.link_pulley_radius / joint.motor_capstan_radius;
        Self {
            joint: joint.kind,
            // A motor that turns drives a slide through a capstan's radius; a linear one through none.
            motor: if joint.motor_capstan_radius == 1.0 { joint.kind } else { JointType::Revolute },
            forces: [torque_rms / joint.gear_ratio / SHAFT_NM, torque_rms / DRIVE_NM, joint_force / JOINT_FORCE].map(positive),
            rates: [rate_rms / MOTOR_RAD_S, rate_rms / joint.ratio() / JOINT_RATE].map(positive),
            capstan: joint.motor_capstan_radius / CAPSTAN_M,
            cable: Load::of_cable(robot, j, torque_rms / joint.motor_capstan_radius),
        }
    }

    /// Speed of the motor that is a Raven's `rad_s`.
    #[must_use]
    pub fn motor_rate(&self, rad_s: f64) -> f64 {
        rad_s * self.rates[0]
    }

    /// How many times the library's are sizes in a [`super::Parameter::unit`] here.
    #[must_use]
    pub fn times(&self, unit: &str) -> f64 {
        let [shaft, drive, joint] = self.forces;
        let [motor_rate, joint_rate] = self.rates;
        match unit {
            "shaft torque" => shaft,
            "shaft viscosity" => shaft / motor_rate,
            // Drives reach their speed in times that are alike.
            "shaft inertia" => shaft / motor_rate,
            "motor speed" => motor_rate,
            "drive torque" => drive,
            "joint force" => joint,
            "joint viscosity" => joint / joint_rate,
            "joint compliance" => 1.0 / joint,
            "cable load" => self.cable.force_n,
            "cable stretch" => self.cable.stretch_m,
            "1/cable stretch" => 1.0 / self.cable.stretch_m,
            "capstan length" => self.capstan,
            _ => 1.0,
        }
    }

    /// A unit as reports have it.
    #[must_use]
    pub fn unit(&self, unit: &'static str) -> &'static str {
        let turns = |kind: JointType| kind == JointType::Revolute;
        match (unit, turns(self.motor), turns(self.joint)) {
            ("shaft torque" | "drive torque", true, _) | ("joint force", _, true) => "N m",
            ("shaft torque" | "drive torque", false, _) | ("joint force", _, false) | ("cable load", ..) => "N",
            ("shaft viscosity", true, _) | ("joint viscosity", _, true) => "N m s",
            ("shaft viscosity", false, _) | ("joint viscosity", _, false) => "N s/m",
            ("shaft inertia", true, _) => "kg m^2",
            ("shaft inertia", false, _) => "kg",
            ("motor speed", true, _) => "rad/s",
            ("motor speed", false, _) => "m/s",
            ("joint compliance", _, true) => "rad/(N m)",
            ("joint compliance", _, false) => "m/N",
            ("joint/rad", _, true) => "rad/rad",
            ("joint/rad", _, false) => "m/rad",
            ("joint", _, true) => "rad",
            ("joint", _, false) | ("capstan length" | "cable stretch", ..) => "m",
            ("1/cable stretch", ..) => "1",
            _ => unit,
        }
    }
}
