//! The nominal model with effects built in.

use nalgebra::Vector3;

use crate::Result;
use crate::camera::Cameras;
use crate::robot::{Arm, MotorLaw, MotorTrack, Observation, Robot};

use super::{Sited, View};

/// What a drive does beyond the numbers of the robot file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Torque delivered per torque commanded.
    pub torque_gain: f64,
    /// The command is clipped beyond this [N m].
    pub torque_limit: f64,
    /// Ripple on the shaft, `[a, n]`: `a sin(n q_m)` [N m, 1].
    pub ripple: [f64; 2],
    /// More Coulomb friction at low speed, `[d, v_s]`: `1 + d exp(-(v / v_s)^2)`, speed at the motor [1, rad/s].
    pub stribeck: [f64; 2],
}

impl Default for Drive {
    fn default() -> Self {
        Self { torque_gain: 1.0, torque_limit: f64::INFINITY, ripple: [0.0, 1.0], stribeck: [0.0, 1.0] }
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
    /// Of a robot file, seen by cameras if there are any. The effects that the file lists are built in, and the list of [`Self::robot`] is
    /// empty: they are not built in again by whoever makes an arm of it.
    ///
    /// # Errors
    /// If the robot is no arm, or lists an effect that makes no sense.
    pub fn new(robot: &Robot, cameras: Option<&Cameras>) -> Result<Self> {
        let arm = robot.arm()?;
        let mut model = Self::bare(robot);
        for (joint, &motor) in model.robot.joints.iter_mut().zip(arm.transmission.motor_at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
        model.view = View::new(cameras, arm.kinematics.forward(&arm.hard_stop), &robot.observation);
        model.with_listed(robot)
    }

    /// Of a robot file that need not be complete, seen by nothing, without what it lists.
    pub(super) fn bare(robot: &Robot) -> Self {
        let mut robot = robot.clone();
        robot.effects.clear();
        let view = View::new(None, Vector3::zeros(), &Observation::default());
        Self { robot, motors: Vec::new(), drives: [Drive::default(); 3], view }
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
        let kind = sited.joint_type(&self.robot);
        let values: Vec<f64> = sited.effect.parameters.iter().zip(u).map(|(parameter, &u)| parameter.value(u, kind)).collect();
        self.with_values(sited, &values)
    }

    /// Builds an effect in, with values in the units of its parameters.
    #[must_use]
    pub fn with_values(mut self, sited: &Sited, values: &[f64]) -> Self {
        (sited.effect.act)(&mut self, sited.place, values);
        self
    }

    /// The motors' side as the cables have it.
    #[must_use]
    pub fn motors(&self, arm: &Arm, recorded: &MotorTrack) -> MotorTrack {
        let mut track = recorded.clone();
        self.motors.iter().for_each(|law| law(arm, &mut track));
        track
    }
}
