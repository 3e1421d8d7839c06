//! Causes of a gap that the library of effects does not hold: what an honest diagnosis calls unexplained.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use serde_json::{Value, json};

use super::machine::{Load, Machine};
use super::sizes::{WORKED_PART, worked_pose};
use crate::robot::{JointType, KinematicsKind, Robot};
use crate::{Error, Result};

/// A cause outside the library, with its size.
#[derive(Debug, Clone, PartialEq)]
pub enum Outside {
    /// The robot's base sways before the cameras.
    SwayingBase(Sway),
    /// The tool pushes against something springy in a part of the workspace.
    ToolContact(Contact),
    /// A joint that rubs at one place of its range.
    PlaceFriction(String, Bump),
    /// A pulley that is not round: what the joint takes up is no straight line of its angle.
    UnevenPulley(String, Bulge),
    /// An encoder whose zero wanders.
    WanderingEncoder(String, Wander),
}

/// `a sin(2 pi t / T + p)` of the whole robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sway {
    /// Amplitude [m, frame 0].
    pub amplitude_m: Vector3<f64>,
    /// [s].
    pub period_s: f64,
    /// [rad].
    pub phase: f64,
}

/// A plane that pushes back: `k (n . (tip - point))` beyond it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// A point of the plane [m, frame 0].
    pub point_m: Vector3<f64>,
    /// Unit vector into the wall.
    pub normal: Vector3<f64>,
    /// [N/m].
    pub stiffness: f64,
}

/// Dry friction `F exp(-((q - at) / width)^2)` beside the joint's own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bump {
    /// At its highest [N m or N].
    pub friction: f64,
    /// Joint position [rad or m].
    pub at: f64,
    /// [rad or m].
    pub width: f64,
}

/// `size (4 u^3 - 3 u)`, `u` the travel from the middle of the range over half the range, less its value at the hard stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bulge {
    /// At the joint [rad or m].
    pub size: f64,
    /// Middle of the range, from the hard stop [rad or m].
    pub middle: f64,
    /// Half the range [rad or m].
    pub half: f64,
}

/// Three sines of incommensurable periods, zero at the recording's start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wander {
    /// Standard deviation at the joint [rad or m].
    pub deviation: f64,
    /// Encoder counts per joint motion [1/rad or 1/m].
    pub counts_per_joint: f64,
    /// [s].
    pub periods_s: [f64; 3],
    /// [rad].
    pub phases: [f64; 3],
}

impl Outside {
    /// How many kinds there are.
    pub const KINDS: usize = 5;

    /// Draws the kind `kind` modulo [`Self::KINDS`], its joint and its size.
    ///
    /// # Errors
    /// If the robot is a bench, which has no tool and no camera, or its file lacks a limit.
    pub fn draw(robot: &Robot, kind: usize, rng: &mut impl Rng) -> Result<Self> {
        let arm = robot.arm()?;
        let j = rng.random_range(0..3);
        let name = robot.joints[j].name.clone();
        let [low, high] = arm.limits[j];
        let either = |rng: &mut dyn Rng| if rng.random_bool(0.5) { 1.0 } else { -1.0 };
        let direction = |rng: &mut dyn Rng| {
            let upwards: f64 = rng.random_range(-1.0..1.0);
            let around: f64 = rng.random_range(0.0..TAU);
            let level = (1.0 - upwards * upwards).sqrt();
            Vector3::new(upwards, level * around.cos(), level * around.sin())
        };
        // Half a degree goes with a millimetre and a half.
        let at_joint = |revolute_deg: f64| match robot.joints[j].kind {
            JointType::Revolute => revolute_deg.to_radians(),
            JointType::Prismatic => 3e-3 * revolute_deg,
        };
        Ok(match kind % Self::KINDS {
            0 => Self::SwayingBase(Sway {
                amplitude_m: direction(rng) * rng.random_range(2e-3..5e-3),
                period_s: rng.random_range(7.0..25.0),
                phase: rng.random_range(0.0..TAU),
            }),
            1 => {
                let point_m = arm.kinematics.forward(&worked_pose(&arm));
                let towards = direction(rng);
                // The hard stop, where the encoders are set, is free.
                let outwards = -towards.dot(&(arm.kinematics.forward(&arm.hard_stop) - point_m)).signum();
                Self::ToolContact(Contact { point_m, normal: towards * outwards, stiffness: rng.random_range(150.0..500.0) })
            }
            2 => Self::PlaceFriction(
                name,
                Bump {
                    friction: arm.link_friction[j].coulomb * rng.random_range(4.0..10.0),
                    at: low + (WORKED_PART[j] + rng.random_range(-0.1..0.1)) * (high - low),
                    width: rng.random_range(0.05..0.09) * (high - low),
                },
            ),
            3 => Self::UnevenPulley(
                name,
                Bulge {
                    size: either(rng) * at_joint(rng.random_range(0.7..1.8)),
                    middle: 0.5 * (low + high) - arm.hard_stop[j],
                    half: 0.5 * (high - low),
                },
            ),
            _ => Self::WanderingEncoder(
                name,
                Wander {
                    deviation: at_joint(rng.random_range(0.4..1.0)),
                    counts_per_joint: arm.transmission.ratio[j] * robot.encoder.map_or(0.0, |e| e.counts_per_revolution) / TAU,
                    periods_s: [rng.random_range(9.0..12.0), rng.random_range(15.0..20.0), rng.random_range(27.0..40.0)],
                    phases: std::array::from_fn(|_| rng.random_range(0.0..TAU)),
                },
            ),
        })
    }

