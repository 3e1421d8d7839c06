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
//!
//! Friction holds the joints back for a while at every reversal, and inertia and damping keep them from where they would rest. Rollouts
//! of the whole motion say by how much. That lag hardly depends on radii, hard stops, couplings and registration: it is taken from the
//! estimate at rest and kept. With a cable's stiffness or damping or a joint's friction among the unknowns every prediction comes from
//! rollouts of its own: behind a soft cable the lag is a large part of what there is to see of them.

mod beside;
mod held;
mod rolled;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use nalgebra::{DVector, Matrix3, Vector3};
use raven::Result;
use raven::robot::Robot;
use raven::stats::chi_square_quantile;
use rayon::prelude::*;

use crate::batch::{self, Estimate, Jacobian, Residuals, central_difference};
use crate::misfit::{self, FALSE_CHANCE, Residual};
use crate::motion::Motion;
use crate::parameters::Quantity;
use crate::prediction::Predictor;
use crate::priors::Unknown;
use crate::session::{Session, Sighting, whitening};
use crate::tolerances::Links;
use beside::Beside;
pub use beside::Flaw;
pub use held::HeldPart;
use rolled::Rolled;

/// Length of the blocks over which residuals may be alike [s]: hysteresis and the cameras' flaws outlast single images.
pub(crate) const BLOCK_S: f64 = 2.0;
/// Misfit to begin with [rad, rad, m]: what rigid cables leave unexplained on a Raven-II (Haghighipanah et al. 2017, table II).
pub(crate) const MISFIT_START: Vector3<f64> = Vector3::new(0.0228, 0.043, 0.0028);
/// Rounds of estimating values and misfit, and the relative change of the misfit at which they end.
const ROUNDS_MAX: usize = 10;
const MISFIT_SETTLED: f64 = 0.1;
/// Rollouts that find out how far from rest the joints are, where nothing is looked for that this depends on: each corrects the one before in
/// the second order.
const LAGS: usize = 2;
/// Step of the difference quotient by the straight part of a loop, in prior deviations. Near 1 few sightings fall where a loop rounds off, which is
/// all that changes with it there: residuals are smooth over such a step only.
const STRAIGHT_STEP: f64 = 0.1;
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
    joints: Joints,
    /// What is unknown beside, and how it moves the sightings.
    beside: Beside,
    flaws: Vec<Flaw>,
    /// What took rollouts, and where.
    rolled: Arc<Mutex<Rolled>>,
    held: Vec<HeldPart>,
}

/// How far predictions take the joints to be from where the cables hold them at rest.
#[derive(Debug, Clone)]
enum Joints {
    AtRest,
    /// As far as a rollout near the estimate has them, per sighting [rad, rad, m].
    Lagging(Vec<Vector3<f64>>),
    /// As far as a rollout with the very numbers has them.
    Rolling,
}

/// How far from rest the joints are, per sighting [rad, rad, m]; `None` where they count as at rest.
type Lag = Option<Vec<Vector3<f64>>>;

impl<'a> Problem<'a> {
    /// The problem of estimating `unknowns` of `robot` from `sessions`, and what the motion before each of them left of effects that remember.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(robot: &Robot, unknowns: &'a [Unknown], sessions: &'a [Session]) -> Result<Self> {
        let mut anchored = robot.clone();
        let at_hard_stop = robot.arm()?.transmission.motor_at_hard_stop;
        for (joint, &motor) in anchored.joints.iter_mut().zip(at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
        let beside = Beside::left(&anchored, unknowns, sessions.len());
        let mut problem = Self {
            unknowns,
            sessions,
            misfit: MISFIT_START,
            whiten: Vec::new(),
            joints: Joints::AtRest,
            flaws: beside.flaws(&anchored, sessions, Links::AtRest)?,
            beside,
            anchored,
            rolled: Arc::default(),
            held: Vec::new(),
        };
        problem.weigh(&DVector::zeros(Residuals::unknowns(&problem)))?;
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
                *value = unknown.value(z);
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

    /// A recording's motors behind the hysteresis that the robot file has.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn driving(&self, session: &Session) -> Result<Motion> {
        Ok(Predictor::new(&self.anchored)?.driving(&session.motion).into_owned())
    }

    /// Keeps `z` where hardware can be, see [`Unknown::bounded`].
    pub fn bound(&self, z: &mut [f64]) {
        z.iter_mut().enumerate().for_each(|(k, z)| *z = self.bounded(k, *z));
    }

    /// The estimate, with the misfit that goes with it.
    ///
    /// # Errors
    /// If the estimation does not settle.
    pub fn estimate(&mut self) -> Result<Estimate> {
        let z = self.settled()?;
        self.estimate_from(&z, &[])
    }

