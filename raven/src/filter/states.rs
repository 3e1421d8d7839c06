//! State equations for the joint filter: the paper's six states, and nine with a slow transmission bias per joint.
//!
//! The motor angle is an input. With six states the stiff cables slave the joints to the motors and the camera is hardly used; a bias
//! that may wander lets the filter doubt the transmission, and the camera then says by how much.

use std::borrow::Cow;

use nalgebra::{SMatrix, SVector, Vector3};

use super::wander::travel;
use super::{TipAt, Wander, likeliest_wander};
use crate::robot::{Arm, LinkModel, LinkState, MotorTrack};

/// A state equation with `N` states driven by motor angles.
pub trait StateEquation<const N: usize> {
    /// State after `step_s`, the motors moving steadily from `motor` [rad] at `motor_rate` [rad/s].
    fn transition(&self, state: &SVector<f64, N>, motor: &Vector3<f64>, motor_rate: &Vector3<f64>, step_s: f64) -> SVector<f64, N>;

    /// Factor of the process noise that gathers in `step_s` while the motors turn by `turned` [rad], to and fro all counted.
    fn noise_factor(&self, step_s: f64, turned: &Vector3<f64>) -> SMatrix<f64, N, N>;

    /// Motor angles that drive [`Self::transition`], sample by sample those of `motor`.
    fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        Cow::Borrowed(motor)
    }

    /// State at rest, as the motors and the cables have it, and the factor of what is not known of it.
    fn initial(&self, motor: &Vector3<f64>) -> (SVector<f64, N>, SMatrix<f64, N, N>);

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

    fn noise_factor(&self, step_s: f64, _turned: &Vector3<f64>) -> SMatrix<f64, 6, 6> {
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

/// `x: 9x1`, the paper's six and a transmission bias per joint [rad, rad, m]: the joint sits where the cables would hold it, plus bias.
#[derive(Debug, Clone)]
pub struct BiasStates {
    /// The six.
    pub paper: PaperStates,
    /// How friction holds.
    pub friction: Friction,
    /// How the bias may wander.
    pub wander: Wander,
    /// What the bias may be at the start [rad, rad, m].
    pub bias_initial: Vector3<f64>,
}

/// How Coulomb friction holds a joint whose motor stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Friction {
    /// It gives way slowly, as friction that fades at low speed does.
    Creeping,
    /// It holds: with the cable's elasticity it makes play.
    Holding,
}

/// Size of bias that such transmissions show: 1 deg, 2 mm.
const BIAS_INITIAL: [f64; 3] = [0.02, 0.02, 2e-3];

impl BiasStates {
    /// With a bias that wanders as `wander` says.
    #[must_use]
    pub fn new(mut arm: Arm, friction: Friction, wander: Wander) -> Self {
        arm.link_friction.iter_mut().for_each(|of_joint| of_joint.held_part = f64::from(u8::from(friction == Friction::Holding)));
        Self { paper: PaperStates::new(LinkModel::new(arm)), friction, wander, bias_initial: Vector3::from(BIAS_INITIAL) }
    }

    /// With the friction and the wander under which the log's own tips are likeliest; where they are too few to say, with friction that
    /// holds and a bias that wanders by as much as it may be at the start over some ten seconds.
    #[must_use]
    pub fn tuned(arm: &Arm, motor: &MotorTrack, tips: &[TipAt]) -> Self {
        let untuned = Wander::over_time(Vector3::from(BIAS_INITIAL) / 10.0_f64.sqrt());
        let of_friction = |friction| {
            let states = Self::new(arm.clone(), friction, untuned);
            let (wander, unlikeliness) = likeliest_wander(&states.paper.model, motor, &states.driving(motor), tips, &states.bias_initial)?;
            Some((unlikeliness, Self { wander, ..states }))
        };
        let likelier = [Friction::Holding, Friction::Creeping].into_iter().filter_map(of_friction).min_by(|a, b| a.0.total_cmp(&b.0));
        likelier.map_or_else(|| Self::new(arm.clone(), Friction::Holding, untuned), |(_, states)| states)
    }
}

impl StateEquation<9> for BiasStates {
    fn transition(&self, state: &SVector<f64, 9>, motor: &Vector3<f64>, motor_rate: &Vector3<f64>, step_s: f64) -> SVector<f64, 9> {
        let bias: Vector3<f64> = state.fixed_rows::<3>(6).into();
        let unbiased: Vector3<f64> = state.fixed_rows::<3>(0) - bias;
        let links = LinkState::new(unbiased, state.fixed_rows::<3>(3).into());
        let links = self.paper.model.advance(links, motor, motor_rate, step_s);
        let mut next = *state;
        next.fixed_rows_mut::<3>(0).copy_from(&(links.position + bias));
        next.fixed_rows_mut::<3>(3).copy_from(&links.rate);
        next
    }

    fn driving<'a>(&self, motor: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        self.paper.driving(motor)
    }

    fn noise_factor(&self, step_s: f64, turned: &Vector3<f64>) -> SMatrix<f64, 9, 9> {
        let mut factor = SMatrix::<f64, 9, 9>::zeros();
        factor.fixed_view_mut::<6, 6>(0, 0).copy_from(&self.paper.noise_factor(step_s, turned));
        let variance = self.wander.variance(step_s, &travel(&self.paper.model.arm().transmission, turned));
        for j in 0..3 {
            // A bias that moves carries the joint with it.
            let wander = variance[j].sqrt();
            factor[(6 + j, 6 + j)] = wander;
            factor[(j, 6 + j)] = wander;
        }
        factor
    }

    fn initial(&self, motor: &Vector3<f64>) -> (SVector<f64, 9>, SMatrix<f64, 9, 9>) {
        let (mean6, factor6) = self.paper.initial(motor);
        let mut mean = SVector::<f64, 9>::zeros();
        mean.fixed_rows_mut::<6>(0).copy_from(&mean6);
        // Lower-triangular factor with joint = cable + bias: order the bias's column first and let it reach both rows.
        let mut joint = SMatrix::<f64, 9, 9>::zeros();
        joint.fixed_view_mut::<6, 6>(0, 0).copy_from(&(factor6 * factor6.transpose()));
        for j in 0..3 {
            let variance = self.bias_initial[j].powi(2);
            joint[(j, j)] += variance;
            joint[(j, 6 + j)] = variance;
            joint[(6 + j, j)] = variance;
            joint[(6 + j, 6 + j)] = variance;
        }
        // Positive definite by construction: a sum of two positive parts, the second reaching the bias rows.
        let factor = joint.cholesky().map_or_else(SMatrix::identity, |c| c.l());
        (mean, factor)
    }
}
