//! The dual filter: links and parameters in two square-root UKFs that take turns at every image.
//!
//! ```text
//! states      x- = f(x, w),  then corrected by the sighting
//! parameters  d = G(x, w) + e,   e of covariance  C + J (P_x + u^2) J'
//! ```
//!
//! `G` moves the links through a horizon and says where the cameras see the tip. Over the whole interval between two images, from links
//! that stood where these parameters put them, `G` has the whole slope of what is seen by the parameters, and the estimate is there after
//! seconds. The paper's horizon is one step of integration, by which a changed parameter hardly moves a link: its pulley took 40 s.
//!
//! What is seen is far from linear in the stiffness of a cable that is known to a factor of three. Where such unknowns are looked for, the
//! log is gone through once more, from the prior again, with slopes taken about the first pass's outcome instead of the belief of the
//! moment (posterior linearisation: Garcia-Fernandez, Svensson, Morelande, Sarkka 2015).
//!
//! Source: Haghighipanah et al. 2017, section II-D; Wan, van der Merwe 2001 (the dual form).

use nalgebra::{Const, DMatrix, DVector, Dyn, Matrix3, Matrix3xX, Vector3};
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

/// Time over which the parameters' filter predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Horizon {
    /// From image to image.
    Frame,
    /// The last step of integration, as in the paper.
    Step,
}

/// One step of integration [s].
const STEP_S: f64 = 1e-3;

/// Prior deviation of a logarithm from which on the slopes of one pass are not good enough.
const WIDE_SPREAD: f64 = 0.5;

/// Runs the dual filter over all sessions, the parameters carried from one to the next.
pub fn run(problem: &Problem, horizon: Horizon) -> Result<Run> {
    let first = Dual::over(problem, horizon, Scatter::new(), None)?;
    let wide = problem.unknowns().iter().any(|unknown| unknown.quantity.is_positive() && unknown.spread > WIDE_SPREAD);
    if !wide || horizon == Horizon::Step {
        return Ok(first.done());
    }
    let about = Belief { mean: first.parameters.mean, factor: first.parameters.factor };
    let second = Dual::over(problem, horizon, Scatter::knowing(first.scatter.misfit()), Some(about))?;
    Ok(Run { trace: first.trace, ..second.done() })
}

/// Mean and lower-triangular covariance factor of the parameters.
struct Belief {
    mean: DVector<f64>,
    factor: DMatrix<f64>,
}

struct Dual<'a> {
    problem: &'a Problem<'a>,
    horizon: Horizon,
    parameters: SquareRootUkf<Dyn, 3>,
    /// Where slopes are taken and the links are moved, if not at the belief of the moment.
    about: Option<Belief>,
    scatter: Scatter,
    trace: Trace,
}

/// Where the parameters' prediction starts: image and links there.
type Start = Option<(f64, States)>;

impl<'a> Dual<'a> {
    fn over(problem: &'a Problem<'a>, horizon: Horizon, scatter: Scatter, about: Option<Belief>) -> Result<Self> {
        let n = Residuals::unknowns(problem);
        let parameters = SquareRootUkf::new(DVector::zeros(n), DMatrix::identity(n, n));
        let mut dual = Self { problem, horizon, parameters, about, scatter, trace: Trace::default() };
        for (number, session) in problem.sessions().iter().enumerate() {
            dual.session(number, session)?;
            dual.trace.next_log();
        }
        Ok(dual)
    }

    fn done(self) -> Run {
        let covariance = self.parameters.covariance();
        Run { posterior: Posterior::new(self.parameters.mean, covariance), scatter: self.scatter, trace: self.trace }
    }

    /// The parameters at which the links are moved.
    fn believed(&self) -> &DVector<f64> {
        self.about.as_ref().map_or(&self.parameters.mean, |about| &about.mean)
    }

    fn session(&mut self, number: usize, session: &Session) -> Result<()> {
        let motion = &self.problem.driving(session)?;
        let mut links = Links::new(self.problem, self.believed())?;
        let mut states: Option<(f64, SquareRootUkf<Const<6>, 3>)> = None;
        for sighting in &session.sightings {
            let now = sighting.time_s;
            let (filter, start) = match states.take().filter(|(last, _)| now - last <= FORGOTTEN_S) {
                Some((last, mut filter)) => {
                    let start = self.start(&links, motion, (last, filter.mean), now);
                    let along = |points: &mut [States]| points.par_iter_mut().for_each(|x| *x = links.follow(x, motion, last, now));
                    // The cables take back what noise did earlier than that.
                    filter.predict_batch(along, &links.equation().noise_factor(KNOT_S.min(now - last), &Turned::default()));
                    (filter, start)
                }
                None => (links.at_rest(motion, now), None),
            };
            states = Some((now, filter));
            let Some((_, filter)) = &mut states else { continue };
            if self.correct_parameters(&links, motion, sighting, filter, start, number) {
                links = self.correct_states(links, motion, sighting, filter)?;
            }
            let deviations = self.parameters.factor.row_iter().map(|row| row.norm());
            self.trace.push(now, self.parameters.mean.as_slice(), deviations);
        }
        Ok(())
    }

    fn start(&self, links: &Links, motion: &Motion, (last, before): (f64, States), now: f64) -> Start {
        match self.horizon {
            Horizon::Frame => Some((last, before)),
            Horizon::Step => {
                let step_before = (now - STEP_S).max(last);
                Some((step_before, links.follow(&before, motion, last, step_before)))
            }
        }
    }

