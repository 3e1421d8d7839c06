//! The nominal model with effects built in.

use nalgebra::Vector3;

use crate::Result;
use crate::camera::Cameras;
use crate::robot::{Arm, Cable, KinematicsKind, Motor, MotorTrack, Robot, Transmission, ViscousCoulomb};

use super::{Sited, View};

/// How recorded motor angles become those that wind the cables: encoder faults and whatever the cable does at the capstan. It hears of the
/// cables with all their numbers, and changes the track in place.
pub type MotorLaw = Box<dyn Fn(&Cables, &mut MotorTrack) + Send + Sync>;

/// Tension differences of the cables [N] at a time [s], with the motors at angles [rad] and turning [rad/s].
pub type TensionLaw<'a> = dyn Fn(f64, &Vector3<f64>, &Vector3<f64>) -> Vector3<f64> + 'a;

/// What a law of the motors' side hears of.
pub struct Cables<'a> {
    /// Pulleys.
    pub transmission: &'a Transmission,
    /// `k_e` of each [N].
    pub stiffness_n: [f64; 3],
    /// What they carry.
    pub tension_n: &'a TensionLaw<'a>,
}

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
    /// Of a robot file, seen by cameras if there are any. A bench without a cable in its file has a rigid one.
    ///
    /// # Errors
    /// If an arm lacks what an arm needs, or a bench has no joints or more than three.
    pub fn new(robot: &Robot, cameras: Option<&Cameras>) -> Result<Self> {
        let mut anchored = robot.clone();
        let (motor_at_hard_stop, tip_at_hard_stop_m) = match &robot.kinematics {
            KinematicsKind::Raven(kinematics) => {
                let arm = robot.arm()?;
                (arm.transmission.motor_at_hard_stop, kinematics.forward(&arm.hard_stop))
            }
            KinematicsKind::Bench => {
                for joint in &mut anchored.joints {
                    joint.cable.get_or_insert(Cable::new(f64::INFINITY, 0.0));
                }
                (robot.bench_transmission()?.motor_at_hard_stop, Vector3::zeros())
            }
        };
        for (joint, &motor) in anchored.joints.iter_mut().zip(motor_at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
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
        let values: Vec<f64> = sited.effect.parameters.iter().zip(u).map(|(parameter, &u)| parameter.value(u, sited.measure)).collect();
        (sited.effect.act)(&mut self, sited.place, &values);
        self
    }

    /// The motors' side as an arm's cables have it.
    #[must_use]
    pub fn motors(&self, arm: &Arm, recorded: &MotorTrack) -> MotorTrack {
        let transmission = &arm.transmission;
        let tension_n = |_: f64, motor: &Vector3<f64>, rate: &Vector3<f64>| {
            let way = arm.rubbing(&transmission.joint_rate_from_motor(rate));
            let drag = Vector3::from_fn(|j, _| arm.link_friction[j].coulomb * way[j]);
            transmission.tension_n(&(arm.dynamics.bias(&transmission.joint_from_motor(motor), &Vector3::zeros()) + drag))
        };
        self.wound(&Cables { transmission, stiffness_n: arm.cables.map(|cable| cable.stiffness), tension_n: &tension_n }, recorded)
    }

    /// The motors' side as cables have it.
    #[must_use]
    pub fn wound(&self, cables: &Cables, recorded: &MotorTrack) -> MotorTrack {
        let mut track = recorded.clone();
        self.motors.iter().for_each(|law| law(cables, &mut track));
        track
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
