//! Where the bundle adjustment starts: focal length and board poses from homographies.
//!
//! With the principal point in the middle of the image and no distortion, a board's homography `H = K [r1 r2 t]`, taken about that
//! middle, says about the focal length `f` (Zhang 2000, with a known centre)
//!
//! ```text
//! r1 . r2 = 0:       h11 h12 + h21 h22 + f^2 h31 h32 = 0
//! |r1| = |r2|:       h11^2 + h21^2 - h12^2 - h22^2 + f^2 (h31^2 - h32^2) = 0
//! ```
//!
//! A board seen face-on has `h31 = h32 = 0` and says nothing.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector2};
use raven::camera::Pinhole;

use crate::homography;
use crate::linear::Corner;

/// Focal length [px] of a camera with images of this size; `None` if no board is tilted enough to tell.
#[must_use]
pub fn focal_px(width: u32, height: u32, boards: &[&[Corner]]) -> Option<f64> {
    let middle = middle(width, height);
    let (mut numerator, mut denominator) = (0.0, 0.0);
    for corners in boards {
        let pairs: Vec<_> = corners.iter().map(|c| (c.point.xy(), c.pixel - middle)).collect();
        let Some(h) = homography::fit(&pairs) else { continue };
        let (first, second) = (h.column(0), h.column(1));
        let scale = first.xy().norm() * second.xy().norm();
        let equations = [
            (first.x * second.x + first.y * second.y, first.z * second.z),
            (0.5 * (first.xy().norm_squared() - second.xy().norm_squared()), 0.5 * (first.z * first.z - second.z * second.z)),
        ];
        for (constant, slope) in equations.map(|(c, s)| (c / scale, s / scale)) {
            numerator -= constant * slope;
            denominator += slope * slope;
        }
    }
    let squared = numerator / denominator;
    (squared.is_finite() && squared > 0.0).then(|| squared.sqrt())
}

/// A camera of this focal length with its principal point in the middle of the image.
#[must_use]
pub fn plain_camera(width: u32, height: u32, focal_px: f64) -> Pinhole {
    let middle = middle(width, height);
    Pinhole { width, height, fx: focal_px, fy: focal_px, cx: middle.x, cy: middle.y, distortion: [0.0; 5] }
}

/// Pose of a board in the camera's frame, `x_camera = pose x_board`, from its homography.
#[must_use]
pub fn board_pose(camera: &Pinhole, corners: &[Corner]) -> Option<Isometry3<f64>> {
    let pairs: Vec<_> = corners.iter().filter_map(|c| Some((c.point.xy(), camera.undistort(&c.pixel)?))).collect();
    let h = homography::fit(&pairs)?;
    // The board is in front of the camera.
    let middle = pairs.iter().map(|p| p.0).sum::<Vector2<f64>>() / pairs.len() as f64;
    let h = h * (h * middle.push(1.0)).z.signum();
    let scale = 2.0 / (h.column(0).norm() + h.column(1).norm());
    let (first, second) = (h.column(0) * scale, h.column(1) * scale);
    let near = Matrix3::from_columns(&[first, second, first.cross(&second)]);
    let decomposition = near.svd(true, true);
    let rotation = Rotation3::from_matrix_unchecked(decomposition.u? * decomposition.v_t?);
    let pose = Isometry3::from_parts(Translation3::from(h.column(2) * scale), UnitQuaternion::from_rotation_matrix(&rotation));
    let ahead = corners.iter().all(|c| (pose * nalgebra::Point3::from(c.point)).z > 1e-9);
    (ahead && pose.translation.vector.iter().all(|v| v.is_finite())).then_some(pose)
}

fn middle(width: u32, height: u32) -> Vector2<f64> {
    Vector2::new(f64::from(width) - 1.0, f64::from(height) - 1.0) * 0.5
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::{Point3, Vector3};

    use super::*;

    fn seen(camera: &Pinhole, pose: &Isometry3<f64>) -> Vec<Corner> {
        let points = (0..54).map(|k| Vector3::new(f64::from(k % 9), f64::from(k / 9), 0.0) * 0.012);
        points
            .map(|p| Corner { point: p, bow: Vector2::zeros(), pixel: camera.project(&(pose * Point3::from(p)).coords).unwrap() })
            .collect()
    }

    #[test]
    fn an_undistorted_camera_is_found_at_once() {
        let camera = plain_camera(640, 480, 610.0);
        let tilts = [Vector3::new(0.4, 0.1, 0.0), Vector3::new(-0.3, 0.5, 1.2), Vector3::new(0.0, -0.6, 3.0)];
        let poses = tilts.map(|t| Isometry3::new(Vector3::new(-0.02, -0.01, 0.3), t));
        let boards: Vec<_> = poses.iter().map(|p| seen(&camera, p)).collect();
        let slices: Vec<&[Corner]> = boards.iter().map(Vec::as_slice).collect();
        assert_relative_eq!(focal_px(640, 480, &slices).unwrap(), 610.0, max_relative = 1e-6);
        for (pose, corners) in poses.iter().zip(&boards) {
            assert_relative_eq!(board_pose(&camera, corners).unwrap(), *pose, epsilon = 1e-6);
        }
    }

    #[test]
    fn boards_seen_face_on_do_not_tell_the_focal_length() {
        let camera = plain_camera(640, 480, 610.0);
        let flat = seen(&camera, &Isometry3::translation(-0.05, -0.03, 0.3));
        // Rounding leaves a meaningless number or none, never a panic; the solver then tries several.
        let _ = focal_px(640, 480, &[&flat]);
        assert!(focal_px(640, 480, &[]).is_none());
    }
}
