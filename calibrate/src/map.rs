//! How well a calibration knows where things are, over the image.
//!
//! A point stands still among the boards. What moves with the shared parameters `theta` is where a camera sees it: its own numbers change,
//! and so do the boards' poses, which follow by their normal equations. With `delta_b = -C_b^-1 B_b' dtheta` the motion of board `b` in the
//! left camera's frame, and `p` the point in it (as mrcal's projection uncertainty, with its mean over the boards' frames):
//!
//! ```text
//! dq = (dq/dtheta) dtheta + (dq/dp) mean_b (delta_b applied to p),    cov(q) = J cov(theta) J'
//! ```
//!
//! A camera whose principal point and attitude are wrong together therefore counts as right, as far as the boards cannot tell it from one
//! that is.

use nalgebra::{Matrix2, SMatrix, Vector2, Vector3};

use crate::calibration::Calibration;
use crate::linear::{Block, CAMERA, PAIR, SHARED, intrinsic_slope};
use crate::uncertainty::{cameras_of, point_covariance};

/// A value per cell of an image, row by row; `None` where it is not known.
#[derive(Debug, Clone)]
pub struct Map {
    /// Cells across and down.
    pub cells: (usize, usize),
    /// Values.
    pub values: Vec<Option<f64>>,
}

/// Cells of a map across; as many down as make them about square.
const ACROSS: usize = 20;

impl Map {
    /// `of` the middle of each cell of a camera's image.
    fn over(width: u32, height: u32, of: impl Fn(&Vector2<f64>) -> Option<f64>) -> Self {
        let down = ((ACROSS as f64 * f64::from(height) / f64::from(width)).round() as usize).max(1);
        let middle = |i: usize, cells: usize, size: u32| (i as f64 + 0.5) / cells as f64 * f64::from(size) - 0.5;
        let value = |k: usize| of(&Vector2::new(middle(k % ACROSS, ACROSS, width), middle(k / ACROSS, down, height)));
        Self { cells: (ACROSS, down), values: (0..ACROSS * down).map(value).collect() }
    }

    /// Median of the known values.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        raven::stats::median(&self.values.iter().flatten().copied().collect::<Vec<_>>())
    }

    /// Smallest and largest of the known values.
    #[must_use]
    pub fn range(&self) -> Option<(f64, f64)> {
        let known = || self.values.iter().flatten().copied();
        known().next()?;
        Some((known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max)))
    }
}

/// Standard deviation, along its worst direction, of where a camera sees points at this distance [px].
#[must_use]
pub fn projection_px(calibration: &Calibration, camera: usize, distance_m: f64) -> Map {
    let pinhole = &calibration.rig.cameras[camera];
    let responses = responses(calibration, camera);
    Map::over(pinhole.width, pinhole.height, |pixel| {
        let covariance = projection_covariance(calibration, &responses, camera, pixel, distance_m)?;
        Some(covariance.symmetric_eigenvalues().max().max(0.0).sqrt())
    })
}

/// Standard deviation of the depth of points at this distance, by where the left camera sees them, from the calibration alone [m].
/// Points that the right camera does not see have none.
#[must_use]
pub fn depth_m(calibration: &Calibration, distance_m: f64) -> Map {
    let (left, cameras) = (&calibration.rig.cameras[0], cameras_of(&calibration.rig));
    Map::over(left.width, left.height, |pixel| {
        let point = left.undistort(pixel)?.push(1.0) * distance_m;
        let seen = cameras.project(&point)?;
        cameras.right.contains(&seen[1], 0.0).then_some(())?;
        let covariance = point_covariance(&calibration.rig, &calibration.deviations.as_ref()?.covariance, &point)?;
        Some(covariance[(2, 2)].sqrt())
    })
}

/// Where a board's frame goes with the shared parameters.
pub struct Response {
    /// Origin of the board in the left camera's frame [m].
    origin: Vector3<f64>,
    /// `-C^-1 B'`: rotation about that origin and shift, 6x26.
    slope: SMatrix<f64, 6, SHARED>,
}

/// Of every board that a camera saw.
#[must_use]
pub fn responses(calibration: &Calibration, camera: usize) -> Vec<Response> {
    let boards = calibration.rig.boards.iter().zip(&calibration.blocks).zip(&calibration.views);
    let seen = boards.filter(|(_, view)| !view[camera].is_empty()).map(|(board, _)| board);
    let slope = |block: &Block| Some(-block.pose_pose.cholesky()?.solve(&block.shared_pose.transpose()));
    seen.filter_map(|(pose, block)| Some(Response { origin: pose.translation.vector, slope: slope(block)? })).collect()
}

/// Covariance of where a camera sees what it sees at `pixel`, at this distance along its axis [px^2].
#[must_use]
pub fn projection_covariance(
    calibration: &Calibration,
    responses: &[Response],
    camera: usize,
    pixel: &Vector2<f64>,
    distance_m: f64,
) -> Option<Matrix2<f64>> {
    let covariance = calibration.deviations.as_ref()?.covariance;
    let rig = &calibration.rig;
    let point = rig.cameras[camera].undistort(pixel)?.push(1.0) * distance_m;
    let (seen, by_point) = rig.cameras[camera].project_with_slope(&point)?;
    let in_left = if camera == 0 { point } else { rig.right_from_left.inverse_transform_point(&point.into()).coords };
    let mut moved = SMatrix::<f64, 3, SHARED>::zeros();
    for response in responses {
        let arm = in_left - response.origin;
        let (turn, shift) = (response.slope.fixed_rows::<3>(0), response.slope.fixed_rows::<3>(3));
        moved += (shift - arm.cross_matrix() * turn) / responses.len() as f64;
    }
    if camera == 1 {
        let rotation = rig.right_from_left.rotation.to_rotation_matrix();
        let carried = rotation * in_left;
        moved = rotation * moved;
        let mut turn = moved.fixed_columns_mut::<3>(PAIR);
        turn -= carried.cross_matrix();
        let mut shift = moved.fixed_columns_mut::<3>(PAIR + 3);
        shift += SMatrix::<f64, 3, 3>::identity();
    }
    let mut slope = by_point * moved;
    let mut own = slope.fixed_columns_mut::<CAMERA>(CAMERA * camera);
    own += intrinsic_slope(&rig.cameras[camera], &(point.xy() / point.z), &seen);
    // Parameters that were not solved for have no covariance.
    Some(slope * covariance * slope.transpose())
}
