//! How large each effect is on such hardware, and drawing one by lot.
//!
//! Ranges are those of the effect library. Where its smallest size lies within three tolerances of the nominal value, the range starts
//! beyond: a number within its tolerance is no effect. Sizes that follow from the robot's loads are parts of those loads.

use std::f64::consts::PI;

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::effect::{Effect, EffectKind, Scope};
use super::motion::Motion;
use super::options::Options;
use super::session::Session;
use crate::robot::{Arm, JointType, Robot};
use crate::{Error, Result};

/// Where in its range a joint works most, as a part of the range.
pub(super) const WORKED_PART: [f64; 3] = [0.5, 0.5, 0.32];

/// Length of the motion in which a drive's peak torque is looked for [s].
const PEAK_S: f64 = 10.0;
/// A cable does not stiffen over less [m]: its force would grow beyond any bound within a step.
const SHORTEST_M: f64 = 2e-6;

/// Where an effect can be on an arm: joints, couplings of its file, both link angles, or the whole.
#[must_use]
pub fn places(robot: &Robot, kind: EffectKind) -> Vec<Option<String>> {
    match kind.scope() {
        Scope::Joint => robot.joints.iter().take(3).map(|joint| Some(joint.name.clone())).collect(),
        Scope::Pair => robot.cable_coupling.iter().map(|c| Some(format!("{}->{}", c.from, c.to))).collect(),
        Scope::LinkAngle => ["12", "23"].map(|angle| Some(angle.to_owned())).to_vec(),
        Scope::Whole => vec![None],
    }
}

/// An effect of a size by lot.
///
/// # Errors
/// If the robot is no arm or does not have the joint.
pub fn draw_effect(robot: &Robot, kind: EffectKind, target: Option<&str>, rng: &mut impl Rng) -> Result<Effect> {
    let arm = robot.arm()?;
    // The joint whose unit the size has.
    let joint = target.map(|target| target.split_once("->").map_or(target, |(_, moved)| moved));
    let j = match kind.scope() {
        Scope::Joint | Scope::Pair => robot.joint_index(joint.unwrap_or_default())?,
        Scope::LinkAngle | Scope::Whole => 0,
    };
    let revolute = robot.joints.get(j).is_some_and(|joint| joint.kind == JointType::Revolute);
    let mut by_lot = ByLot { rng, revolute };
    let loads = Loads::of(&arm, j).ok_or_else(|| no_cable(robot, j))?;
    let values = by_lot.values(kind, &loads, || peak_torque(robot, j))?;
    Effect::new(kind, target, &values)
}

fn no_cable(robot: &Robot, j: usize) -> Error {
    let name = robot.joints.get(j).map_or("?", |joint| joint.name.as_str());
    Error::Data(format!("robot `{}`: joints.{name}.cable.stiffness is not above zero; an effect's size follows from it.", robot.name))
}

/// What a drive bears in the middle of its work.
struct Loads {
    /// Force difference of the cable against gravity [N].
    tension_n: f64,
    /// Stretch under it [m].
    stretch_m: f64,
}

impl Loads {
    /// `None` for a cable without stiffness.
    fn of(arm: &Arm, j: usize) -> Option<Self> {
        let gravity = arm.dynamics.gravity(&worked_pose(arm));
        let tension_n = arm.transmission.tension_n(&gravity)[j].abs();
        let stiffness_n = arm.cables[j].stiffness;
        (stiffness_n > 0.0).then(|| Self { tension_n, stretch_m: 0.5 * tension_n / stiffness_n })
    }
}

/// The most that the nominal robot asks of a drive in the motion `rich` [N m after the gear box].
fn peak_torque(robot: &Robot, j: usize) -> Result<f64> {
    let (_, trace) = Session::new(robot, Options::default())?.run(Motion::Rich, PEAK_S, || {})?;
    Ok(trace.samples().iter().map(|sample| sample.cycle.torque_asked[j].abs()).fold(0.0, f64::max))
}

/// The pose in the middle of an arm's work [rad, rad, m].
pub(super) fn worked_pose(arm: &Arm) -> Vector3<f64> {
    Vector3::from_fn(|j, _| arm.limits[j][0] + WORKED_PART[j] * (arm.limits[j][1] - arm.limits[j][0]))
}

struct ByLot<'a, R> {
    rng: &'a mut R,
    revolute: bool,
}