    /// Identifier; none is in the library.
    #[must_use]
    pub fn id(&self) -> &'static str {
        match self {
            Self::SwayingBase(_) => "swaying-base",
            Self::ToolContact(_) => "tool-contact",
            Self::PlaceFriction(..) => "place-friction",
            Self::UnevenPulley(..) => "uneven-pulley",
            Self::WanderingEncoder(..) => "wandering-encoder",
        }
    }

    /// The joint it is at.
    #[must_use]
    pub fn joint(&self) -> Option<&str> {
        match self {
            Self::SwayingBase(_) | Self::ToolContact(_) => None,
            Self::PlaceFriction(joint, _) | Self::UnevenPulley(joint, _) | Self::WanderingEncoder(joint, _) => Some(joint),
        }
    }

    /// Its size: amplitude [m], stiffness [N/m], friction [N m or N], error at the joint [rad or m].
    #[must_use]
    pub fn magnitude(&self) -> f64 {
        match self {
            Self::SwayingBase(sway) => sway.amplitude_m.norm(),
            Self::ToolContact(contact) => contact.stiffness,
            Self::PlaceFriction(_, bump) => bump.friction,
            Self::UnevenPulley(_, bulge) => bulge.size,
            Self::WanderingEncoder(_, wander) => wander.deviation,
        }
    }

    /// As a label tells it.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({"id": self.id(), "joint": self.joint(), "magnitude": self.magnitude()})
    }

    /// How far the base is from its place at a time [m, frame 0].
    #[must_use]
    pub fn base_shift_m(&self, time_s: f64) -> Vector3<f64> {
        match self {
            Self::SwayingBase(sway) => sway.amplitude_m * (TAU * time_s / sway.period_s + sway.phase).sin(),
            _ => Vector3::zeros(),
        }
    }
}

impl Contact {
    /// Force on the tip [N, frame 0].
    #[must_use]
    pub fn force_n(&self, tip_m: &Vector3<f64>) -> Vector3<f64> {
        let depth_m = self.normal.dot(&(tip_m - self.point_m)).max(0.0);
        self.normal * (-self.stiffness * depth_m)
    }
}

impl Bump {
    /// Additional dry friction at a joint position [N m or N].
    #[must_use]
    pub fn friction(&self, joint: f64) -> f64 {
        self.friction * (-((joint - self.at) / self.width).powi(2)).exp()
    }
}

impl Bulge {
    /// What the joint takes up beyond its own travel from the hard stop [rad or m], and the slope of it.
    #[must_use]
    pub fn taken(&self, travel: f64) -> (f64, f64) {
        let third = |u: f64| u * (4.0 * u * u - 3.0);
        let (here, stop) = ((travel - self.middle) / self.half, -self.middle / self.half);
        (self.size * (third(here) - third(stop)), self.size * (12.0 * here * here - 3.0) / self.half)
    }
}

impl Wander {
    /// Counts too many at a time from the recording's start.
    #[must_use]
    pub fn counts(&self, time_s: f64) -> i32 {
        let sines: f64 =
            self.periods_s.iter().zip(self.phases).map(|(period_s, phase)| (TAU * time_s / period_s + phase).sin() - phase.sin()).sum();
        // Three sines of unit amplitude have a variance of 3/2; some ten thousand counts fit.
        (self.deviation * self.counts_per_joint * sines / 1.5_f64.sqrt()).round() as i32
    }
}

impl Machine {
    /// The machine with a cause outside the library.
    ///
    /// # Errors
    /// If the robot is a bench or does not have the joint.
    pub fn with_outside(mut self, robot: &Robot, outside: &Outside) -> Result<Self> {
        if matches!(robot.kinematics, KinematicsKind::Bench) {
            return Err(Error::Argument(format!("robot `{}` is a bench: {} needs an arm.", robot.name, outside.id())));
        }
        match outside {
            Outside::SwayingBase(_) => {}
            Outside::ToolContact(contact) => {
                if let Load::Arm { contact: place, .. } = &mut self.load {
                    *place = Some(*contact);
                }
            }
            Outside::PlaceFriction(joint, bump) => self.drives[robot.joint_index(joint)?].bump = Some(*bump),
            Outside::UnevenPulley(joint, bulge) => self.drives[robot.joint_index(joint)?].bulge = Some(*bulge),
            Outside::WanderingEncoder(joint, wander) => self.drives[robot.joint_index(joint)?].wander = Some(*wander),
        }
        Ok(self)
    }
}
