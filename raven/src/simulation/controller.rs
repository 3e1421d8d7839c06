//! The robot's own control loop: encoders, a PD law on the motor angles, gravity compensation, converters.
//!
//! ```text
//! tau = k_p (q_md - q_m) + k_d (qd_md - qd_m) + r_mc gamma(q)     [N m after the gear box], 1 kHz
//! ```
//!
//! Velocities are first differences of counts. Gains, converter scale and limits are the public controller's (`r2params.yaml`,
//! `defines.h`, `motor.h`); gravity compensation knows the robot file, not the machine.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::Result;
use crate::robot::{ArmSide, KinematicsKind, LinkDynamics, Robot, Transmission};

/// Length of a control cycle [s].
pub const CYCLE_S: f64 = 1e-3;

const GAIN_POSITION: [f64; 3] = [0.300, 0.300, 0.150];
const GAIN_RATE: [f64; 3] = [0.008, 0.008, 0.012];
/// Torque after the gear box per converter step [N m].
const TORQUE_PER_STEP: f64 = 2.7057e-4;
const STEP_LIMIT: [f64; 3] = [5000.0, 5000.0, 4000.0];
/// A bench's own loop: bandwidth [rad/s], critically damped.
const BENCH_BANDWIDTH: f64 = 30.0;

/// Where the trajectory wants the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SetPoint {
    /// Joints [rad, rad, m].
    pub joint: Vector3<f64>,
    /// [rad/s, rad/s, m/s].
    pub rate: Vector3<f64>,
}

/// What the loop did in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Encoder counts with the arm's sign, as they come from the board.
    pub counts: [i32; 3],
    /// Motor angles that the controller makes of them [rad].
    pub motor: Vector3<f64>,
    /// [rad/s].
    pub motor_rate: Vector3<f64>,
    /// Wanted motor angles [rad].
    pub motor_wanted: Vector3<f64>,
    /// Torque commanded after the gear box, before clipping [N m].
    pub torque: Vector3<f64>,
    /// What the converters were given.
    pub converter: [i32; 3],
    /// Torque that they ask of the drives [N m].
    pub torque_asked: Vector3<f64>,
}

/// The loop's memory.
#[derive(Debug, Clone)]
pub struct Controller {
    transmission: Transmission,
    gravity: Option<LinkDynamics>,
    compensating: bool,
    capstan_m: Vector3<f64>,
    gain_position: Vector3<f64>,
    gain_rate: Vector3<f64>,
    /// `None` on a bench: its drive takes any torque.
    converter_sign: Option<f64>,
    counts_per_rad: Option<f64>,
    encoder_sign: f64,
    zero_counts: [i32; 3],
    last_motor: Option<Vector3<f64>>,
}

impl Controller {
    /// The controller of a robot whose encoders read `zero_counts` at the hard stop.
    ///
    /// # Errors
    /// If the robot file lacks what the model needs.
    pub fn new(robot: &Robot, zero_counts: [i32; 3]) -> Result<Self> {
        let counts_per_rad = robot.encoder.map(|e| e.counts_per_revolution / TAU);
        let base = |transmission| Self {
            transmission,
            gravity: None,
            compensating: true,
            capstan_m: Vector3::from_fn(|j, _| robot.joints.get(j).map_or(0.0, |joint| joint.motor_capstan_radius)),
            gain_position: Vector3::from(GAIN_POSITION),
            gain_rate: Vector3::from(GAIN_RATE),
            converter_sign: None,
            counts_per_rad,
            encoder_sign: 1.0,
            zero_counts,
            last_motor: None,
        };
        if let KinematicsKind::Raven(kinematics) = &robot.kinematics {
            let arm = robot.arm()?;
            let sign = match kinematics.arm {
                ArmSide::Gold => -1.0,
                ArmSide::Green => 1.0,
            };
            let gravity = Some(arm.dynamics);
            return Ok(Self { gravity, converter_sign: Some(sign), encoder_sign: sign, ..base(arm.transmission) });
        }
        let per_joint = |f: fn(f64, f64) -> f64| {
            let value = |j: usize| robot.joints.get(j).map_or(0.0, |joint| f(joint.motor.map_or(0.0, |m| m.inertia), joint.gear_ratio));
            Vector3::from_fn(|j, _| value(j))
        };
        Ok(Self {
            gain_position: per_joint(|inertia, gear| inertia * gear * BENCH_BANDWIDTH * BENCH_BANDWIDTH),
            gain_rate: per_joint(|inertia, gear| 2.0 * inertia * gear * BENCH_BANDWIDTH),
            ..base(robot.bench_transmission()?)
        })
    }

    /// Motor and joint angles as the robot file relates them.
    #[must_use]
    pub fn transmission(&self) -> &Transmission {
        &self.transmission
    }

    /// Encoder offset, in counts with the arm's sign: `motor = 2 pi / cpr (sign counts - offset)`.
    #[must_use]
    pub fn encoder_offset(&self, joint: usize) -> f64 {
        let scale = self.counts_per_rad.unwrap_or(0.0);
        self.encoder_sign * f64::from(self.zero_counts[joint]) - self.transmission.motor_at_hard_stop[joint] * scale
    }

    /// Turns gravity compensation on or off; it is off while the robot is pressed into its hard stop.
    pub fn compensate_gravity(&mut self, on: bool) {
        self.compensating = on;
    }

    /// One cycle: reads the motors, commands torque. `missed` is what each encoder has miscounted.
    pub fn cycle(&mut self, motor: &Vector3<f64>, missed: &[i32; 3], wanted: &SetPoint) -> Cycle {
        let stop = self.transmission.motor_at_hard_stop;
        let mut counts = [0; 3];
        let mut read = *motor;
        for j in 0..3 {
            let Some(per_rad) = self.counts_per_rad else { continue };
            let turned = ((motor[j] - stop[j]) * per_rad).round() + f64::from(missed[j]);
            // The message's 32 bits wrap as a counter does; the controller counts on.
            counts[j] = (f64::from(self.zero_counts[j]) + self.encoder_sign * turned) as i64 as i32;
            read[j] = stop[j] + turned / per_rad;
        }
        let motor_rate = self.last_motor.map_or_else(Vector3::zeros, |last| (read - last) / CYCLE_S);
        self.last_motor = Some(read);
        let motor_wanted = self.transmission.motor_from_joint(&wanted.joint);
        let rate_wanted = self.transmission.motor_rate_from_joint(&wanted.rate);
        let mut torque =
            self.gain_position.component_mul(&(motor_wanted - read)) + self.gain_rate.component_mul(&(rate_wanted - motor_rate));
        if let Some(gravity) = self.gravity.as_ref().filter(|_| self.compensating) {
            let joint = self.transmission.joint_from_motor(&read);
            let tension = self.transmission.tension_n(&gravity.gravity(&joint));
            torque += tension.component_mul(&self.capstan_m);
        }
        let mut converter = [0; 3];
        let mut torque_asked = torque;
        if let Some(sign) = self.converter_sign {
            for j in 0..3 {
                let steps = (torque[j] / (sign * TORQUE_PER_STEP)).round().clamp(-STEP_LIMIT[j], STEP_LIMIT[j]);
                converter[j] = steps as i32;
                torque_asked[j] = steps * sign * TORQUE_PER_STEP;
            }
        }
        Cycle { counts, motor: read, motor_rate, motor_wanted, torque, converter, torque_asked }
    }
}
