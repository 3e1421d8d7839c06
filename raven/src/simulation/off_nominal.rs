//! A robot within its tolerances: every number of the robot file is off by a part of what its `tolerances` allow.
//!
//! ```text
//! value ~ N(nominal, (factor tolerance)^2)
//! ```
//!
//! A deviation is written as the small effect that it is. A number that a hidden effect changes keeps that effect's size alone, so that
//! the label says what is true.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::effect::{Effect, EffectKind};
use crate::robot::{JointType, KinematicsKind, Robot};

/// Part of the tolerance that sealed recordings are off by: a tolerance is meant to be kept most of the time.
pub const SEALED_FACTOR: f64 = 0.7;
/// No draw lies farther out, in standard deviations: a part that is would be sent back.
const FARTHEST: f64 = 4.0;
/// A factor on a stiffness, an inertia or a friction stays positive.
const SMALLEST_FACTOR: f64 = 0.05;

/// Draws the deviations of a robot; none for a `factor` of zero. What `effects` change is left out.
#[must_use]
pub fn deviations(robot: &Robot, factor: f64, effects: &[Effect], rng: &mut impl Rng) -> Vec<Effect> {
    if factor <= 0.0 {
        return Vec::new();
    }
    let mut draw = Draw { factor, rng, drawn: Vec::new() };
    let tolerances = &robot.tolerances;
    for joint in robot.joints.iter().take(3) {
        let target = Some(joint.name.as_str());
        draw.offset(EffectKind::PulleyRadius, target, tolerances.radius);
        draw.offset(EffectKind::JointOffset, target, tolerances.hard_stop_of(joint.kind));
        if joint.cable.is_some() {
            draw.factor(EffectKind::CableStretch, target, tolerances.stiffness);
            draw.factor(EffectKind::CableDamping, target, tolerances.damping);
        }
        if joint.motor.is_some() {
            draw.factor(EffectKind::MotorInertia, target, tolerances.motor_inertia);
            draw.factor(EffectKind::MotorCoulombFriction, target, tolerances.motor_friction);
            draw.factor(EffectKind::MotorViscousFriction, target, tolerances.motor_friction);
        }
        if joint.link_friction.is_some() {
            draw.factor(EffectKind::LinkCoulombFriction, target, tolerances.link_friction);
            draw.factor(EffectKind::LinkViscousFriction, target, tolerances.link_friction);
        }
        draw.factor(EffectKind::LinkInertia, target, tolerances.link_inertia);
        draw.factor(EffectKind::TorqueConstant, target, tolerances.torque_gain);
    }
    for coupling in &robot.cable_coupling {
        let moved = robot.joints.iter().find(|joint| joint.name == coupling.to).map(|joint| joint.kind);
        let tolerance = match moved {
            // Of a cable that moves a prismatic joint a third, in m/rad, as of hard stops.
            Some(JointType::Prismatic) => tolerances.cable_coupling / 3.0,
            _ => tolerances.cable_coupling,
        };
        draw.offset(EffectKind::CableCoupling, Some(&format!("{}->{}", coupling.from, coupling.to)), tolerance);
    }
    if matches!(robot.kinematics, KinematicsKind::Raven(_)) {
        draw.offset(EffectKind::LinkAngleError, Some("12"), tolerances.link_angle_rad);
        draw.offset(EffectKind::LinkAngleError, Some("23"), tolerances.link_angle_rad);
        draw.offset(EffectKind::ToolLength, None, tolerances.tool_length_m);
        draw.vector(EffectKind::CameraRotation, tolerances.camera_rotation_rad);
        draw.vector(EffectKind::CameraTranslation, tolerances.camera_translation_m);
        draw.offset(EffectKind::StereoScale, None, tolerances.stereo_scale);
        draw.offset(EffectKind::TimeOffset, None, tolerances.latency_s);
        draw.offset(EffectKind::ClockDrift, None, tolerances.clock_drift);
    }
    let mut drawn = draw.drawn;
    drawn.retain(|deviation| !effects.iter().any(|effect| effect.kind == deviation.kind && effect.target == deviation.target));
    drawn
}

struct Draw<'a, R> {
    factor: f64,
    rng: &'a mut R,
    drawn: Vec<Effect>,
}

impl<R: Rng> Draw<'_, R> {
    fn normal(&mut self, tolerance: f64) -> f64 {
        loop {
            let normal: f64 = StandardNormal.sample(self.rng);
            if normal.abs() <= FARTHEST {
                return self.factor * tolerance * normal;
            }
        }
    }

    fn push(&mut self, kind: EffectKind, target: Option<&str>, values: Vec<f64>) {
        self.drawn.push(Effect { kind, target: target.map(str::to_owned), values });
    }

    /// A number to which the deviation is added, or multiplied as a relative error.
    fn offset(&mut self, kind: EffectKind, target: Option<&str>, tolerance: f64) {
        let value = self.normal(tolerance);
        self.push(kind, target, vec![value]);
    }

    /// A number that is multiplied.
    fn factor(&mut self, kind: EffectKind, target: Option<&str>, tolerance: f64) {
        let value = (1.0 + self.normal(tolerance)).max(SMALLEST_FACTOR);
        self.push(kind, target, vec![value]);
    }

    /// Three numbers.
    fn vector(&mut self, kind: EffectKind, tolerance: f64) {
        let values = (0..3).map(|_| self.normal(tolerance)).collect();
        self.push(kind, None, values);
    }
}
