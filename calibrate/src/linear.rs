//! Reprojection residuals of one board and their normal equations.
//!
//! A corner `X` of a board is seen at `pi_c(T_c exp(w) P X)`, with `P` the board's pose in the left camera's frame, `T_left = 1` and
//! `T_right = right_from_left`. The 26 numbers that all boards share are, in this order, `fx fy cx cy k1 k2 p1 p2 k3` of the left
//! camera, the same of the right one, a left-multiplied rotation vector and a shift of `right_from_left`, and the board's bow; a board adds
//! six of its own.
//!
//! A bowed board is a paraboloid (as in mrcal): at `x, y` from -1 to 1 across its corners it stands `b1 (1 - x^2) + b2 (1 - y^2)` behind its
//! plane.

use nalgebra::{Isometry3, Matrix2x3, Matrix6, SMatrix, SVector, Vector2, Vector3, Vector6};
use raven::camera::Pinhole;

/// Parameters of one camera.
pub const CAMERA: usize = 9;
/// Place of `right_from_left` among the shared parameters.
pub const PAIR: usize = 2 * CAMERA;
/// Place of the board's bow among the shared parameters.
pub const BOW: usize = PAIR + 6;
/// All shared parameters.
pub const SHARED: usize = BOW + 2;
/// Parameters that one corner depends on: of its camera, the pair, the bow, and its board's pose.
const LOCAL: usize = POSE + 6;
const POSE: usize = CAMERA + 8;

/// A corner of the board and where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// In the frame of a flat board [m].
    pub point: Vector3<f64>,
    /// `1 - x^2, 1 - y^2`: how far each number of the bow moves it.
    pub bow: Vector2<f64>,
    /// In the image [px].
    pub pixel: Vector2<f64>,
}

/// One board at one instant: corners in the left and in the right image, either of which may be empty.
pub type View = [Vec<Corner>; 2];

/// Cameras and boards: everything a calibration solves for.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Left and right.
    pub cameras: [Pinhole; 2],
    /// `x_right = right_from_left x_left`.
    pub right_from_left: Isometry3<f64>,
    /// How far the board's middle stands behind its edges, along x and along y [m].
    pub bow_m: Vector2<f64>,
    /// `x_left = left_from_board x_board`, one per view.
    pub boards: Vec<Isometry3<f64>>,
}

/// Cost, gradient and curvature that one board adds; costs are `sum rho(|residual|^2)` [px^2], gradients and curvatures of half of that.
#[derive(Debug, Clone)]
pub struct Block {
    /// Cost [px^2].
    pub cost: f64,
    /// Gradient with the shared parameters.
    pub shared: SVector<f64, SHARED>,
    /// Gradient with the board's pose.
    pub pose: Vector6<f64>,
    /// Curvature, shared by shared.
    pub shared_shared: SMatrix<f64, SHARED, SHARED>,
    /// Curvature, shared by pose.
    pub shared_pose: SMatrix<f64, SHARED, 6>,
    /// Curvature, pose by pose.
    pub pose_pose: Matrix6<f64>,
}

/// Huber's loss: squares up to a distance, straight beyond it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Huber {
    /// Distance of a residual from which on it is an outlier [px]; infinite for least squares.
    pub threshold_px: f64,
}

impl Huber {
    /// Loss of a squared residual [px^2] and its slope with it.
    #[must_use]
    pub fn loss(self, squared: f64) -> (f64, f64) {
        let distance = squared.sqrt();
        if distance <= self.threshold_px {
            (squared, 1.0)
        } else {
            (self.threshold_px * (2.0 * distance - self.threshold_px), self.threshold_px / distance)
        }
    }
}

impl Rig {
    /// Projected less measured pixel of every corner of a view, by camera; `None` if one is behind its camera.
    #[must_use]
    pub fn residuals(&self, index: usize, view: &View) -> Option<[Vec<Vector2<f64>>; 2]> {
        let board = self.boards.get(index)?;
        let of = |camera: usize| -> Option<Vec<Vector2<f64>>> {
            let pose = if camera == 0 { *board } else { self.right_from_left * board };
            view[camera]
                .iter()
                .map(|c| Some(self.cameras[camera].project(&(pose * nalgebra::Point3::from(self.point(c))).coords)? - c.pixel))
                .collect()
        };
        Some([of(0)?, of(1)?])
    }

