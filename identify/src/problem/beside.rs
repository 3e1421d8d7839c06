//! What is unknown beside the numbers that are asked about, and moves many sightings alike: flaws.

use std::sync::Arc;

use nalgebra::{DVector, Vector3};
use raven::Result;
use raven::robot::Robot;

use super::Problem;
use crate::batch::{Estimate, Residuals};
use crate::prediction::Predictor;
use crate::priors::Unknown;
use crate::session::Session;
use crate::systematic::{self, Systematic};
use crate::tolerances::{self, Links, Tolerances};

/// Per sighting of all sessions, how far one prior deviation of a flaw moves where the tip is seen, frame 0 [m].
pub type Flaw = Vec<Vector3<f64>>;

/// What makes the flaws of a problem, in their order.
#[derive(Debug, Clone, Default)]
pub(super) struct Beside {
    given: Vec<Flaw>,
    systematic: Systematic,
    left: Tolerances,
    tolerances: Tolerances,
}

impl Beside {
    /// What the motion before so many recordings left, of a robot with unknowns.
    pub(super) fn left(robot: &Robot, unknowns: &[Unknown], recordings: usize) -> Self {
        Self { left: Tolerances::left(robot, unknowns, recordings), ..Self::default() }
    }

    /// The flaws near a robot.
    ///
    /// They are those of where the tip should be seen. Where it was seen a flaw errs as the sighting does, which makes a scale of noise: of `x + e` the
    /// part `s` is `s (x + e)`, and the more of `e` is in it the better it fits.
    pub(super) fn flaws(&self, robot: &Robot, sessions: &[Session], links: Links) -> Result<Vec<Flaw>> {
        let of_cameras = if self.systematic.len() > 0 {
            let predictor = Predictor::new(robot)?;
            let seen_m: Vec<Vec<Vector3<f64>>> = sessions.iter().map(|session| predictor.session_m(session, None)).collect();
            self.systematic.flaws(&seen_m)
        } else {
            Vec::new()
        };
        let [left, tolerances] = [&self.left, &self.tolerances].map(|numbers| numbers.flaws(robot, sessions, links));
        Ok([self.given.clone(), of_cameras, left?, tolerances?].concat())
    }
}

impl Problem<'_> {
    /// With flaws that are given, as further unknowns after those of the robot and in units of their prior deviation.
    #[must_use]
    pub fn with_flaws(mut self, flaws: Vec<Flaw>) -> Self {
        self.flaws.splice(0..self.beside.given.len(), flaws.clone());
        self.beside.given = flaws;
        self
    }

    /// With what the cameras of the sessions have wrong alike in all images.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn with_systematic(mut self, systematic: Systematic) -> Result<Self> {
        self.beside.systematic = systematic;
        self.flaws = self.beside.flaws(&self.anchored, self.sessions, Links::AtRest)?;
        Ok(self)
    }

    /// With the numbers of the file that nobody asked for off within their tolerances.
    ///
    /// # Errors
    /// If the robot is no arm, or a tolerance is one that no such hardware has.
    pub fn with_tolerances(self) -> Result<Self> {
        let (tolerances, flaws) = Tolerances::of(&self.anchored, self.unknowns, self.sessions)?;
        let mut problem = self.with_more_unknowns(tolerances);
        problem.flaws.extend(flaws);
        Ok(problem)
    }

    /// With the tolerances of another problem, of the same robot, unknowns and sessions; flaws are taken at `z`.
    ///
    /// # Errors
    /// If a number of the file cannot be what its tolerance allows.
    pub(crate) fn with_tolerances_of(self, other: &Self, z: &DVector<f64>) -> Result<Self> {
        let mut problem = self.with_more_unknowns(other.beside.tolerances.clone());
        problem.look_from(z)?;
        Ok(problem)
    }

    fn with_more_unknowns(mut self, tolerances: Tolerances) -> Self {
        self.flaws.truncate(self.flaws.len() - self.tolerances());
        self.beside.tolerances = tolerances;
        // What was rolled out belongs to fewer unknowns, and to whom this is a copy of.
        self.rolled = Arc::default();
        self
    }

    /// How many numbers are off within their tolerances: the last unknowns.
    #[must_use]
    pub fn tolerances(&self) -> usize {
        self.beside.tolerances.len()
    }

    /// Takes flaws where the unknowns are: a tip that a radius moves by degrees is moved another way by the rest.
    ///
    /// # Errors
    /// If a number of the file cannot be what its tolerance allows.
    pub(crate) fn look_from(&mut self, z: &DVector<f64>) -> Result<()> {
        self.flaws = self.beside.flaws(&self.robot(z), self.sessions, Links::Rolling)?;
        Ok(())
    }

    /// Whether flaws depend on where the unknowns are.
    pub(crate) fn is_beside(&self) -> bool {
        self.flaws.len() > self.beside.given.len()
    }

    /// The flaws between joints and seen tips, those of cameras and of kinematics, each with its place among all unknowns.
    #[must_use]
    pub fn flaws_of_sight(&self) -> Vec<(usize, &Flaw)> {
        let first = self.beside.given.len();
        let left = self.beside.systematic.len() + first;
        let kinematics = self.beside.tolerances.of_kinematics().map(|k| left + self.beside.left.len() + k);
        (first..left).chain(kinematics).map(|k| (self.unknowns.len() + k, &self.flaws[k])).collect()
    }

    /// What an estimate says of the cameras beside their registration; nothing where no session says which cameras placed its tips.
    #[must_use]
    pub fn cameras_found(&self, estimate: &Estimate) -> Option<systematic::Found> {
        self.beside.systematic.found(estimate, self.unknowns.len() + self.beside.given.len())
    }

    /// What an estimate says of what the motion before each recording left.
    #[must_use]
    pub fn left_found(&self, estimate: &Estimate) -> Vec<tolerances::Found> {
        self.beside.left.found(estimate, Residuals::unknowns(self) - self.tolerances() - self.beside.left.len())
    }

    /// What an estimate says of the file's numbers that nobody asked for.
    #[must_use]
    pub fn tolerances_found(&self, estimate: &Estimate) -> Vec<tolerances::Found> {
        self.beside.tolerances.found(estimate, Residuals::unknowns(self) - self.tolerances())
    }

    /// How far flaws move where the tip is seen, at one of the sightings of all recordings [m].
    pub(crate) fn flawed_m(&self, sighting: usize, z: &DVector<f64>) -> Vector3<f64> {
        self.flaws.iter().zip(z.iter().skip(self.unknowns.len())).map(|(flaw, &z)| flaw[sighting] * z).sum()
    }

    /// The flaw that is an unknown; `None` of the robot's. Predictions go straight by it.
    pub(super) fn flaw(&self, k: usize) -> Option<&Flaw> {
        self.flaws.get(k.checked_sub(self.unknowns.len())?)
    }
}
