//! `robot.yaml`: what stands in it, read strictly. Keys are SI.

use std::path::Path;

use serde::Deserialize;

use super::link_model::stiction_speed;
use super::{ArmSide, Cable, Hysteresis, Kinematics, Link, ListedEffect};
use crate::{Error, Result, files, yaml};

/// One robot: the whole parameter file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    pub(super) format: String,
    /// Name of the robot.
    pub name: String,
    /// Arm or bench.
    pub kinematics: KinematicsKind,
    /// Where the motor side is in a log.
    pub source: Source,
    /// Motor encoders, where the log has raw counts.
    #[serde(default)]
    pub encoder: Option<Encoder>,
    /// In the order of the log's joints.
    pub joints: Vec<Joint>,
    /// Extra cable travel of one joint by another's motion.
    #[serde(default)]
    pub cable_coupling: Vec<Coupling>,
    /// Links, one per joint of an arm.
    #[serde(default)]
    pub links: Vec<Link>,
    /// Mass at the tracked point beyond the links' own [kg].
    #[serde(default)]
    pub payload: f64,
    /// One sigma of what the nominal values are good for.
    pub tolerances: Tolerances,
    /// What calibration found out about the tip's observation.
    #[serde(default)]
    pub observation: Observation,
    /// Effects that none of the numbers above can say.
    #[serde(default)]
    pub effects: Vec<ListedEffect>,
    /// Where each changed value came from.
    #[serde(default)]
    pub calibration: Vec<Provenance>,
}

/// `kinematics:` of the file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "KinematicsKeys")]
pub enum KinematicsKind {
    /// The first three joints of a Raven-II arm.
    Raven(Kinematics),
    /// A drive whose joint is measured directly: no tip, no camera.
    Bench,
}

/// The keys of both kinds; an error in one of them says where it stands, which is lost where serde tells kinds apart.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KinematicsKeys {
    kind: Kind,
    arm: Option<ArmSide>,
    link_angle_12: Option<f64>,
    link_angle_23: Option<f64>,
    wrist_offset: Option<f64>,
    gravity: Option<[f64; 3]>,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Raven,
    Bench,
}

impl TryFrom<KinematicsKeys> for KinematicsKind {
    type Error = String;

    fn try_from(keys: KinematicsKeys) -> std::result::Result<Self, String> {
        if keys.kind == Kind::Bench {
            return Ok(Self::Bench);
        }
        let missing = |key: &str| format!("missing field `{key}`");
        Ok(Self::Raven(Kinematics {
            arm: keys.arm.ok_or_else(|| missing("arm"))?,
            link_angle_12: keys.link_angle_12.ok_or_else(|| missing("link_angle_12"))?,
            link_angle_23: keys.link_angle_23.ok_or_else(|| missing("link_angle_23"))?,
            wrist_offset: keys.wrist_offset.ok_or_else(|| missing("wrist_offset"))?,
            gravity: keys.gravity.ok_or_else(|| missing("gravity"))?,
        }))
    }
}

/// Where a log has the motor side.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Topic name.
    pub topic: String,
    /// Message kind.
    pub format: SourceFormat,
}

/// Message kinds with motor angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SourceFormat {
    /// `raven_2/raven_state`, with all its units.
    RavenState,
    /// `sensor_msgs/JointState` in rad and N m (m and N on a bench).
    JointState,
}

/// Encoder on the motor shaft.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// Counts per turn of the motor.
    pub counts_per_revolution: f64,
}

/// Revolute or prismatic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointType {
    /// Angle [rad].
    Revolute,
    /// Travel [m].
    Prismatic,
}