    /// A corner in the frame of the bowed board [m].
    fn point(&self, corner: &Corner) -> Vector3<f64> {
        corner.point + Vector3::z() * corner.bow.dot(&self.bow_m)
    }

    /// Robust cost of a view alone [px^2]; infinite if a corner is behind its camera.
    #[must_use]
    pub fn cost(&self, index: usize, view: &View, huber: Huber) -> f64 {
        let sum = |residuals: &Vec<Vector2<f64>>| residuals.iter().map(|r| huber.loss(r.norm_squared()).0).sum::<f64>();
        self.residuals(index, view).map_or(f64::INFINITY, |both| both.iter().map(sum).sum())
    }

    /// Normal equations of a view; `None` if a corner is behind its camera.
    #[must_use]
    pub fn linearise(&self, index: usize, view: &View, huber: Huber) -> Option<Block> {
        let board = self.boards.get(index)?;
        let mut block = Block {
            cost: 0.0,
            shared: SVector::zeros(),
            pose: Vector6::zeros(),
            shared_shared: SMatrix::zeros(),
            shared_pose: SMatrix::zeros(),
            pose_pose: Matrix6::zeros(),
        };
        for (camera, corners) in view.iter().enumerate() {
            let mut curvature = SMatrix::<f64, LOCAL, LOCAL>::zeros();
            let mut gradient = SVector::<f64, LOCAL>::zeros();
            for corner in corners {
                let (residual, slope) = self.corner_slope(camera, board, corner)?;
                let (loss, weight) = huber.loss(residual.norm_squared());
                block.cost += loss;
                gradient += slope.tr_mul(&residual) * weight;
                curvature += slope.tr_mul(&slope) * weight;
                if weight < 1.0 {
                    // Huber's loss is straight along an outlier's residual; a trace of curvature keeps the matrix positive.
                    let along = slope.tr_mul(&residual.normalize());
                    curvature -= along * along.transpose() * (0.99 * weight);
                }
            }
            block.add(camera, &gradient, &curvature);
        }
        Some(block)
    }

    /// Residual of a corner and its slope: camera, pair, bow, board.
    fn corner_slope(&self, camera: usize, board: &Isometry3<f64>, corner: &Corner) -> Option<(Vector2<f64>, SMatrix<f64, 2, LOCAL>)> {
        let turned = board.rotation * self.point(corner);
        let in_left = turned + board.translation.vector;
        let pinhole = &self.cameras[camera];
        let mut slope = SMatrix::<f64, 2, LOCAL>::zeros();
        let (pixel, by_left) = if camera == 0 {
            pinhole.project_with_slope(&in_left)?
        } else {
            let carried = self.right_from_left.rotation * in_left;
            let (pixel, by_right) = pinhole.project_with_slope(&(carried + self.right_from_left.translation.vector))?;
            slope.fixed_view_mut::<2, 3>(0, CAMERA).copy_from(&turn_slope(&by_right, &carried));
            slope.fixed_view_mut::<2, 3>(0, CAMERA + 3).copy_from(&by_right);
            (pixel, by_right * self.right_from_left.rotation.to_rotation_matrix())
        };
        let in_camera = if camera == 0 { in_left } else { (self.right_from_left * nalgebra::Point3::from(in_left)).coords };
        slope.fixed_view_mut::<2, CAMERA>(0, 0).copy_from(&intrinsic_slope(pinhole, &(in_camera.xy() / in_camera.z), &pixel));
        slope.fixed_view_mut::<2, 2>(0, CAMERA + 6).copy_from(&(by_left * (board.rotation * Vector3::z()) * corner.bow.transpose()));
        slope.fixed_view_mut::<2, 3>(0, POSE).copy_from(&turn_slope(&by_left, &turned));
        slope.fixed_view_mut::<2, 3>(0, POSE + 3).copy_from(&by_left);
        Some((pixel - corner.pixel, slope))
    }

