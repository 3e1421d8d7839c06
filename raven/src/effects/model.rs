//! The nominal model with effects built in.

use std::borrow::Cow;

use nalgebra::Vector3;

use crate::Result;
use crate::camera::Cameras;
use crate::robot::{Arm, Cable, KinematicsKind, Motor, MotorLaw, MotorTrack, Observation, Robot, ViscousCoulomb, wound};

use super::{Sited, View};

/// What a drive does beyond the numbers of the robot file.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Torque delivered per torque commanded.
    pub torque_gain: f64,
    /// The command is clipped beyond this [N m].
    pub torque_limit: f64,
    /// Ripples on the shaft, `[a, n]` each: `a sin(n q_m)` [N m, 1].
    pub ripples: Vec<[f64; 2]>,
    /// More Coulomb friction at low speed, `[d, v_s]` each: `1 + d exp(-(v / v_s)^2)`, speed at the motor [1, rad/s].
    pub stribeck: Vec<[f64; 2]>,
}

impl Default for Drive {
    fn default() -> Self {
        Self { torque_gain: 1.0, torque_limit: f64::INFINITY, ripples: Vec::new(), stribeck: Vec::new() }
    }
}

/// The nominal model, open to change.
pub struct Model {
    /// Numbers of the robot file. The motor angles at the hard stop are those of the nominal file: the encoders were set by it.
    pub robot: Robot,
    /// Laws of the motors' side, applied in this order.
    pub motors: Vec<MotorLaw>,
    /// Drives.
    pub drives: [Drive; 3],
    /// How the cameras see it.
    pub view: View,
}

impl Model {
    /// Of a robot file, seen by cameras if there are any. A bench without a cable in its file has a rigid one. The effects that the file
    /// lists are built in, and the list of [`Self::robot`] is empty: they are not built in again by whoever makes an arm of it.
    ///
    /// # Errors
    /// If an arm lacks what an arm needs, a bench has no joints or more than three, or the list names an effect that makes no sense.
    pub fn new(robot: &Robot, cameras: Option<&Cameras>) -> Result<Self> {
        Self::with_effects(robot, cameras, &[])
    }

    /// The same with more effects built in, each at `u` of its parameters (see [`super::Parameter`]). What the motion before a recording left
    /// ([`super::Scale::State`]) is one number of an effect and of what the file lists as the same effect at the same place.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_effects(robot: &Robot, cameras: Option<&Cameras>, effects: &[(Sited, Vec<f64>)]) -> Result<Self> {
        let mut model = Self::bare(robot);
        let (motor_at_hard_stop, tip_at_hard_stop_m) = match &robot.kinematics {
            KinematicsKind::Raven(kinematics) => {
                let arm = robot.arm()?;
                (arm.transmission.motor_at_hard_stop, kinematics.forward(&arm.hard_stop))
            }
            KinematicsKind::Bench => {
                for joint in &mut model.robot.joints {
                    joint.cable.get_or_insert(Cable::new(f64::INFINITY, 0.0));
                }
                (robot.bench_transmission()?.motor_at_hard_stop, Vector3::zeros())
            }
        };
        for (joint, &motor) in model.robot.joints.iter_mut().zip(motor_at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
        model.view = View::new(cameras, tip_at_hard_stop_m, &robot.observation);
        let mut begun = robot.clone();
        effects.iter().for_each(|(sited, u)| sited.begin_listed(&mut begun, &sited.values(u)));
        let model = model.with_listed(&begun)?;
        Ok(effects.iter().fold(model, |model, (sited, u)| model.with(sited, u)))
    }

    /// Of a robot file that need not be complete, seen by nothing, without what it lists.
    pub(super) fn bare(robot: &Robot) -> Self {
        let mut robot = robot.clone();
        robot.effects.clear();
        let view = View::new(None, Vector3::zeros(), &Observation::default());
        Self { robot, motors: Vec::new(), drives: Default::default(), view }
    }

    /// With the effects that `robot` lists.
    pub(super) fn with_listed(mut self, robot: &Robot) -> Result<Self> {
        for listed in &robot.effects {
            let (sited, values) = Sited::from_listed(robot, listed)?;
            self = self.with_values(&sited, &values);
        }
        Ok(self)
    }

    /// Builds an effect in, at `u` of each of its parameters (see [`super::Parameter`]).
    #[must_use]
    pub fn with(self, sited: &Sited, u: &[f64]) -> Self {
        self.with_values(sited, &sited.values(u))
    }

    /// Builds an effect in, with values in the units of its parameters.
    #[must_use]
    pub fn with_values(mut self, sited: &Sited, values: &[f64]) -> Self {
        (sited.effect.act)(&mut self, sited.place, values);
        self
    }

    /// The motors' side as an arm's cables have it.
    #[must_use]
    pub fn motors<'a>(&self, arm: &Arm, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        wound(&self.motors, arm, recorded)
    }

    /// A joint's motor, one without inertia and friction where the file has none.
    pub fn motor_mut(&mut self, j: usize) -> &mut Motor {
        self.robot.joints[j].motor.get_or_insert_default()
    }

    /// A joint's friction, none where the file has none.
    pub fn link_friction_mut(&mut self, j: usize) -> &mut ViscousCoulomb {
        self.robot.joints[j].link_friction.get_or_insert_default()
    }
}
