//! What an estimate leaves unknown of the registration: by how much every tip may be off alike.
//!
//! ```text
//! e(p) = [X 1] (r - r_true) + D(p) f_true,   D(p) = [X 1] B + rest(p)
//! ```
//!
//! with the registration `r`, what the cameras have wrong `f`, and how that moves tips `D`. Whoever uses the registration takes the tips as the cameras
//! place them, so that what was found of `f` counts as unknown as well. `B` are the poses that move the sighted tips most nearly so; the mean square of
//! the rest counts as a translation.

use nalgebra::{DMatrix, Matrix3, Matrix3xX, Matrix6, Vector6};
use raven::observation::moved_by_pose;
use raven::robot::Arm;

use crate::batch::Estimate;
use crate::parameters::Quantity;
use crate::priors::Unknown;
use crate::problem::Flaw;
use crate::session::{Session, Sighting};

/// Covariance of rotation about the tip at the hard stop and translation [rad^2, rad m, m^2] after an estimate of `unknowns` and, after them, of the
/// cameras' `flaws`; `None` where not all of the registration was estimated, or too few sightings tell its parts apart.
#[must_use]
pub fn left_unknown(arm: &Arm, unknowns: &[Unknown], flaws: &[Flaw], sessions: &[Session], estimate: &Estimate) -> Option<Matrix6<f64>> {
    let numbers = [[0, 1, 2].map(Quantity::Rotation), [0, 1, 2].map(Quantity::Translation)].concat();
    let place = |number: &Quantity| unknowns.iter().position(|unknown| unknown.quantity == *number);
    let of_registration: Vec<usize> = numbers.iter().map(place).collect::<Option<_>>()?;
    let pivot_m = arm.kinematics.forward(&arm.hard_stop);
    let sightings: Vec<&Sighting> = sessions.iter().flat_map(|session| &session.sightings).collect();
    let by_pose: Vec<_> = sightings.iter().map(|sighting| moved_by_pose(&(sighting.position_m - pivot_m))).collect();
    let normal = by_pose.iter().map(|slope| slope.tr_mul(slope)).sum::<Matrix6<f64>>().cholesky()?;
    let as_pose = |flaw: &Flaw| normal.solve(&by_pose.iter().zip(flaw).map(|(slope, moved)| slope.tr_mul(moved)).sum::<Vector6<f64>>());
    let poses: Vec<Vector6<f64>> = flaws.iter().map(as_pose).collect();

    // Errors of the registration, and what is true of the flaws: what was found less its error.
    let (n, of_flaws) = (unknowns.len(), flaws.len());
    let places: Vec<usize> = of_registration.iter().copied().chain(n..n + of_flaws).collect();
    let mut second_moment = estimate.covariance.select_rows(&places).select_columns(&places);
    second_moment.view_mut((0, 6), (6, of_flaws)).neg_mut();
    second_moment.view_mut((6, 0), (of_flaws, 6)).neg_mut();
    let found = estimate.z.rows(n, of_flaws);
    let mut between_flaws = second_moment.view_mut((6, 6), (of_flaws, of_flaws));
    between_flaws += found * found.transpose();

    let mut to_pose = DMatrix::zeros(6, places.len());
    for (row, &place) in of_registration.iter().enumerate() {
        to_pose[(row, row)] = unknowns[place].prior_std();
    }
    poses.iter().enumerate().for_each(|(k, pose)| to_pose.column_mut(6 + k).copy_from(pose));
    let as_one = &to_pose * &second_moment * to_pose.transpose();

    let between_flaws = second_moment.view((6, 6), (of_flaws, of_flaws));
    let rest_of = |i: usize| {
        let rests = flaws.iter().zip(&poses).flat_map(|(flaw, pose)| <[f64; 3]>::from(flaw[i] - by_pose[i] * pose));
        let rests = Matrix3xX::from_iterator(of_flaws, rests);
        &rests * between_flaws * rests.transpose()
    };
    let rest = (0..sightings.len()).map(rest_of).sum::<Matrix3<f64>>() / sightings.len() as f64;
    let mut covariance = Matrix6::from_fn(|a, b| as_one[(a, b)]);
    let mut of_translation = covariance.fixed_view_mut::<3, 3>(3, 3);
    of_translation += rest;
    Some(covariance)
}
