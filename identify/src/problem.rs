//! The unknowns of a robot against one or more recordings: residuals for the solver, and what the model leaves unexplained.
//!
//! A cable robot does more than its model: hysteresis, backlash and stretch move each joint by millimetres while the cameras see a tenth
//! of one. Residuals are therefore weighed by what both sightings and model are worth,
//!
//! ```text
//! S = covariance of the sighting + J diag(u1^2, u2^2, u3^2) J'
//! ```
//!
//! with `J` from joints to the seen tip, and the misfit `u` of each joint estimated from the residuals along with everything else. A
//! joint that does not follow the model then does not speak for the others.

use nalgebra::{DVector, Matrix3, Vector3};
use raven::Result;
use raven::robot::Robot;

use crate::batch::{self, Estimate, Residuals};
use crate::misfit::{self, Residual};
use crate::prediction::Predictor;
use crate::priors::Unknown;
use crate::session::{Session, Sighting, whitening};

/// Length of the blocks over which residuals may be alike [s]: hysteresis and the cameras' flaws outlast single images.
pub(crate) const BLOCK_S: f64 = 2.0;
/// Misfit to begin with [rad, rad, m]: what rigid cables leave unexplained on a Raven-II (Haghighipanah et al. 2017, table II).
pub(crate) const MISFIT_START: Vector3<f64> = Vector3::new(0.0228, 0.043, 0.0028);
/// Rounds of estimating values and misfit, and the relative change of the misfit at which they end.
const ROUNDS_MAX: usize = 10;
const MISFIT_SETTLED: f64 = 0.1;
/// Misfit that is as good as none [rad, rad, m]: a third of the tolerance of a hard stop.
const MISFIT_NONE: Vector3<f64> = Vector3::new(3e-4, 3e-4, 1e-4);

/// The unknowns of a robot against one or more recordings.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    /// The robot file, with the motor angle that its controller set at the hard stop written down.
    anchored: Robot,
    unknowns: &'a [Unknown],
    sessions: &'a [Session],
    /// `u` [rad, rad, m].
    misfit: Vector3<f64>,
    /// Per sighting, what makes its residual one of unit covariance [1/m].
    whiten: Vec<Matrix3<f64>>,
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
        let mut problem = Self { anchored, unknowns, sessions, misfit: MISFIT_START, whiten: Vec::new() };
        problem.weigh(&DVector::zeros(unknowns.len()))?;
        Ok(problem)
    }

    /// The robot at `z` prior deviations from its file.
    ///
    /// The logs were recorded with the encoders set by the controller's own numbers, so the motor angle at the hard stop stays.
    #[must_use]
    pub fn robot(&self, z: &DVector<f64>) -> Robot {
        let mut robot = self.anchored.clone();
        for (unknown, &z) in self.unknowns.iter().zip(z.iter()) {
            if let Some(value) = robot.value_mut(&unknown.key) {
                *value = unknown.value(unknown.bounded(z));
            }
        }
        robot
    }

    /// What is to be estimated.
    #[must_use]
    pub fn unknowns(&self) -> &[Unknown] {
        self.unknowns
    }

    /// How many unknowns come before those of the registration: those on which the motion of the links depends, and the latency.
    #[must_use]
    pub fn unknowns_of_robot(&self) -> usize {
        self.unknowns.iter().take_while(|unknown| !unknown.quantity.is_registration()).count()
    }

    /// The recordings.
    #[must_use]
    pub fn sessions(&self) -> &[Session] {
        self.sessions
    }

    /// Keeps `z` where hardware can be, see [`Unknown::bounded`].
    pub fn bound(&self, z: &mut [f64]) {
        self.unknowns.iter().zip(z).for_each(|(unknown, z)| *z = unknown.bounded(*z));
    }

    /// The estimate, with the misfit that goes with it. Unknowns of which `may_hold` is false stay free even if not identified.
    ///
    /// # Errors
    /// If the estimation does not settle.
    pub fn estimate(&mut self, may_hold: &[bool]) -> Result<Estimate> {
        let mut z = DVector::zeros(self.unknowns.len());
        for _ in 0..ROUNDS_MAX {
            z = batch::most_probable(self, &z)?;
            let before = self.misfit;
            self.learn_misfit(&z)?;
            if (self.misfit - before).abs().component_div(&(before + MISFIT_NONE)).max() <= MISFIT_SETTLED {
                break;
            }
        }
        batch::estimate(self, may_hold, &z)
    }

    /// What the model leaves unexplained, one standard deviation per joint [rad, rad, m].
    #[must_use]
    pub fn misfit(&self) -> Vector3<f64> {
        self.misfit
    }

    /// Takes over a misfit [rad, rad, m] that was found along with `z`.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn adopt_misfit(&mut self, misfit: Vector3<f64>, z: &DVector<f64>) -> Result<()> {
        self.misfit = misfit;
        self.weigh(z)
    }

    /// Squared residuals normalised by the sightings' covariance alone: 3 on average, if the model explains all but the noise.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn normalized_squares(&self, z: &DVector<f64>) -> Result<Vec<f64>> {
        let predictor = Predictor::new(&self.robot(z))?;
        let square = |(session, sighting): (&Session, &Sighting)| {
            let error = predictor.seen_m(&session.motion, sighting.time_s) - sighting.position_m;
            whitening(&sighting.covariance_m2).map_or(f64::NAN, |whiten| (whiten * error).norm_squared())
        };
        Ok(self.sightings().map(square).collect())
    }

    fn sightings(&self) -> impl Iterator<Item = (&'a Session, &'a Sighting)> {
        self.sessions.iter().flat_map(|session| session.sightings.iter().map(move |sighting| (session, sighting)))
    }

    fn learn_misfit(&mut self, z: &DVector<f64>) -> Result<()> {
        let predictor = Predictor::new(&self.robot(z))?;
        let residual = |(session, sighting): (&Session, &Sighting)| Residual {
            error: predictor.seen_m(&session.motion, sighting.time_s) - sighting.position_m,
            covariance: sighting.covariance_m2,
            from_joints: predictor.seen_from_joints(&session.motion, sighting.time_s),
        };
        let residuals: Vec<Residual> = self.sightings().map(residual).collect();
        self.misfit = misfit::misfit(&residuals, &self.misfit);
        self.weigh(z)
    }

    fn weigh(&mut self, z: &DVector<f64>) -> Result<()> {
        let predictor = Predictor::new(&self.robot(z))?;
        let variance = Matrix3::from_diagonal(&self.misfit.component_mul(&self.misfit));
        let whiten = |(session, sighting): (&Session, &Sighting)| {
            let from_joints = predictor.seen_from_joints(&session.motion, sighting.time_s);
            let covariance = sighting.covariance_m2 + from_joints * variance * from_joints.transpose();
            // A covariance plus a square has a root.
            whitening(&covariance).unwrap_or_else(Matrix3::zeros)
        };
        self.whiten = self.sightings().map(whiten).collect();
        Ok(())
    }
}

impl Residuals for Problem<'_> {
    fn unknowns(&self) -> usize {
        self.unknowns.len()
    }

    fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>> {
        let predictor = Predictor::new(&self.robot(z))?;
        let error = |(session, sighting): (&Session, &Sighting)| predictor.seen_m(&session.motion, sighting.time_s) - sighting.position_m;
        Ok(self.sightings().map(error).zip(&self.whiten).map(|(error, whiten)| whiten * error).collect())
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
