//! The joint filter: links and parameters in one square-root UKF, `[q, qd, z]`.
//!
//! Every sigma point moves by its own parameters from image to image, so the correlation of links and parameters is carried along and
//! nothing has to be assumed of the slope. It costs a motion of the links per state and parameter.

use nalgebra::{DMatrix, SMatrix, SVector, Vector3};
use raven::Result;
use raven::filter::{KNOT_S, SquareRootUkf, StateEquation};
use rayon::prelude::*;

use super::links::{Links, States};
use super::posterior::Posterior;
use super::scatter::Scatter;
use super::trace::Trace;
use super::{FORGOTTEN_S, Run, gate, root, unbounded};
use crate::motion::Motion;
use crate::problem::Problem;
use crate::session::{Session, Sighting};

/// Positions and velocities of the links, before the parameters in the state.
pub const STATES: usize = 6;

/// Runs the joint filter over all sessions, the parameters carried from one to the next. `N` is `P` and [`STATES`].
pub fn run<const P: usize, const N: usize>(problem: &Problem) -> Result<Run> {
    let mut joint = Joint::<P, N> {
        problem,
        filter: SquareRootUkf::new(SVector::zeros(), SMatrix::identity()),
        scatter: Scatter::new(),
        trace: Trace::default(),
    };
    for (number, session) in problem.sessions().iter().enumerate() {
        joint.session(number, session)?;
        joint.trace.next_log();
    }
    let Joint { filter, scatter, trace, .. } = joint;
    let covariance = DMatrix::from_column_slice(N, N, filter.covariance().as_slice()).view((STATES, STATES), (P, P)).into_owned();
    Ok(Run { posterior: Posterior::new(unbounded(&filter.mean.as_slice()[STATES..]), covariance), scatter, trace })
}

struct Joint<'a, const P: usize, const N: usize> {
    problem: &'a Problem<'a>,
    filter: SquareRootUkf<N, 3>,
    scatter: Scatter,
    trace: Trace,
}

impl<const P: usize, const N: usize> Joint<'_, P, N> {
    fn session(&mut self, number: usize, session: &Session) -> Result<()> {
        let motion = &self.problem.driving(session)?;
        let mut last = None;
        for sighting in &session.sightings {
            let now = sighting.time_s;
            match last.filter(|last| now - last <= FORGOTTEN_S) {
                Some(last) => self.follow(motion, last, now)?,
                None => self.begin(motion, now)?,
            }
            last = Some(now);
            self.correct(sighting, number)?;
            let deviations = (STATES..N).map(|k| self.filter.factor.row(k).norm());
            self.trace.push(now, &self.filter.mean.as_slice()[STATES..], deviations);
        }
        Ok(())
    }

    /// Links at rest where each point's parameters hold them, give or take what is not known of that; the parameters stay as they are.
    fn begin(&mut self, motion: &Motion, now: f64) -> Result<()> {
        let about = Links::new(self.problem, &self.filter.mean.as_slice()[STATES..])?.at_rest(motion, now);
        let parameters = DMatrix::from_column_slice(N, N, self.filter.factor.as_slice()).view((STATES, 0), (P, N)).into_owned();
        // The factor of the parameters alone: R' of the QR decomposition of their rows.
        let parameters = parameters.transpose().qr().r();
        let mut factor = SMatrix::<f64, N, N>::zeros();
        factor.view_mut((0, 0), (STATES, STATES)).copy_from(&about.factor);
        for row in 0..P {
            for column in 0..=row {
                factor[(STATES + row, STATES + column)] = parameters[(column, row)];
            }
        }
        let mut mean = self.filter.mean;
        mean.fixed_rows_mut::<STATES>(0).fill(0.0);
        self.filter = SquareRootUkf::new(mean, factor);
        self.advance(|links, about| links.settled(motion, now) + about, &SMatrix::zeros());
        Ok(())
    }

    fn follow(&mut self, motion: &Motion, last: f64, now: f64) -> Result<()> {
        let links = Links::new(self.problem, &self.filter.mean.as_slice()[STATES..])?;
        let mut noise = SMatrix::<f64, N, N>::zeros();
        // The cables take back what noise did earlier than that.
        noise.view_mut((0, 0), (STATES, STATES)).copy_from(&links.equation().noise_factor(KNOT_S.min(now - last), &Vector3::zeros()));
        self.advance(|links, states| links.follow(states, motion, last, now), &noise);
        Ok(())
    }

    /// Moves the links of every sigma point by its own parameters; points that differ in the registration only move alike.
    fn advance(&mut self, along: impl Fn(&Links, &States) -> States + Sync, noise: &SMatrix<f64, N, N>) {
        let (problem, of_robot) = (self.problem, STATES + self.problem.unknowns_of_robot());
        let carry = |points: &mut [SVector<f64, N>]| {
            let Some((mean, others)) = points.split_first_mut() else { return };
            let moved = |point: &SVector<f64, N>| {
                let links = Links::new(problem, &point.as_slice()[STATES..]);
                links.map_or_else(|_| States::repeat(f64::NAN), |links| along(&links, &point.fixed_rows::<STATES>(0).into()))
            };
            let (before, of_mean) = (*mean, moved(mean));
            mean.fixed_rows_mut::<STATES>(0).copy_from(&of_mean);
            others.par_iter_mut().for_each(|point| {
                let alike = point.as_slice()[..of_robot] == before.as_slice()[..of_robot];
                let states = if alike { of_mean } else { moved(point) };
                point.fixed_rows_mut::<STATES>(0).copy_from(&states);
            });
        };
        self.filter.predict_batch(carry, noise);
    }

    fn correct(&mut self, sighting: &Sighting, session: usize) -> Result<()> {
        let links = Links::new(self.problem, &self.filter.mean.as_slice()[STATES..])?;
        let seen_from_joints = links.seen_from_joints(&self.filter.mean.fixed_rows::<STATES>(0).into());
        let Some(noise) = root(&(sighting.covariance_m2 + self.scatter.covariance_m2(&seen_from_joints))) else { return Ok(()) };
        let problem = self.problem;
        let show = |point: &SVector<f64, N>| {
            let links = Links::new(problem, &point.as_slice()[STATES..]);
            links.map_or_else(|_| Vector3::repeat(f64::NAN), |links| links.seen_m(&point.fixed_rows::<STATES>(0).into()))
        };
        let innovation = self.filter.update(&sighting.position_m, show, &noise, gate());
        problem.bound(&mut self.filter.mean.as_mut_slice()[STATES..]);
        self.scatter.take_in(&innovation, seen_from_joints, session, sighting.time_s);
        Ok(())
    }
}
