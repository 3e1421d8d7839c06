//! What an estimate leaves unknown of the registration: by how much every tip may be off alike.
//!
//! ```text
//! e(p) = [X 1] (r - r_true) + D(p) f_true,   D(p) = [X 1] B + rest(p)
//! ```
//!
//! with the registration `r`, what the cameras have wrong `f`, and how that moves tips `D`. Whoever uses the registration takes the tips as the cameras
//! place them, so that what was found of `f` counts as unknown as well. `B` are the poses that move the sighted tips most nearly so; the mean square of
//! the rest counts as a translation.

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};
use raven::observation::moved_by_pose;
use raven::robot::Arm;

use crate::batch::Estimate;
use crate::priors::Unknown;
use crate::problem::Flaw;
use crate::session::{Session, Sighting};

/// Covariance of rotation about the tip at the hard stop and translation [rad^2, rad m, m^2] after an estimate of `unknowns` and, after them, of the
/// cameras' `flaws`; `None` where not all of the registration was estimated, or too few sightings tell its parts apart.
#[must_use]
pub fn left_unknown(arm: &Arm, unknowns: &[Unknown], flaws: &[Flaw], sessions: &[Session], estimate: &Estimate) -> Option<Matrix6<f64>> {
    let keys = ["rotation", "translation"].map(|part| [0, 1, 2].map(|axis| format!("observation.{part}.{axis}"))).concat();
    let places: Vec<usize> = keys.iter().map(|key| unknowns.iter().position(|unknown| unknown.key == *key)).collect::<Option<_>>()?;
    let pivot_m = arm.kinematics.forward(&arm.hard_stop);
    let sightings: Vec<&Sighting> = sessions.iter().flat_map(|session| &session.sightings).collect();
    let by_pose: Vec<_> = sightings.iter().map(|sighting| moved_by_pose(&(sighting.position_m - pivot_m))).collect();
    let normal = by_pose.iter().map(|slope| slope.tr_mul(slope)).sum::<Matrix6<f64>>().cholesky()?;
    let as_pose = |flaw: &Flaw| normal.solve(&by_pose.iter().zip(flaw).map(|(slope, moved)| slope.tr_mul(moved)).sum::<Vector6<f64>>());
    let poses: Vec<Vector6<f64>> = flaws.iter().map(as_pose).collect();

    // Errors of the registration, and what is true of the flaws: what was found less its error.
    let (n, of_flaws) = (unknowns.len(), flaws.len());
    let places: Vec<usize> = places.into_iter().chain(n..n + of_flaws).collect();
    let mut second_moment = estimate.covariance.select_rows(&places).select_columns(&places);
    second_moment.view_mut((0, 6), (6, of_flaws)).neg_mut();
    second_moment.view_mut((6, 0), (of_flaws, 6)).neg_mut();
    let found = estimate.z.rows(n, of_flaws);
    let mut between_flaws = second_moment.view_mut((6, 6), (of_flaws, of_flaws));
    between_flaws += found * found.transpose();

    let mut to_pose = DMatrix::zeros(6, places.len());
    for (row, &place) in places[..6].iter().enumerate() {
        to_pose[(row, row)] = unknowns[place].prior_std();
    }
    poses.iter().enumerate().for_each(|(k, pose)| to_pose.column_mut(6 + k).copy_from(pose));
    let as_one = &to_pose * &second_moment * to_pose.transpose();

    let rest = |i: usize| {
        let of_flaw = |k: usize| -> Vector3<f64> { flaws[k][i] - by_pose[i] * poses[k] };
        let rest = DMatrix::from_fn(3, of_flaws, |axis, k| of_flaw(k)[axis]);
        let square = &rest * second_moment.view((6, 6), (of_flaws, of_flaws)) * rest.transpose();
        Matrix3::from_fn(|a, b| square[(a, b)])
    };
    let rest = (0..sightings.len()).map(rest).sum::<Matrix3<f64>>() / sightings.len() as f64;
    Some(Matrix6::from_fn(|a, b| as_one[(a, b)] + if a >= 3 && b >= 3 { rest[(a - 3, b - 3)] } else { 0.0 }))
}
