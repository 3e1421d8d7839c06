//! The registration for cameras and kinematics as their files have them, and by how much every tip may then be off alike.
//!
//! ```text
//! e(p) = [X 1] (r - r_true) + D(p) f_true,   D(p) = [X 1] B + rest(p)
//! ```
//!
//! with the registration `r`, what stands between joints and seen tips beside it `f`, and how that moves tips `D`: what cameras have wrong alike, link
//! angles, the tool's length. An estimate finds `r` and `f` together, often one in the other's place. Whoever uses the registration has cameras and
//! kinematics without `f`; for them it is
//!
//! ```text
//! r_found - B f_found,   which leaves  e(p) = [X 1] (dr - B df) + rest(p) f_true
//! ```
//!
//! of errors `dr`, `df`. `B` are the poses that move the sighted tips most nearly as the flaws do; the mean square of the rest counts as a translation.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Matrix6, Vector6};
use raven::observation::moved_by_pose;
use raven::robot::Arm;

use crate::batch::Estimate;
use crate::identified::Finding;
use crate::parameters::Quantity;
use crate::priors::Unknown;
use crate::problem::Flaw;
use crate::session::{Session, Sighting};

/// A registration that stands for flaws, too.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// What it takes on of them: `-B f_found` [rad, m].
    pub taken_on: Vector6<f64>,
    /// Covariance of rotation about the tip at the hard stop and translation [rad^2, rad m, m^2].
    pub covariance: Matrix6<f64>,
}

impl Registration {
    /// After an estimate of `unknowns`, among whose further ones are `flaws`, each with its place there. `None` where not all of the registration was
    /// estimated, or too few sightings tell its parts apart.
    #[must_use]
    pub fn of(arm: &Arm, unknowns: &[Unknown], flaws: &[(usize, &Flaw)], sessions: &[Session], estimate: &Estimate) -> Option<Self> {
        let place = |number: Quantity| unknowns.iter().position(|unknown| unknown.quantity == number);
        let of_registration: Vec<usize> = numbers().map(place).collect::<Option<_>>()?;
        let pivot_m = arm.kinematics.forward(&arm.hard_stop);
        let sightings: Vec<&Sighting> = sessions.iter().flat_map(|session| &session.sightings).collect();
        let by_pose: Vec<_> = sightings.iter().map(|sighting| moved_by_pose(&(sighting.position_m - pivot_m))).collect();
        let normal = by_pose.iter().map(|slope| slope.tr_mul(slope)).sum::<Matrix6<f64>>().cholesky()?;
        let as_pose = |flaw: &Flaw| normal.solve(&by_pose.iter().zip(flaw).map(|(slope, moved)| slope.tr_mul(moved)).sum::<Vector6<f64>>());
        let poses: Vec<Vector6<f64>> = flaws.iter().map(|(_, flaw)| as_pose(flaw)).collect();
        let taken_on = poses.iter().zip(flaws).map(|(pose, &(place, _))| -pose * estimate.z[place]).sum();

        let places: Vec<usize> = of_registration.iter().copied().chain(flaws.iter().map(|&(place, _)| place)).collect();
        let errors = estimate.covariance.select_rows(&places).select_columns(&places);
        let mut to_pose = DMatrix::zeros(6, places.len());
        for (row, &place) in of_registration.iter().enumerate() {
            to_pose[(row, row)] = unknowns[place].prior_std();
        }
        poses.iter().enumerate().for_each(|(k, pose)| to_pose.column_mut(6 + k).copy_from(&-pose));
        let as_one = &to_pose * &errors * to_pose.transpose();

        let of_flaws = flaws.len();
        let found = estimate.z.select_rows(&places[6..]);
        let between_flaws = errors.view((6, 6), (of_flaws, of_flaws)) + &found * found.transpose();
        let rest_of = |i: usize| {
            let rests = flaws.iter().zip(&poses).flat_map(|((_, flaw), pose)| <[f64; 3]>::from(flaw[i] - by_pose[i] * pose));
            let rests = Matrix3xX::from_iterator(of_flaws, rests);
            &rests * &between_flaws * rests.transpose()
        };
        let rest = (0..sightings.len()).map(rest_of).sum::<Matrix3<f64>>() / sightings.len() as f64;
        let mut covariance = Matrix6::from_fn(|a, b| as_one[(a, b)]);
        let mut of_translation = covariance.fixed_view_mut::<3, 3>(3, 3);
        of_translation += rest;
        Some(Self { taken_on, covariance })
    }

    /// Findings about the registration as it is with what it takes on.
    pub fn apply(&self, findings: &mut [Finding]) {
        for (k, number) in numbers().enumerate() {
            for finding in findings.iter_mut().filter(|finding| finding.unknown.quantity == number) {
                finding.value += self.taken_on[k];
                finding.std = self.covariance[(k, k)].sqrt();
            }
        }
    }
}

/// Those of a registration, in the order of a pose's.
fn numbers() -> impl Iterator<Item = Quantity> {
    (0..3).map(Quantity::Rotation).chain((0..3).map(Quantity::Translation))
}