impl<R: Rng> ByLot<'_, R> {
    fn values(&mut self, kind: EffectKind, loads: &Loads, peak_torque: impl Fn() -> Result<f64>) -> Result<Vec<f64>> {
        use EffectKind::*;
        Ok(match kind {
            PulleyRadius => vec![self.signed(0.01, 0.07)],
            JointOffset => vec![self.signed_at_joint([0.3, 2.5], [1.0, 4.0])],
            CableCoupling if self.revolute => vec![self.signed(0.03, 0.06)],
            CableCoupling => vec![self.signed(0.01, 0.015)],
            CableStretch => vec![self.log(0.02, 0.5)],
            CableStiffening => vec![(loads.stretch_m * self.log(0.05, 0.5)).max(SHORTEST_M)],
            CableDamping => vec![self.either([0.1, 0.3], [3.0, 10.0])],
            Backlash => vec![self.at_joint([0.1, 3.0], [0.1, 3.0])],
            Hysteresis => vec![self.at_joint([0.2, 1.5], [0.5, 2.0])],
            Creep => vec![(self.log(0.5e-3, 3e-3) / loads.stretch_m).clamp(1.0, 100.0), self.log(10.0, 100.0)],
            CableSlip => vec![loads.tension_n * self.log(0.3, 0.8), self.log(0.003, 0.03)],
            PulleyEccentricity => vec![self.log(0.05e-3, 2e-3), self.rng.random_range(-PI..PI)],
            LinkCoulombFriction => vec![self.log(2.0, 10.0)],
            LinkViscousFriction if self.revolute => vec![self.log(50.0, 500.0)],
            LinkViscousFriction => vec![self.log(1000.0, 10_000.0)],
            LoadDependentFriction => vec![self.log(0.05, 0.4)],
            Payload => vec![self.log(0.05, 0.4)],
            LinkInertia => vec![self.either([0.7, 0.8], [1.2, 1.4])],
            MotorCoulombFriction => vec![self.either([0.3, 0.65], [1.5, 3.0])],
            // No more than the drives can follow: a robot that loses its path is not recorded. The insertion's motor turns the fastest.
            MotorViscousFriction if self.revolute => vec![self.log(2.0, 5.0)],
            MotorViscousFriction => vec![self.log(1.3, 1.6)],
            MotorInertia => vec![self.log(2.0, 4.0)],
            StribeckFriction => vec![self.log(0.1, 1.0), self.log(2.0, 10.0)],
            TorqueConstant => vec![1.0 + self.signed(0.06, 0.25)],
            TorqueSaturation => vec![peak_torque()? * self.log(0.6, 0.85)],
            TorqueRipple => vec![self.signed(1e-3, 4e-3), f64::from(self.rng.random_range(3..13_u32))],
            ToolLength => vec![self.signed(1e-3, 6e-3)],
            LinkAngleError => vec![self.signed(0.5, 2.0).to_radians()],
            CameraRotation => self.vector(0.5_f64.to_radians(), 2.0_f64.to_radians()),
            CameraTranslation => self.vector(1.5e-3, 6e-3),
            StereoScale => vec![self.signed(0.006, 0.03)],
            LensDistortion => vec![self.signed(0.02, 0.1)],
            TimeOffset => vec![self.log(0.010, 0.150)],
            ClockDrift => vec![self.signed(60e-6, 1000e-6)],
            StereoDesync => vec![self.signed(0.005, 0.033)],
            RollingShutter => vec![self.log(0.010, 0.060)],
            MissedCounts => vec![self.signed(500.0, 5000.0).round(), self.rng.random_range(0.2..0.8)],
        })
    }

    /// Log-uniform.
    fn log(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.rng.random_range(0.0..1.0))
    }

    fn signed(&mut self, low: f64, high: f64) -> f64 {
        let size = self.log(low, high);
        if self.rng.random_bool(0.5) { size } else { -size }
    }

    /// Between the one pair or between the other.
    fn either(&mut self, below: [f64; 2], above: [f64; 2]) -> f64 {
        let [low, high] = if self.rng.random_bool(0.5) { above } else { below };
        self.log(low, high)
    }

    /// [deg] at a revolute joint, [mm] at a prismatic one, given back in SI.
    fn at_joint(&mut self, deg: [f64; 2], mm: [f64; 2]) -> f64 {
        if self.revolute { self.log(deg[0], deg[1]).to_radians() } else { 1e-3 * self.log(mm[0], mm[1]) }
    }

    fn signed_at_joint(&mut self, deg: [f64; 2], mm: [f64; 2]) -> f64 {
        let size = self.at_joint(deg, mm);
        if self.rng.random_bool(0.5) { size } else { -size }
    }

    /// A vector of a length between, in any direction.
    fn vector(&mut self, low: f64, high: f64) -> Vec<f64> {
        let length = self.log(low, high);
        let any = Vector3::from_fn(|_, _| StandardNormal.sample(self.rng));
        let direction: Vector3<f64> = any.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        (direction * length).as_slice().to_vec()
    }
}