/// One joint with its drive. Radii in m, angles in rad.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name, as effects and reports use it.
    pub name: String,
    /// Revolute or prismatic.
    #[serde(rename = "type")]
    pub kind: JointType,
    /// Motor turns per capstan turn.
    pub gear_ratio: f64,
    /// `r_mc` [m].
    pub motor_capstan_radius: f64,
    /// `r_l` [m]; 1 on a prismatic joint, where cable travel is joint travel.
    pub link_pulley_radius: f64,
    /// Joint position where the encoders are set [rad or m].
    #[serde(default)]
    pub hard_stop: f64,
    /// Motor angle that was set there when the logs were recorded [rad]; by default what this file's numbers make of `hard_stop`.
    #[serde(default)]
    pub motor_at_hard_stop: Option<f64>,
    /// Range [rad or m].
    #[serde(default)]
    pub limits: Option<[f64; 2]>,
    /// Cable.
    #[serde(default)]
    pub cable: Option<Cable>,
    /// Rate-independent hysteresis of the cable.
    #[serde(default)]
    pub hysteresis: Hysteresis,
    /// Motor.
    #[serde(default)]
    pub motor: Option<Motor>,
    /// Friction at the joint.
    #[serde(default)]
    pub link_friction: Option<ViscousCoulomb>,
}

impl Joint {
    /// Motor angle per joint motion, `N r_l / r_mc` [rad/rad or rad/m].
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.gear_ratio * self.link_pulley_radius / self.motor_capstan_radius
    }

    /// Speed below which its Coulomb friction fades [rad/s or m/s].
    #[must_use]
    pub fn stiction_speed(&self) -> f64 {
        self.link_friction.and_then(|friction| friction.stiction_speed).unwrap_or_else(|| stiction_speed(self.kind))
    }

    /// Unit in which people read this joint, and how many of it make one SI unit.
    #[must_use]
    pub fn display_unit(&self) -> (&'static str, f64) {
        match self.kind {
            JointType::Revolute => ("deg", 180.0 / std::f64::consts::PI),
            JointType::Prismatic => ("mm", 1000.0),
        }
    }
}

/// Motor on its shaft, before the gear box.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motor {
    /// [kg m^2].
    pub inertia: f64,
    /// [N m].
    pub coulomb_friction: f64,
    /// [N m s].
    pub viscous_friction: f64,
}

/// Friction at a joint.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViscousCoulomb {
    /// [N m or N].
    pub coulomb: f64,
    /// [N m s or N s/m].
    pub viscous: f64,
    /// Coulomb friction per force that the cable exerts on the joint [1].
    #[serde(default)]
    pub per_load: f64,
    /// Part of Coulomb friction that holds a joint whose motor stands still; the rest gives way slowly [1].
    #[serde(default)]
    pub held_part: f64,
    /// How far friction that holds keeps the joint behind where its cables would have it as a recording begins, as a part of the most
    /// [-1 to 1]: what the motion before left.
    #[serde(default)]
    pub lag_at_start: f64,
    /// Speed below which Coulomb friction fades [rad/s or m/s]; the model's own where it is not given.
    #[serde(default)]
    pub stiction_speed: Option<f64>,
}

/// One entry of the cable coupling: `q_to += coefficient * q_from`, as cable travel at the joint.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coupling {
    /// Joint that moves.
    pub from: String,
    /// Joint whose cable is moved.
    pub to: String,
    /// [rad/rad or m/rad].
    pub coefficient: f64,
}

/// One sigma of what drawings, datasheets or the last calibration allow; relative unless a unit is named.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    /// Pulley radius.
    pub radius: f64,
    /// Hard stop [rad]; prismatic joints a third of it in m.
    pub hard_stop: f64,
    /// Coupling.
    pub cable_coupling: f64,
    /// `k_e`.
    pub stiffness: f64,
    /// `b_e`.
    pub damping: f64,
    /// `I_m`.
    pub motor_inertia: f64,
    /// Motor friction.
    pub motor_friction: f64,
    /// Joint friction.
    pub link_friction: f64,
    /// Link inertia.
    pub link_inertia: f64,
    /// Torque per command.
    pub torque_gain: f64,
    /// Angles between the axes [rad].
    #[serde(default = "defaults::link_angle_rad")]
    pub link_angle_rad: f64,
    /// Tool length [m].
    #[serde(default = "defaults::tool_length_m")]
    pub tool_length_m: f64,
    /// Registration, rotation [rad].
    #[serde(default = "defaults::camera_rotation_rad")]
    pub camera_rotation_rad: f64,
    /// Registration, translation [m].
    #[serde(default = "defaults::camera_translation_m")]
    pub camera_translation_m: f64,
    /// Baseline.
    #[serde(default = "defaults::stereo_scale")]
    pub stereo_scale: f64,
    /// Camera latency [s].
    #[serde(default = "defaults::latency_s")]
    pub latency_s: f64,
    /// Camera clock against robot clock.
    #[serde(default = "defaults::clock_drift")]
    pub clock_drift: f64,
}

