//! Cross-validation: what a calibration without some boards says about them.
//!
//! The boards are sorted by their distance and dealt out to up to ten folds, so that each fold has near and far ones and the order of the
//! pictures does not matter. The cameras are solved for without each fold in turn; the boards left out are then placed before these cameras.
//! How far the depth of a point scatters over the folds is a second opinion on its standard deviation (delete-a-group jackknife):
//!
//! ```text
//! var = (k - 1) / k  sum_i (z_i - mean z)^2
//! ```

use nalgebra::{Matrix2, Vector3};
use rayon::prelude::*;

use crate::bundle::{self, Free};
use crate::calibration::{Calibration, residuals, rms};
use crate::linear::{Rig, View};
use crate::uncertainty::cameras_of;

/// Outcome of a cross-validation.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Folds {
    /// How many times a part of the boards was left out.
    pub folds: usize,
    /// Reprojection RMS of boards left out [px].
    pub left_out_rms_px: f64,
    /// Standard deviation of the depth of a point, from its scatter over the folds [m].
    pub depth_std_m: f64,
}

const MOST_FOLDS: usize = 10;
/// Fewer boards leave too little when some are left out.
const FEWEST_BOARDS: usize = 5;

/// Why there is no cross-validation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unvalidated {
    /// Too few boards were seen by both cameras.
    FewBoards,
    /// The point whose depth is asked for is behind a camera.
    Behind,
    /// The other boards do not determine the cameras without those of these shots, or do not place these.
    Open(Vec<usize>),
}

/// Cross-validates. The depth is that of what both cameras see where `point_left` is [m].
///
/// # Errors
/// Why it cannot be done.
pub fn cross_validate(calibration: &Calibration, point_left: &Vector3<f64>) -> Result<Folds, Unvalidated> {
    let count = calibration.views.len();
    if calibration.pairs.len() < FEWEST_BOARDS {
        return Err(Unvalidated::FewBoards);
    }
    let mut order: Vec<usize> = (0..count).collect();
    let distance = |i: usize| calibration.rig.boards[i].translation.vector.norm();
    // Pairs first: each fold has some.
    order.sort_by(|&a, &b| (a >= calibration.pairs.len()).cmp(&(b >= calibration.pairs.len())).then(distance(a).total_cmp(&distance(b))));
    let folds = calibration.pairs.len().min(MOST_FOLDS);
    let pixels = cameras_of(&calibration.rig).project(point_left).ok_or(Unvalidated::Behind)?;
    let one = |out: &[usize], kept: &[usize]| -> Option<(f64, f64, f64)> {
        let part = |members: &[usize], rig: &Rig| {
            let views: Vec<View> = members.iter().map(|&i| calibration.views[i].clone()).collect();
            let boards = members.iter().map(|&i| calibration.rig.boards[i]).collect();
            (views, Rig { boards, ..rig.clone() })
        };
        let (views, rig) = part(kept, &calibration.rig);
        let without = bundle::solve(rig, &views, calibration.free, calibration.huber)?.rig;
        let (views, rig) = part(out, &without);
        let placed = bundle::solve(rig, &views, Free { shared: false, ..calibration.free }, calibration.huber)?.rig;
        let residuals: Vec<_> = residuals(&placed, &views).concat().concat();
        let depth = cameras_of(&without).triangulate(&pixels, &[Matrix2::identity(); 2])?.point_left.z;
        Some((rms(&residuals).powi(2) * residuals.len() as f64, residuals.len() as f64, depth))
    };
    let fold = |fold: usize| {
        let (out, kept): (Vec<_>, Vec<_>) = order.iter().enumerate().partition(|(place, _)| place % folds == fold);
        let [out, kept] = [out, kept].map(|members| members.into_iter().map(|(_, &i)| i).collect::<Vec<usize>>());
        one(&out, &kept).ok_or_else(|| Unvalidated::Open(out.iter().map(|&i| calibration.shot_of_view[i]).collect()))
    };
    // Of several folds that fail the first is told, whichever ends first.
    let outcomes = (0..folds).into_par_iter().map(fold).collect::<Vec<_>>().into_iter().collect::<Result<Vec<_>, _>>()?;
    let (squares, corners) = outcomes.iter().fold((0.0, 0.0), |(s, n), o| (s + o.0, n + o.1));
    let mean = outcomes.iter().map(|o| o.2).sum::<f64>() / folds as f64;
    let scatter = outcomes.iter().map(|o| (o.2 - mean).powi(2)).sum::<f64>();
    let depth_std_m = (scatter * (folds - 1) as f64 / folds as f64).sqrt();
    Ok(Folds { folds, left_out_rms_px: (squares / corners).sqrt(), depth_std_m })
}