    /// Whether the sighting was believed.
    fn correct_parameters(
        &mut self,
        links: &Links,
        motion: &Motion,
        sighting: &Sighting,
        states: &SquareRootUkf<Const<6>, 3>,
        start: Start,
        session: usize,
    ) -> bool {
        let seen_from_joints = links.seen_from_joints(&states.mean);
        let positions = states.covariance().fixed_view::<3, 3>(0, 0).into_owned();
        let of_states = seen_from_joints * positions * seen_from_joints.transpose();
        let Some(noise) = root(&(sighting.covariance_m2 + of_states + self.scatter.covariance_m2(&seen_from_joints))) else { return false };
        let (problem, horizon, now, which) = (self.problem, self.horizon, sighting.time_s, self.trace.sightings());
        let moved = |other: &Links| match start {
            None => other.settled(motion, now),
            Some((from, states)) if horizon == Horizon::Step => other.follow(&states, motion, from, now),
            Some((from, states)) => {
                let where_these_hold_them = states + other.settled(motion, from) - links.settled(motion, from);
                other.follow(&where_these_hold_them, motion, from, now)
            }
        };
        let of_robot = problem.unknowns_of_robot();
        let show = |points: &[DVector<f64>], seen: &mut [Vector3<f64>]| {
            let mean = Links::new(problem, &points[0]).map(|other| moved(&other));
            points.par_iter().zip(seen).for_each(|(z, seen)| {
                let turned_only = z.as_slice()[..of_robot] == points[0].as_slice()[..of_robot];
                let shown = |other: Links, mean: &States| {
                    other.seen_m(&if turned_only { *mean } else { moved(&other) }) + problem.flawed_m(which, z)
                };
                let shown = Links::new(problem, z).ok().zip(mean.as_ref().ok()).map(|(other, mean)| shown(other, mean));
                *seen = shown.unwrap_or_else(|| Vector3::repeat(f64::NAN));
            });
        };
        let innovation = match &self.about {
            None => self.parameters.update_batch(&sighting.position_m, show, &noise, gate()),
            Some(about) => {
                let slope = Slope::new(about, show);
                let Some(noise) = root(&(noise * noise.transpose() + slope.bend_m2)) else { return false };
                self.parameters.update(&sighting.position_m, |z| slope.seen_m + &slope.slope * (z - &about.mean), &noise, gate())
            }
        };
        problem.bound(self.parameters.mean.as_mut_slice());
        self.scatter.take_in(&innovation, seen_from_joints, session, now);
        innovation.accepted
    }

    /// The links' filter after the sighting, and the links at the new parameters.
    fn correct_states(&self, links: Links, motion: &Motion, sighting: &Sighting, states: &mut SquareRootUkf<Const<6>, 3>) -> Result<Links> {
        let renewed = Links::new(self.problem, self.believed())?;
        if self.horizon == Horizon::Frame {
            states.mean += renewed.settled(motion, sighting.time_s) - links.settled(motion, sighting.time_s);
        }
        let of_misfit = self.scatter.covariance_m2(&renewed.seen_from_joints(&states.mean));
        if let Some(noise) = root(&(sighting.covariance_m2 + of_misfit)) {
            let flawed_m = self.problem.flawed_m(self.trace.sightings(), self.believed());
            states.update(&sighting.position_m, |x| renewed.seen_m(x) + flawed_m, &noise, gate());
        }
        Ok(renewed)
    }
}

/// What is seen as a linear function of the parameters about a belief, by statistical linear regression.
struct Slope {
    /// At the belief's mean [m].
    seen_m: Vector3<f64>,
    /// 3xP [m].
    slope: Matrix3xX<f64>,
    /// Covariance of what is not linear over the belief [m^2].
    bend_m2: Matrix3<f64>,
}

impl Slope {
    fn new(about: &Belief, show: impl FnOnce(&[DVector<f64>], &mut [Vector3<f64>])) -> Self {
        let n = about.mean.len();
        let spread = (n as f64).sqrt();
        let mut points = vec![about.mean.clone(); 2 * n + 1];
        for k in 0..n {
            points[1 + k] += about.factor.column(k) * spread;
            points[1 + n + k] -= about.factor.column(k) * spread;
        }
        let mut seen = vec![Vector3::zeros(); 2 * n + 1];
        show(&points, &mut seen);
        let mean = seen[1..].iter().sum::<Vector3<f64>>() / (2 * n) as f64;
        let along = Matrix3xX::from_fn(n, |row, k| (seen[1 + k][row] - seen[1 + n + k][row]) / (2.0 * spread));
        // The factor of a filter whose prior was 1 and which never gained noise has a positive diagonal.
        let slope = about
            .factor
            .transpose()
            .solve_upper_triangular(&along.transpose())
            .map_or_else(|| Matrix3xX::zeros(n), |slope| slope.transpose());
        let off = |i: usize| seen[i] - mean - &slope * (&points[i] - &about.mean);
        let bend_m2 = (1..=2 * n).map(|i| off(i) * off(i).transpose()).sum::<Matrix3<f64>>() / (2 * n) as f64;
        Self { seen_m: mean, slope, bend_m2 }
    }
}
