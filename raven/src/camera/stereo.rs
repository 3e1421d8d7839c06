//! Two cameras and the robot: `x_right = R x_left + t`, `x_base = R x_left + t`, and points seen by both.

use nalgebra::{Isometry3, Matrix2, Matrix3, Matrix3x4, Matrix4, Matrix4x3, Vector2, Vector3, Vector4};

use super::{Pinhole, Quality};

/// A calibrated pair, registered to the robot's frame 0 or not yet.
#[derive(Debug, Clone, PartialEq)]
pub struct Cameras {
    /// Left camera.
    pub left: Pinhole,
    /// Right camera.
    pub right: Pinhole,
    /// `x_right = right_from_left x_left`.
    pub right_from_left: Isometry3<f64>,
    /// `x_frame0 = base_from_left x_left`, after registration.
    pub base_from_left: Option<Isometry3<f64>>,
    /// By how much an image shows the past of its stamp [s].
    pub latency_s: f64,
    /// By how much more a right image shows the past of its stamp than a left one [s].
    pub right_minus_left_s: f64,
    /// How good the calibration was, as far as it is known.
    pub quality: Quality,
}

/// A point seen by both cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StereoPoint {
    /// In the left camera's frame [m].
    pub point_left: Vector3<f64>,
    /// Its covariance from pixel noise alone [m^2].
    pub covariance: Matrix3<f64>,
    /// Squared reprojection error in units of the pixel noise: chi-square with one degree of freedom.
    pub chi2: f64,
}

impl Cameras {
    /// Pixels, left and right, of a point in the left camera's frame.
    #[must_use]
    pub fn project(&self, point_left: &Vector3<f64>) -> Option<[Vector2<f64>; 2]> {
        let point_right = self.right_from_left * nalgebra::Point3::from(*point_left);
        Some([self.left.project(point_left)?, self.right.project(&point_right.coords)?])
    }

    /// Pixels, left and right, of a point in the robot's frame 0; `None` without registration or behind a camera.
    #[must_use]
    pub fn project_base(&self, point_base: &Vector3<f64>) -> Option<[Vector2<f64>; 2]> {
        let left = self.base_from_left?.inverse_transform_point(&nalgebra::Point3::from(*point_base));
        self.project(&left.coords)
    }

    /// The point whose projections are nearest to two pixels, by least squares over all four coordinates (Gauss-Newton).
    ///
    /// `covariance` holds a 2x2 per camera [px^2]. `None` where the rays do not meet in front of the cameras.
    #[must_use]
    pub fn triangulate(&self, pixels: &[Vector2<f64>; 2], covariance: &[Matrix2<f64>; 2]) -> Option<StereoPoint> {
        let mut point = self.midpoint(pixels)?;
        let mut weight = Matrix4::zeros();
        weight.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance[0].try_inverse()?);
        weight.fixed_view_mut::<2, 2>(2, 2).copy_from(&covariance[1].try_inverse()?);
        let rotation = self.right_from_left.rotation.to_rotation_matrix();
        for iteration in 0..10 {
            let right = (self.right_from_left * nalgebra::Point3::from(point)).coords;
            let (pixel_left, slope_left) = self.left.project_with_slope(&point)?;
            let (pixel_right, slope_right) = self.right.project_with_slope(&right)?;
            let (miss_left, miss_right) = (pixels[0] - pixel_left, pixels[1] - pixel_right);
            let miss = Vector4::new(miss_left.x, miss_left.y, miss_right.x, miss_right.y);
            let mut slope = Matrix4x3::zeros();
            slope.fixed_view_mut::<2, 3>(0, 0).copy_from(&slope_left);
            slope.fixed_view_mut::<2, 3>(2, 0).copy_from(&(slope_right * rotation));
            let inverse = (slope.transpose() * weight * slope).try_inverse()?;
            let step = inverse * slope.transpose() * weight * miss;
            point += step;
            if step.norm() < 1e-12 * point.norm() || iteration == 9 {
                let chi2 = (miss.transpose() * weight * miss)[0];
                let seen = point.z > 0.0 && point.iter().all(|v| v.is_finite());
                return seen.then_some(StereoPoint { point_left: point, covariance: inverse, chi2 });
            }
        }
        None
    }

    /// How far the point of two pixels goes, in the left camera's frame, while they go by `by` [m]: half of what lies between there and as far behind.
    #[must_use]
    pub fn moved_by_pixels(
        &self,
        pixels: &[Vector2<f64>; 2],
        covariance: &[Matrix2<f64>; 2],
        by: &[Vector2<f64>; 2],
    ) -> Option<Vector3<f64>> {
        let point = |sign: f64| Some(self.triangulate(&[0, 1].map(|k| pixels[k] + sign * by[k]), covariance)?.point_left);
        Some(0.5 * (point(1.0)? - point(-1.0)?))
    }

    /// Nearest point between the two rays, the start of [`Self::triangulate`].
    fn midpoint(&self, pixels: &[Vector2<f64>; 2]) -> Option<Vector3<f64>> {
        let left = self.left.undistort(&pixels[0])?.push(1.0);
        let right_in_right = self.right.undistort(&pixels[1])?.push(1.0);
        let left_from_right = self.right_from_left.inverse();
        let (right, origin) = (left_from_right.rotation * right_in_right, left_from_right.translation.vector);
        // Minimise |a left - (origin + b right)|.
        let (ll, lr, rr) = (left.dot(&left), left.dot(&right), right.dot(&right));
        let (lo, ro) = (left.dot(&origin), right.dot(&origin));
        let determinant = ll * rr - lr * lr;
        if determinant.abs() < 1e-12 {
            return None;
        }
        let (a, b) = ((lo * rr - ro * lr) / determinant, (lo * lr - ro * ll) / determinant);
        let point = 0.5 * (left * a + origin + right * b);
        (point.z > 0.0).then_some(point)
    }

    /// Pixels of each camera from its own frame, left and right, 3x4 [px, px m], as of a pair that is not rectified: the right one has the
    /// baseline's length beside it, as ROS's stereo nodes read it there.
    #[must_use]
    pub fn projections(&self) -> [Matrix3x4<f64>; 2] {
        let [left, mut right] = [&self.left, &self.right].map(|camera| camera.intrinsics().insert_column(3, 0.0));
        right[(0, 3)] = -self.right.fx * self.baseline_m();
        [left, right]
    }

    /// Distance between the cameras [m].
    #[must_use]
    pub fn baseline_m(&self) -> f64 {
        self.right_from_left.translation.vector.norm()
    }
}
