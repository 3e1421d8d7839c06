//! The joint filter: links and parameters in one square-root UKF, `[q, qd, z]`.
//!
//! Every sigma point moves by its own parameters from image to image, so the correlation of links and parameters is carried along and
//! nothing has to be assumed of the slope. It costs a motion of the links per state and parameter.

use nalgebra::{DMatrix, DVector, Dyn, Vector3};
use raven::Result;
use raven::filter::{KNOT_S, SquareRootUkf, StateEquation, Turned};
use rayon::prelude::*;

use super::links::{Links, States};
use super::posterior::Posterior;
use super::scatter::Scatter;
use super::trace::Trace;
use super::{FORGOTTEN_S, Run, gate, root};
use crate::batch::Residuals;
use crate::motion::Motion;
use crate::problem::Problem;
use crate::session::{Session, Sighting};

/// Positions and velocities of the links, before the parameters in the state.
const STATES: usize = 6;

/// Runs the joint filter over all sessions, the parameters carried from one to the next.
pub fn run(problem: &Problem) -> Result<Run> {
    let n = STATES + Residuals::unknowns(problem);
    let mut joint = Joint {
        problem,
        filter: SquareRootUkf::new(DVector::zeros(n), DMatrix::identity(n, n)),
        scatter: Scatter::new(),
        trace: Trace::default(),
    };
    for (number, session) in problem.sessions().iter().enumerate() {
        joint.session(number, session)?;
        joint.trace.next_log();
    }
    let covariance = joint.filter.covariance().view_range(STATES.., STATES..).into_owned();
    Ok(Run { posterior: Posterior::new(parameters(&joint.filter.mean), covariance), scatter: joint.scatter, trace: joint.trace })
}

struct Joint<'a> {
    problem: &'a Problem<'a>,
    filter: SquareRootUkf<Dyn, 3>,
    scatter: Scatter,
    trace: Trace,
}

impl Joint<'_> {
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
            let deviations = self.filter.factor.row_iter().skip(STATES).map(|row| row.norm());
            self.trace.push(now, &self.filter.mean.as_slice()[STATES..], deviations);
        }
        Ok(())
    }

    /// Links at rest where each point's parameters hold them, give or take what is not known of that; the parameters stay as they are.
    fn begin(&mut self, motion: &Motion, now: f64) -> Result<()> {
        let about = Links::new(self.problem, &parameters(&self.filter.mean))?.at_rest(motion, now);
        // The factor of the parameters alone: R' of the QR decomposition of their rows.
        let of_parameters = self.filter.factor.rows_range(STATES..).transpose().qr().r().transpose();
        let n = self.filter.mean.len();
        let mut factor = DMatrix::zeros(n, n);
        factor.view_range_mut(..STATES, ..STATES).copy_from(&about.factor);
        factor.view_range_mut(STATES.., STATES..).copy_from(&of_parameters);
        let mut mean = self.filter.mean.clone();
        mean.fixed_rows_mut::<STATES>(0).fill(0.0);
        self.filter = SquareRootUkf::new(mean, factor);
        self.advance(|links, about| links.settled(motion, now) + about, &DMatrix::zeros(n, n));
        Ok(())
    }

    fn follow(&mut self, motion: &Motion, last: f64, now: f64) -> Result<()> {
        let links = Links::new(self.problem, &parameters(&self.filter.mean))?;
        let n = self.filter.mean.len();
        let mut noise = DMatrix::zeros(n, n);
        // The cables take back what noise did earlier than that.
        noise.view_range_mut(..STATES, ..STATES).copy_from(&links.equation().noise_factor(KNOT_S.min(now - last), &Turned::default()));
        self.advance(|links, states| links.follow(states, motion, last, now), &noise);
        Ok(())
    }

    /// Moves the links of every sigma point by its own parameters; points that differ in the registration only move alike.
    fn advance(&mut self, along: impl Fn(&Links, &States) -> States + Sync, noise: &DMatrix<f64>) {
        let (problem, of_robot) = (self.problem, STATES + self.problem.unknowns_of_robot());
        let carry = |points: &mut [DVector<f64>]| {
            let Some((mean, others)) = points.split_first_mut() else { return };
            let moved = |point: &DVector<f64>| {
                let links = Links::new(problem, &parameters(point));
                links.map_or_else(|_| States::repeat(f64::NAN), |links| along(&links, &point.fixed_rows::<STATES>(0).into()))
            };
            let (before, of_mean) = (mean.clone(), moved(mean));
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
        let links = Links::new(self.problem, &parameters(&self.filter.mean))?;
        let seen_from_joints = links.seen_from_joints(&self.filter.mean.fixed_rows::<STATES>(0).into());
        let Some(noise) = root(&(sighting.covariance_m2 + self.scatter.covariance_m2(&seen_from_joints))) else { return Ok(()) };
        let (problem, which) = (self.problem, self.trace.sightings());
        let show = |point: &DVector<f64>| {
            let z = parameters(point);
            let seen_m = |links: Links| links.seen_m(&point.fixed_rows::<STATES>(0).into()) + problem.flawed_m(which, &z);
            Links::new(problem, &z).map_or_else(|_| Vector3::repeat(f64::NAN), seen_m)
        };
        let innovation = self.filter.update(&sighting.position_m, show, &noise, gate());
        problem.bound(&mut self.filter.mean.as_mut_slice()[STATES..]);
        self.scatter.take_in(&innovation, seen_from_joints, session, sighting.time_s);
        Ok(())
    }
}

/// What follows the links' states in the state.
fn parameters(state: &DVector<f64>) -> DVector<f64> {
    state.rows_range(STATES..).into_owned()
}
