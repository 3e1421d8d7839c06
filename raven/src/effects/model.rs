//! The nominal model with effects built in.

use crate::Result;
use crate::camera::Cameras;
use crate::robot::{Arm, MotorTrack, Robot};

use super::{Sited, View};

/// How recorded motor angles become those that wind the cables: encoder faults and whatever the cable does at the capstan. It hears of the
/// arm with all its numbers and of the recording's length [s], and changes the track in place.
pub type MotorLaw = Box<dyn Fn(&Arm, &mut MotorTrack) + Send + Sync>;

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
    /// Of a robot file, seen by cameras if there are any.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(robot: &Robot, cameras: Option<&Cameras>) -> Result<Self> {
        let arm = robot.arm()?;
        let mut anchored = robot.clone();
        for (joint, &motor) in anchored.joints.iter_mut().zip(arm.transmission.motor_at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
        let tip_at_hard_stop_m = arm.kinematics.forward(&arm.hard_stop);
        Ok(Self {
            view: View::new(cameras, tip_at_hard_stop_m, &robot.observation),
            robot: anchored,
            motors: Vec::new(),
            drives: [Drive::default(); 3],
        })
    }

    /// Builds an effect in, at `u` of each of its parameters (see [`super::Parameter`]).
    #[must_use]
    pub fn with(mut self, sited: &Sited, u: &[f64]) -> Self {
        let kind = sited.joint_type(&self.robot);
        let values: Vec<f64> = sited.effect.parameters.iter().zip(u).map(|(parameter, &u)| parameter.value(u, kind)).collect();
        (sited.effect.act)(&mut self, sited.place, &values);
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
