//! State equations for the joint filter: the paper's six states, and twelve with a slow transmission bias per joint and what persists of the cameras'
//! errors.
//!
//! The motor angle is an input. With six states the stiff cables slave the joints to the motors and the camera is hardly used; a bias
//! that may wander lets the filter doubt the transmission, and the camera then says by how much. What the [persistent](super::persistence) errors
//! are lets it doubt the camera in turn.

use std::borrow::Cow;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::persistence::TipPath;
use super::tune::{Seen, likeliest_persistence, likeliest_wander};
use super::wander::travel;
use super::{Persistence, TipAt, Wander};
use crate::robot::{Arm, LinkModel, LinkState, MotorTrack};

/// How far motors turned, to and fro all counted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Turned {
    /// As their encoders saw [rad].
    pub seen: Vector3<f64>,
    /// As they drive the transition [rad]: less where friction that holds makes play.
    pub driving: Vector3<f64>,
}

/// A state equation with `N` states driven by motor angles.
pub trait StateEquation<const N: usize> {
    /// State after `step_s`, the motors moving steadily from `motor` [rad] at `motor_rate` [rad/s].
    fn transition(&self, state: &SVector<f64, N>, motor: &Vector3<f64>, motor_rate: &Vector3<f64>, step_s: f64) -> SVector<f64, N>;

    /// Factor of the process noise that gathers in `step_s` while the motors turn by so much.
    fn noise_factor(&self, step_s: f64, turned: &Turned) -> SMatrix<f64, N, N>;

    /// Motor angles that drive [`Self::transition`], sample by sample those of `motor`.
    fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        Cow::Borrowed(motor)
    }

    /// State at rest, as the motors and the cables have it, and the factor of what is not known of it.
    fn initial(&self, motor: &Vector3<f64>) -> (SVector<f64, N>, SMatrix<f64, N, N>);

    /// What of a state the cameras' errors are [m, frame 0], where a sighting claims errors of this factor; the noise apart.
    fn persistent_error(&self, _state: &SVector<f64, N>, _claimed: &Matrix3<f64>) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Deviation of what is new in each sighting, as a part of the deviation that it claims.
    fn new_part(&self) -> f64 {
        1.0
    }

    /// Joint positions [rad, rad, m] of a state.
    fn joints(&self, state: &SVector<f64, N>) -> Vector3<f64> {
        Vector3::new(state[0], state[1], state[2])
    }
}

/// `x: 6x1`, positions [rad, rad, m] and velocities, as in the paper.
#[derive(Debug, Clone)]
pub struct PaperStates {
    /// The links behind their cables.
    pub model: LinkModel,
    /// Spectral density of the acceleration noise, as velocity per root second [rad/s, rad/s, m/s per sqrt(s)].
    pub rate_noise: Vector3<f64>,
}

impl PaperStates {
    /// With the noise that holds for a link shaken by unmodelled friction: 0.02 rad/s and 0.005 m/s per root second.
    #[must_use]
    pub fn new(model: LinkModel) -> Self {
        Self { model, rate_noise: Vector3::new(0.02, 0.02, 0.005) }
    }
}

impl StateEquation<6> for PaperStates {
    fn transition(&self, state: &SVector<f64, 6>, motor: &Vector3<f64>, motor_rate: &Vector3<f64>, step_s: f64) -> SVector<f64, 6> {
        let links = LinkState::new(state.fixed_rows::<3>(0).into(), state.fixed_rows::<3>(3).into());
        let links = self.model.advance(links, motor, motor_rate, step_s);
        let mut next = SVector::<f64, 6>::zeros();
        next.fixed_rows_mut::<3>(0).copy_from(&links.position);
        next.fixed_rows_mut::<3>(3).copy_from(&links.rate);
        next
    }