/// What a file that does not say gets: the nominal robot's own tolerances.
mod defaults {
    pub fn link_angle_rad() -> f64 {
        0.001
    }
    pub fn tool_length_m() -> f64 {
        0.0003
    }
    pub fn camera_rotation_rad() -> f64 {
        0.002
    }
    pub fn camera_translation_m() -> f64 {
        0.0005
    }
    pub fn stereo_scale() -> f64 {
        0.002
    }
    pub fn latency_s() -> f64 {
        0.003
    }
    pub fn clock_drift() -> f64 {
        0.000_02
    }
}

impl Tolerances {
    /// Their keys, values and units, in the file's order.
    pub(super) fn numbers(&self) -> [(&'static str, f64, &'static str); 17] {
        [
            ("radius", self.radius, "1"),
            ("hard_stop", self.hard_stop, "rad"),
            ("cable_coupling", self.cable_coupling, "rad/rad"),
            ("stiffness", self.stiffness, "1"),
            ("damping", self.damping, "1"),
            ("motor_inertia", self.motor_inertia, "1"),
            ("motor_friction", self.motor_friction, "1"),
            ("link_friction", self.link_friction, "1"),
            ("link_inertia", self.link_inertia, "1"),
            ("torque_gain", self.torque_gain, "1"),
            ("link_angle_rad", self.link_angle_rad, "rad"),
            ("tool_length_m", self.tool_length_m, "m"),
            ("camera_rotation_rad", self.camera_rotation_rad, "rad"),
            ("camera_translation_m", self.camera_translation_m, "m"),
            ("stereo_scale", self.stereo_scale, "1"),
            ("latency_s", self.latency_s, "s"),
            ("clock_drift", self.clock_drift, "1"),
        ]
    }

    /// One sigma of a joint's hard stop [rad or m]: 0.0009 rad goes with 0.0003 m.
    #[must_use]
    pub fn hard_stop_of(&self, kind: JointType) -> f64 {
        match kind {
            JointType::Revolute => self.hard_stop,
            JointType::Prismatic => self.hard_stop / 3.0,
        }
    }
}

/// Corrections to the observed tip that were estimated together with the robot's parameters.
///
/// A tip observed at `p` with stamp `t` is where the robot had it at `t - latency`, at `R (p - p_hs) + p_hs + translation`: the rotation
/// turns about the tip at the hard stop, where the registration was made.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Observation {
    /// By how much an image shows the past of its stamp [s].
    pub latency: f64,
    /// Rotation vector [rad], frame 0.
    pub rotation: [f64; 3],
    /// [m], frame 0.
    pub translation: [f64; 3],
    /// Covariance of what is left unknown of rotation and translation, 6x6 [rad^2, rad m, m^2]: its lower triangle, row by row. What cameras have
    /// wrong in all images alike is in it as the pose that comes nearest to it. None where nobody found out.
    pub covariance: Option<[f64; POSE_COVARIANCE]>,
}

/// Numbers of a pose's covariance.
pub const POSE_COVARIANCE: usize = 21;

/// Where a changed value came from.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Short name, such as `r_l1`.
    pub parameter: String,
    /// Where it stands in this file, such as `joints.shoulder.link_pulley_radius`.
    pub key: String,
    /// Unit of the four numbers.
    pub unit: String,
    /// New value.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Value before.
    pub prior: f64,
    /// Standard deviation before.
    pub prior_std: f64,
    /// Whether the data determined it.
    pub identified: bool,
    /// How it was found.
    pub method: String,
    /// Logs, by file name.
    pub logs: Vec<String>,
    /// SHA-256 of each log.
    pub sha256: Vec<String>,
}

impl Robot {
    /// Reads a robot file.
    ///
    /// # Errors
    /// If the file is missing, has a key or type that is not in the format, or a value that cannot be in SI units.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &files::read_text(path)?)
    }

    /// Reads a robot file's text, which came from `path`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let robot: Self = yaml::parse(path, text)?;
        robot.check().map_err(|message| Error::file(path, message))?;
        Ok(robot)
    }
}
