//! The links of a robot at one set of parameters, moved by the recorded motors from image to image.

use nalgebra::{Const, DVector, Matrix3, SVector, Vector3};
use raven::Result;
use raven::filter::{PaperStates, SquareRootUkf, StateEquation};
use raven::observation::TipCorrection;
use raven::robot::{LinkModel, LinkState};

use crate::motion::Motion;
use crate::problem::Problem;

/// States of the links: positions and velocities [rad, rad, m, rad/s, rad/s, m/s].
pub type States = SVector<f64, 6>;

/// The links and the cameras at one `z`. All times are stamps of images; the motors are taken where the image shows them.
pub struct Links {
    equation: PaperStates,
    correction: TipCorrection,
}

impl Links {
    /// At `z` prior deviations from the robot file.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(problem: &Problem, z: &DVector<f64>) -> Result<Self> {
        let robot = problem.robot(z);
        let arm = robot.arm()?;
        Ok(Self { correction: TipCorrection::of(&robot, &arm)?, equation: PaperStates::new(LinkModel::new(arm)) })
    }

    /// Where the cables hold the links while the motors move as they do at an image.
    pub fn settled(&self, motion: &Motion, stamp_s: f64) -> States {
        let time_s = self.correction.shown_at_s(stamp_s);
        let rate = self.equation.model.arm().transmission.joint_rate_from_motor(&motion.rate_rad_s(time_s));
        let direction = self.equation.model.arm().rubbing(&rate);
        let position = self.equation.model.settled(&motion.angle_rad(time_s), &direction);
        States::from_iterator(position.iter().chain(rate.iter()).copied())
    }

    /// The links at the image `to_s`, from what they were at the image `from_s`; settled where the motors are not known in between.
    pub fn follow(&self, states: &States, motion: &Motion, from_s: f64, to_s: f64) -> States {
        let state = LinkState::new(states.fixed_rows::<3>(0).into(), states.fixed_rows::<3>(3).into());
        match self.equation.model.follow(state, motion.track(), self.correction.shown_at_s(from_s), self.correction.shown_at_s(to_s)) {
            Some(state) => States::from_iterator(state.position.iter().chain(state.rate.iter()).copied()),
            None => self.settled(motion, to_s),
        }
    }

    /// Where the cameras see the tip [m].
    pub fn seen_m(&self, states: &States) -> Vector3<f64> {
        self.correction.seen_m(&self.equation.model.arm().kinematics.forward(&states.fixed_rows::<3>(0).into()))
    }

    /// How that moves with the joints, 3x3 [m/rad, m/rad, 1].
    pub fn seen_from_joints(&self, states: &States) -> Matrix3<f64> {
        self.correction.seen_from_true() * self.equation.model.arm().kinematics.jacobian(&states.fixed_rows::<3>(0).into())
    }

    /// A filter of links at rest where the cables hold them.
    pub fn at_rest(&self, motion: &Motion, stamp_s: f64) -> SquareRootUkf<Const<6>, 3> {
        let (_, factor) = self.equation.initial(&motion.angle_rad(self.correction.shown_at_s(stamp_s)));
        SquareRootUkf::new(self.settled(motion, stamp_s), factor)
    }

    /// The state equation.
    pub fn equation(&self) -> &PaperStates {
        &self.equation
    }
}