    fn noise_factor(&self, step_s: f64, _turned: &Turned) -> SMatrix<f64, 6, 6> {
        let mut factor = SMatrix::zeros();
        for j in 0..3 {
            // Velocity noise of spectral density q^2, integrated: the Cholesky factor of q^2 [T^3/3 T^2/2; T^2/2 T].
            let q = self.rate_noise[j] * step_s.sqrt();
            factor[(j, j)] = q * step_s / 3.0_f64.sqrt();
            factor[(j + 3, j)] = q * 3.0_f64.sqrt() / 2.0;
            factor[(j + 3, j + 3)] = q / 2.0;
        }
        factor
    }

    fn initial(&self, motor: &Vector3<f64>) -> (SVector<f64, 6>, SMatrix<f64, 6, 6>) {
        let settled = self.model.settled(motor, &Vector3::zeros());
        let mut mean = SVector::<f64, 6>::zeros();
        mean.fixed_rows_mut::<3>(0).copy_from(&settled);
        let deviations = SVector::<f64, 6>::from([2e-3, 2e-3, 5e-4, 0.02, 0.02, 0.005]);
        (mean, SMatrix::from_diagonal(&deviations))
    }

    fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        self.model.arm().driving(motor)
    }
}

/// Number of states of [`BiasStates`].
pub const BIAS_STATES: usize = 12;

/// `x: 12x1`, the paper's six, a transmission bias per joint [rad, rad, m], by which the joint sits beside where the cables would hold it, and what
/// persists of the cameras' errors, in deviations.
#[derive(Debug, Clone)]
pub struct BiasStates {
    /// The six.
    pub paper: PaperStates,
    /// What the log says.
    pub tuning: Tuning,
    /// What the bias may be at the start [rad, rad, m].
    pub bias_initial: Vector3<f64>,
    path: TipPath,
}

/// What of [`BiasStates`] a log's own tips say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tuning {
    /// How friction holds.
    pub friction: Friction,
    /// How the bias may wander.
    pub wander: Wander,
    /// How the cameras' errors persist.
    pub persistence: Persistence,
}

/// How Coulomb friction holds a joint whose motor stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Friction {
    /// It gives way slowly, as friction that fades at low speed does.
    Creeping,
    /// It holds: with the cable's elasticity it makes play.
    Holding,
}

/// First of the states that are biases, and of those that are the cameras' errors.
const BIAS: usize = 6;
const ERROR: usize = 9;

/// Size of bias that such transmissions show: 1 deg, 2 mm.
const BIAS_INITIAL: [f64; 3] = [0.02, 0.02, 2e-3];

impl BiasStates {
    /// Of an arm.
    #[must_use]
    pub fn new(mut arm: Arm, tuning: Tuning) -> Self {
        let held_part = f64::from(u8::from(tuning.friction == Friction::Holding));
        arm.link_friction.iter_mut().for_each(|of_joint| of_joint.held_part = held_part);
        let path = TipPath::of(&arm);
        Self { paper: PaperStates::new(LinkModel::new(arm)), tuning, bias_initial: Vector3::from(BIAS_INITIAL), path }
    }

    /// With the tuning under which the log's own tips are likeliest; where they are too few to say, with friction that holds, a bias that wanders by
    /// as much as it may be at the start over some ten seconds, and errors that do not persist.
    #[must_use]
    pub fn tuned(arm: &Arm, motor: &MotorTrack, tips: &[TipAt]) -> Self {
        let wander = Wander::over_time(Vector3::from(BIAS_INITIAL) / 10.0_f64.sqrt());
        let untuned = |friction| Self::new(arm.clone(), Tuning { friction, wander, persistence: Persistence::NONE });
        let of_friction = |friction| {
            let states = untuned(friction);
            let seen = Seen::new(&states.paper.model, motor, &states.driving(motor), tips, &states.bias_initial)?;
            let (place, unlikeliness) = likeliest_wander(&seen);
            Some((unlikeliness, seen, place, states))
        };
        let likelier = [Friction::Holding, Friction::Creeping].into_iter().filter_map(of_friction).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, seen, place, states)) = likelier else { return untuned(Friction::Holding) };
        let place = likeliest_persistence(&seen, place);
        Self { tuning: Tuning { wander: place.wander(), persistence: place.persistence(), ..states.tuning }, ..states }
    }
}