    /// The rig after a step of the shared parameters and of each board.
    #[must_use]
    pub fn moved(&self, shared: &SVector<f64, SHARED>, boards: &[Vector6<f64>]) -> Self {
        let camera = |c: usize| {
            let (old, step) = (&self.cameras[c], shared.fixed_rows::<CAMERA>(CAMERA * c));
            let mut distortion = old.distortion;
            distortion.iter_mut().zip(step.iter().skip(4)).for_each(|(k, s)| *k += s);
            Pinhole { fx: old.fx + step[0], fy: old.fy + step[1], cx: old.cx + step[2], cy: old.cy + step[3], distortion, ..*old }
        };
        Self {
            cameras: [camera(0), camera(1)],
            right_from_left: turned(&self.right_from_left, &shared.fixed_rows::<6>(PAIR).into()),
            bow_m: self.bow_m + shared.fixed_rows::<2>(BOW),
            boards: self.boards.iter().zip(boards).map(|(board, step)| turned(board, step)).collect(),
        }
    }
}

impl Block {
    fn add(&mut self, camera: usize, gradient: &SVector<f64, LOCAL>, curvature: &SMatrix<f64, LOCAL, LOCAL>) {
        let at = CAMERA * camera;
        let mut rows = self.shared.fixed_rows_mut::<CAMERA>(at);
        rows += gradient.fixed_rows::<CAMERA>(0);
        let mut rows = self.shared.fixed_rows_mut::<8>(PAIR);
        rows += gradient.fixed_rows::<8>(CAMERA);
        self.pose += gradient.fixed_rows::<6>(POSE);
        let mut part = self.shared_shared.fixed_view_mut::<CAMERA, CAMERA>(at, at);
        part += curvature.fixed_view::<CAMERA, CAMERA>(0, 0);
        let mut part = self.shared_shared.fixed_view_mut::<CAMERA, 8>(at, PAIR);
        part += curvature.fixed_view::<CAMERA, 8>(0, CAMERA);
        let mut part = self.shared_shared.fixed_view_mut::<8, CAMERA>(PAIR, at);
        part += curvature.fixed_view::<8, CAMERA>(CAMERA, 0);
        let mut part = self.shared_shared.fixed_view_mut::<8, 8>(PAIR, PAIR);
        part += curvature.fixed_view::<8, 8>(CAMERA, CAMERA);
        let mut part = self.shared_pose.fixed_view_mut::<CAMERA, 6>(at, 0);
        part += curvature.fixed_view::<CAMERA, 6>(0, POSE);
        let mut part = self.shared_pose.fixed_view_mut::<8, 6>(PAIR, 0);
        part += curvature.fixed_view::<8, 6>(CAMERA, POSE);
        self.pose_pose += curvature.fixed_view::<6, 6>(POSE, POSE);
    }
}

/// `exp(step[0..3]) pose`, shifted by `step[3..6]`; the rotation turns about the pose's own origin.
fn turned(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let turn = nalgebra::UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
    let shift = pose.translation.vector + step.fixed_rows::<3>(3);
    let mut rotation = turn * pose.rotation;
    rotation.renormalize();
    Isometry3::from_parts(shift.into(), rotation)
}

/// Slope of a pixel with a rotation vector that turns `arm`: `slope * d(exp(w) arm)/dw = -slope [arm]x`.
fn turn_slope(slope: &Matrix2x3<f64>, arm: &Vector3<f64>) -> Matrix2x3<f64> {
    -slope * arm.cross_matrix()
}

/// Slope of a pixel with `fx fy cx cy k1 k2 p1 p2 k3` at normalised coordinates, 2x9.
#[must_use]
pub fn intrinsic_slope(camera: &Pinhole, normal: &Vector2<f64>, pixel: &Vector2<f64>) -> SMatrix<f64, 2, CAMERA> {
    let (x, y) = (normal.x, normal.y);
    let (fx, fy) = (camera.fx, camera.fy);
    let r2 = x * x + y * y;
    let (r4, mixed) = (r2 * r2, 2.0 * x * y);
    let distorted = [(pixel.x - camera.cx) / fx, (pixel.y - camera.cy) / fy];
    SMatrix::from_row_slice(
        &[
            [distorted[0], 0.0, 1.0, 0.0, fx * x * r2, fx * x * r4, fx * mixed, fx * (r2 + 2.0 * x * x), fx * x * r2 * r4],
            [0.0, distorted[1], 0.0, 1.0, fy * y * r2, fy * y * r4, fy * (r2 + 2.0 * y * y), fy * mixed, fy * y * r2 * r4],
        ]
        .concat(),
    )
}
