//! Pinhole camera with plumb-bob distortion (Brown 1966; OpenCV's and ROS's `plumb_bob`).
//!
//! With `x, y` the normalised coordinates and `r2 = x^2 + y^2`:
//!
//! ```text
//! x_d = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2)
//! y_d = y (1 + k1 r2 + k2 r2^2 + k3 r2^3) + p1 (r2 + 2 y^2) + 2 p2 x y
//! u = fx x_d + cx,  v = fy y_d + cy
//! ```

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

/// Intrinsic parameters of one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Width of the image [px].
    pub width: u32,
    /// Height of the image [px].
    pub height: u32,
    /// Focal length along u [px].
    pub fx: f64,
    /// Focal length along v [px].
    pub fy: f64,
    /// Principal point, u [px].
    pub cx: f64,
    /// Principal point, v [px].
    pub cy: f64,
    /// `k1, k2, p1, p2, k3`.
    pub distortion: [f64; 5],
}

impl Pinhole {
    /// ROS's name of the distortion's model.
    pub const DISTORTION_MODEL: &str = "plumb_bob";

    /// Pixel from normalised coordinates without distortion, 3x3 [px].
    #[must_use]
    pub fn intrinsics(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// Pixel of a point in the camera's frame [m]; `None` where it is not in front of the camera.
    #[must_use]
    pub fn project(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        (point.z > 1e-9).then(|| self.pixel(&Vector2::new(point.x / point.z, point.y / point.z)))
    }

    /// Pixel of a point and its slope with the point, 2x3 [px/m].
    #[must_use]
    pub fn project_with_slope(&self, point: &Vector3<f64>) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        if point.z <= 1e-9 {
            return None;
        }
        let normal = Vector2::new(point.x / point.z, point.y / point.z);
        let (distorted, slope) = self.distort(&normal);
        let perspective = Matrix2x3::new(1.0, 0.0, -normal.x, 0.0, 1.0, -normal.y) / point.z;
        Some((self.scale(&distorted), Matrix2::new(self.fx, 0.0, 0.0, self.fy) * slope * perspective))
    }

    /// Pixel of a direction given in normalised coordinates `x / z, y / z`.
    #[must_use]
    pub fn pixel(&self, normal: &Vector2<f64>) -> Vector2<f64> {
        self.scale(&self.distort(normal).0)
    }

    /// Normalised coordinates of a pixel, by Newton's method; `None` where the distortion cannot be undone (far outside the image).
    #[must_use]
    pub fn undistort(&self, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
        let target = Vector2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy);
        let mut normal = target;
        for _ in 0..20 {
            let (distorted, slope) = self.distort(&normal);
            let miss = distorted - target;
            if miss.amax() < 1e-13 {
                return Some(normal);
            }
            normal -= slope.try_inverse()? * miss;
        }
        let miss = self.distort(&normal).0 - target;
        (miss.amax() < 1e-9).then_some(normal)
    }

    /// Slope of the pixel with normalised coordinates, 2x2 [px].
    #[must_use]
    pub fn pixel_slope(&self, normal: &Vector2<f64>) -> Matrix2<f64> {
        Matrix2::new(self.fx, 0.0, 0.0, self.fy) * self.distort(normal).1
    }

    /// Whether a pixel lies in the image, `margin_px` inside its edge.
    #[must_use]
    pub fn contains(&self, pixel: &Vector2<f64>, margin_px: f64) -> bool {
        let inside = |value: f64, size: u32| value >= margin_px - 0.5 && value <= f64::from(size) - 0.5 - margin_px;
        inside(pixel.x, self.width) && inside(pixel.y, self.height)
    }

    fn scale(&self, distorted: &Vector2<f64>) -> Vector2<f64> {
        Vector2::new(self.fx * distorted.x + self.cx, self.fy * distorted.y + self.cy)
    }

    fn distort(&self, normal: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (x, y) = (normal.x, normal.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let radial_slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3));
        let distorted =
            Vector2::new(x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
        let mixed = x * y * radial_slope + 2.0 * (p1 * x + p2 * y);
        let slope = Matrix2::new(
            radial + x * x * radial_slope + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            radial + y * y * radial_slope + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (distorted, slope)
    }
}