impl StateEquation<BIAS_STATES> for BiasStates {
    fn transition(
        &self,
        state: &SVector<f64, BIAS_STATES>,
        motor: &Vector3<f64>,
        motor_rate: &Vector3<f64>,
        step_s: f64,
    ) -> SVector<f64, BIAS_STATES> {
        let bias: Vector3<f64> = state.fixed_rows::<3>(BIAS).into();
        let unbiased: Vector3<f64> = state.fixed_rows::<3>(0) - bias;
        let links = LinkState::new(unbiased, state.fixed_rows::<3>(3).into());
        let links = self.paper.model.advance(links, motor, motor_rate, step_s);
        let mut next = *state;
        next.fixed_rows_mut::<3>(0).copy_from(&(links.position + bias));
        next.fixed_rows_mut::<3>(3).copy_from(&links.rate);
        next.fixed_rows_mut::<3>(ERROR).scale_mut(self.tuning.persistence.kept(self.path.m(&(motor_rate * step_s))));
        next
    }

    fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        self.paper.driving(motor)
    }

    fn persistent_error(&self, state: &SVector<f64, BIAS_STATES>, claimed: &Matrix3<f64>) -> Vector3<f64> {
        claimed * state.fixed_rows::<3>(ERROR) * self.tuning.persistence.new_and_persistent()[1]
    }

    fn new_part(&self) -> f64 {
        self.tuning.persistence.new_and_persistent()[0]
    }

    fn noise_factor(&self, step_s: f64, turned: &Turned) -> SMatrix<f64, BIAS_STATES, BIAS_STATES> {
        let mut factor = SMatrix::<f64, BIAS_STATES, BIAS_STATES>::zeros();
        factor.fixed_view_mut::<6, 6>(0, 0).copy_from(&self.paper.noise_factor(step_s, turned));
        let variance = self.tuning.wander.variance(step_s, &travel(&self.paper.model.arm().transmission, &turned.seen));
        let kept = self.tuning.persistence.kept(self.path.m(&turned.driving));
        for j in 0..3 {
            // A bias that moves carries the joint with it.
            let wander = variance[j].sqrt();
            factor[(BIAS + j, BIAS + j)] = wander;
            factor[(j, BIAS + j)] = wander;
            factor[(ERROR + j, ERROR + j)] = (1.0 - kept * kept).sqrt();
        }
        factor
    }

    fn initial(&self, motor: &Vector3<f64>) -> (SVector<f64, BIAS_STATES>, SMatrix<f64, BIAS_STATES, BIAS_STATES>) {
        let (mean6, factor6) = self.paper.initial(motor);
        let mut mean = SVector::<f64, BIAS_STATES>::zeros();
        mean.fixed_rows_mut::<6>(0).copy_from(&mean6);
        // Lower-triangular factor with joint = cable + bias: order the bias's column first and let it reach both rows.
        let mut covariance = SMatrix::<f64, BIAS_STATES, BIAS_STATES>::zeros();
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(&(factor6 * factor6.transpose()));
        for j in 0..3 {
            let variance = self.bias_initial[j].powi(2);
            covariance[(j, j)] += variance;
            covariance[(j, BIAS + j)] = variance;
            covariance[(BIAS + j, j)] = variance;
            covariance[(BIAS + j, BIAS + j)] = variance;
            covariance[(ERROR + j, ERROR + j)] = 1.0;
        }
        // Positive definite by construction: a sum of positive parts, one reaching the bias rows.
        let factor = covariance.cholesky().map_or_else(SMatrix::identity, |c| c.l());
        (mean, factor)
    }
}