    /// The most probable values, with the misfit that goes with them, before anything is held.
    ///
    /// # Errors
    /// If the estimation does not settle.
    pub(crate) fn settled(&mut self) -> Result<DVector<f64>> {
        let mut z = self.fitted()?;
        self.turn_over_held(&mut z)?;
        Ok(z)
    }

    /// The estimate from values that are [settled](Self::settled), with some unknowns at their prior whatever the logs say.
    ///
    /// # Errors
    /// If the estimation does not settle.
    pub(crate) fn estimate_from(&self, settled: &DVector<f64>, held: &[usize]) -> Result<Estimate> {
        batch::estimate(self, &self.may_hold(), held, settled)
    }

    /// The same with all unknowns at what is most probable, whether or not the logs determine them.
    ///
    /// # Errors
    /// If the estimation does not settle.
    pub fn estimate_all(&mut self) -> Result<Estimate> {
        let z = self.settled()?;
        batch::estimate(self, &vec![false; Residuals::unknowns(self)], &[], &z)
    }

    /// Which unknowns [may be held](crate::parameters::Quantity::may_hold); no flaw may.
    pub(crate) fn may_hold(&self) -> Vec<bool> {
        self.unknowns.iter().map(|unknown| unknown.quantity.may_hold()).chain(self.flaws.iter().map(|_| false)).collect()
    }

    /// Logarithm of the sightings' likelihood, false ones cut off, up to a constant.
    fn likelihood(&self, z: &DVector<f64>) -> Result<f64> {
        let limit = chi_square_quantile(3, 1.0 - FALSE_CHANCE).unwrap_or(f64::INFINITY);
        let squares: f64 = self.residuals(z)?.iter().map(|residual| residual.norm_squared().min(limit)).sum();
        let volumes: f64 = self.whiten.iter().map(|whiten| whiten.determinant().abs().max(f64::MIN_POSITIVE).ln()).sum();
        Ok(volumes - 0.5 * (squares + z.norm_squared()))
    }

    /// The most probable values with their misfit, joints lagging or rolling.
    fn fitted(&mut self) -> Result<DVector<f64>> {
        let mut z = DVector::zeros(Residuals::unknowns(self));
        self.settle(&mut z)?;
        self.refine(&mut z)?;
        Ok(z)
    }

    /// The same from where the values are near, joints lagging or rolling from the outset.
    fn refine(&mut self, z: &mut DVector<f64>) -> Result<()> {
        self.look_from(z)?;
        for _ in 0..LAGS {
            let predictor = Predictor::new(&self.robot(z))?;
            self.joints = Joints::Lagging(self.rollout(&predictor));
            self.settle(z)?;
        }
        // From there rollouts have little left to do.
        if self.links_are_unknown() {
            self.joints = Joints::Rolling;
            self.settle(z)?;
        }
        Ok(())
    }

    /// Values and misfit in turn, until the misfit stands still.
    fn settle(&mut self, z: &mut DVector<f64>) -> Result<()> {
        for _ in 0..ROUNDS_MAX {
            *z = batch::most_probable(self, z)?;
            let before = self.misfit;
            self.learn_misfit(z)?;
            if (self.misfit - before).abs().component_div(&(before + MISFIT_NONE)).max() <= MISFIT_SETTLED {
                break;
            }
        }
        Ok(())
    }

    /// What the model leaves unexplained, one standard deviation per joint [rad, rad, m].
    #[must_use]
    pub fn misfit(&self) -> Vector3<f64> {
        self.misfit
    }

