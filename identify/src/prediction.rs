//! Where the cameras should have seen the tip, for a robot file and what it says about the observation.
//!
//! A tip stamped `t` is where the robot had it at `t - latency`. There the joints rest where the cables hold them,
//!
//! ```text
//! q = q_rigid(q_m) - (1 + C)^-1 x / r_l,   gamma(x) = (1 + C)'^-1 (G(q) + F_c tanh(qd / v_s)) / r_l
//! ```
//!
//! with the motors' direction of motion for the friction's. Leaving out inertia and cable damping costs 1e-4 rad rms and 6 um on
//! motions of 0.8 rad/s. The prediction is then moved as the registration is off, `p_seen = R' (p - p_hs - translation) + p_hs`, so
//! that it meets the sighting, and the sighting's covariance, in the frame in which they were recorded.

use nalgebra::{DVector, Rotation3, Vector3};
use raven::Result;
use raven::robot::{LinkModel, Observation, Robot, STICTION_SPEED};

use crate::batch::Residuals;
use crate::motion::Motion;
use crate::priors::Unknown;
use crate::session::Session;

/// Length of the blocks over which residuals may be alike [s]: hysteresis and the cameras' flaws outlast single images.
const BLOCK_S: f64 = 2.0;

/// Predicts sightings from motors.
#[derive(Debug, Clone)]
pub struct Predictor {
    model: LinkModel,
    latency_s: f64,
    seen_from_true: Rotation3<f64>,
    translation_m: Vector3<f64>,
    tip_at_hard_stop_m: Vector3<f64>,
}

impl Predictor {
    /// For a robot file.
    ///
    /// # Errors
    /// If it describes no arm.
    pub fn new(robot: &Robot) -> Result<Self> {
        let arm = robot.arm()?;
        let Observation { latency, rotation, translation } = robot.observation;
        Ok(Self {
            latency_s: latency,
            seen_from_true: Rotation3::new(Vector3::from(rotation)).inverse(),
            translation_m: Vector3::from(translation),
            tip_at_hard_stop_m: arm.kinematics.forward(&arm.hard_stop),
            model: LinkModel::new(arm),
        })
    }

    /// Joint positions [rad, rad, m] at a time of the robot.
    #[must_use]
    pub fn joints(&self, motion: &Motion, time_s: f64) -> Vector3<f64> {
        let transmission = &self.model.arm().transmission;
        let rate = transmission.joint_rate_from_motor(&motion.rate_rad_s(time_s));
        let direction = Vector3::from_fn(|j, _| (rate[j] / STICTION_SPEED[j]).tanh());
        self.model.settled(&motion.angle_rad(time_s), &direction)
    }

    /// Where the tip with stamp `time_s` should have been seen [m].
    #[must_use]
    pub fn seen_m(&self, motion: &Motion, time_s: f64) -> Vector3<f64> {
        let tip = self.model.arm().kinematics.forward(&self.joints(motion, time_s - self.latency_s));
        self.seen_from_true * (tip - self.tip_at_hard_stop_m - self.translation_m) + self.tip_at_hard_stop_m
    }
}

/// The unknowns of a robot against one or more recordings.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// The robot file, with the motor angle that its controller set at the hard stop written down.
    anchored: Robot,
    unknowns: &'a [Unknown],
    sessions: &'a [Session],
}

impl<'a> Problem<'a> {
    /// The problem of estimating `unknowns` of `robot` from `sessions`.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(robot: &Robot, unknowns: &'a [Unknown], sessions: &'a [Session]) -> Result<Self> {
        let mut anchored = robot.clone();
        let at_hard_stop = robot.arm()?.transmission.motor_at_hard_stop;
        for (joint, &motor) in anchored.joints.iter_mut().zip(at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
        Ok(Self { anchored, unknowns, sessions })
    }

    /// The robot at `z` prior deviations from its file.
    ///
    /// The logs were recorded with the encoders set by the controller's own numbers, so the motor angle at the hard stop stays.
    #[must_use]
    pub fn robot(&self, z: &DVector<f64>) -> Robot {
        let mut robot = self.anchored.clone();
        for (unknown, &z) in self.unknowns.iter().zip(z.iter()) {
            if let Some(value) = robot.value_mut(&unknown.key) {
                *value = unknown.value(z);
            }
        }
        robot
    }
}

impl Residuals for Problem<'_> {
    fn unknowns(&self) -> usize {
        self.unknowns.len()
    }

    fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>> {
        let predictor = Predictor::new(&self.robot(z))?;
        let of = |session: &Session| -> Vec<Vector3<f64>> {
            let residual = |s: &crate::session::Sighting| s.whiten * (predictor.seen_m(&session.motion, s.time_s) - s.position_m);
            session.sightings.iter().map(residual).collect()
        };
        Ok(self.sessions.iter().flat_map(of).collect())
    }

    fn blocks(&self) -> Vec<usize> {
        let mut blocks = Vec::new();
        let (mut block, mut last) = (0, None);
        for (s, session) in self.sessions.iter().enumerate() {
            for sighting in &session.sightings {
                let place = (s, (sighting.time_s / BLOCK_S).floor());
                if last.is_some_and(|last| last != place) {
                    block += 1;
                }
                last = Some(place);
                blocks.push(block);
            }
        }
        blocks
    }
}