    /// Takes over what was found elsewhere: `z`, and the misfit [rad, rad, m] that goes with it.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn adopt(&mut self, misfit: Vector3<f64>, z: &DVector<f64>) -> Result<()> {
        self.misfit = misfit;
        self.joints =
            if self.links_are_unknown() { Joints::Rolling } else { Joints::Lagging(self.rollout(&Predictor::new(&self.robot(z))?)) };
        self.weigh(z)
    }

    /// Whether numbers are asked about on which it depends how the links swing; where they are estimated along, as registrations do, what can be
    /// seen of them at rest is enough.
    fn links_are_unknown(&self) -> bool {
        self.unknowns.iter().any(|unknown| unknown.named && unknown.quantity.is_of_links())
    }

    /// Squared residuals normalised by the sightings' covariance alone: 3 on average, if the model explains all but the noise.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn normalized_squares(&self, z: &DVector<f64>) -> Result<Vec<f64>> {
        let predictor = Predictor::new(&self.robot(z))?;
        let square = |(error, (_, sighting)): (Vector3<f64>, (&Session, &Sighting))| {
            whitening(&sighting.covariance_m2).map_or(f64::NAN, |whiten| (whiten * error).norm_squared())
        };
        Ok(self.errors(&predictor, &self.lag(&predictor, z), z).into_iter().zip(self.sightings()).map(square).collect())
    }

    /// Derivatives of the residuals, normalised by the sightings' covariance alone, per prior deviation of each unknown.
    ///
    /// # Errors
    /// If the model cannot be evaluated.
    pub fn sighting_jacobian(&self, z: &DVector<f64>) -> Result<Jacobian> {
        let all: Vec<usize> = (0..Residuals::unknowns(self)).collect();
        let whiten: Vec<_> = self.sightings().map(|(_, s)| whitening(&s.covariance_m2).unwrap_or_else(Matrix3::zeros)).collect();
        self.derivatives(z, &all, &whiten)
    }

    fn sightings(&self) -> impl Iterator<Item = (&'a Session, &'a Sighting)> {
        self.sessions.iter().flat_map(|session| session.sightings.iter().map(move |sighting| (session, sighting)))
    }

    fn lag(&self, predictor: &Predictor, z: &DVector<f64>) -> Lag {
        match &self.joints {
            Joints::AtRest => None,
            Joints::Lagging(lag) => Some(lag.clone()),
            Joints::Rolling => Some(self.rolled_lag(predictor, z)),
        }
    }

    /// What rollouts add to the joints at rest.
    fn rollout(&self, predictor: &Predictor) -> Vec<Vector3<f64>> {
        self.sessions.iter().flat_map(|session| predictor.session_lag(session)).collect()
    }

    /// Prediction, with its flaws, less sighting [m].
    fn errors(&self, predictor: &Predictor, lag: &Lag, z: &DVector<f64>) -> Vec<Vector3<f64>> {
        let mut errors = Vec::with_capacity(self.whiten.len());
        for session in self.sessions {
            let seen_m = predictor.session_m(session, lag.as_ref().map(|lag| &lag[errors.len()..]));
            for (sighting, seen_m) in session.sightings.iter().zip(seen_m) {
                errors.push(seen_m + self.flawed_m(errors.len(), z) - sighting.position_m);
            }
        }
        errors
    }

    fn derivatives(&self, z: &DVector<f64>, columns: &[usize], whiten: &[Matrix3<f64>]) -> Result<Jacobian> {
        let (swinging, resting): (Vec<usize>, Vec<usize>) = columns
            .iter()
            .partition(|k| matches!(self.joints, Joints::Rolling) && self.unknowns.get(**k).is_some_and(|u| u.quantity.is_dynamic()));
        let lag = self.lag(&Predictor::new(&self.robot(z))?, z);
        let at_rest = |z: &DVector<f64>| Ok(self.errors(&Predictor::new(&self.robot(z))?, &lag, z));
        let column = |k: usize| match self.flaw(k) {
            Some(flaw) => Ok((k, flaw.clone())),
            None => Ok((k, central_difference(at_rest, z, k, self.around(k, z[k]))?)),
        };
        let mut slopes: BTreeMap<usize, Vec<Vector3<f64>>> = resting.into_par_iter().map(column).collect::<Result<_>>()?;
        if !swinging.is_empty() {
            slopes.extend(self.rolled_columns(z, &swinging)?);
        }
        let whitened = |k: &usize| slopes[k].iter().zip(whiten).map(|(slope, whiten)| whiten * slope).collect();
        Ok(columns.iter().map(whitened).collect())
    }

    fn learn_misfit(&mut self, z: &DVector<f64>) -> Result<()> {
        let predictor = Predictor::new(&self.robot(z))?;
        let errors = self.errors(&predictor, &self.lag(&predictor, z), z);
        let residual = |((session, sighting), error): ((&Session, &Sighting), Vector3<f64>)| Residual {
            error,
            covariance: sighting.covariance_m2,
            from_joints: predictor.seen_from_joints(&session.motion, sighting.time_s),
        };
        let residuals: Vec<Residual> = self.sightings().zip(errors).map(residual).collect();
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
        self.unknowns.len() + self.flaws.len()
    }

    fn bounded(&self, k: usize, z: f64) -> f64 {
        self.unknowns.get(k).map_or(z, |unknown| unknown.bounded(z))
    }

    fn around(&self, k: usize, z: f64) -> [f64; 2] {
        let straight_part = self.unknowns.get(k).is_some_and(|unknown| matches!(unknown.quantity, Quantity::StraightPart(_)));
        let step = if straight_part { STRAIGHT_STEP } else { batch::DIFFERENCE };
        [-step, step].map(|step| self.bounded(k, z + step))
    }

    fn residuals(&self, z: &DVector<f64>) -> Result<Vec<Vector3<f64>>> {
        let predictor = Predictor::new(&self.robot(z))?;
        let errors = self.errors(&predictor, &self.lag(&predictor, z), z);
        Ok(errors.into_iter().zip(&self.whiten).map(|(error, whiten)| whiten * error).collect())
    }

    fn jacobian(&self, z: &DVector<f64>, columns: &[usize]) -> Result<Jacobian> {
        self.derivatives(z, columns, &self.whiten)
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
