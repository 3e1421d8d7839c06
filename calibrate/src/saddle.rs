//! Sub-pixel place of one X-junction: the stationary point of a quadratic surface fitted to the grey values around it.
//!
//! ```text
//! I(x, y) = a x^2 + b x y + c y^2 + d x + e y + f,   a saddle where 4 a c < b^2
//! ```
//!
//! The window is moved onto the saddle until they coincide: a window off the junction pulls the fitted saddle towards its own middle.

use image::GrayImage;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// An X-junction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Saddle {
    /// Where it is [px].
    pub pixel: Vector2<f64>,
    /// Curvature of the grey values there, 2x2, indefinite [grey levels / px^2].
    pub curvature: Matrix2<f64>,
}

impl Saddle {
    /// Contrast of the junction: the root of minus the determinant of its curvature [grey levels / px^2].
    #[must_use]
    pub fn strength(&self) -> f64 {
        (-self.curvature.determinant()).max(0.0).sqrt()
    }
}

/// Finds the saddle near `start` with a square window of `2 radius + 1` pixels; `None` if there is none within `reach_px`.
#[must_use]
pub fn refine(image: &GrayImage, start: Vector2<f64>, radius: i32, reach_px: f64) -> Option<Saddle> {
    let mut middle = start;
    for _ in 0..30 {
        let [a, b, c, d, e] = quadratic(image, middle, radius)?;
        let curvature = Matrix2::new(2.0 * a, b, b, 2.0 * c);
        if curvature.determinant() >= 0.0 {
            return None;
        }
        let step = -curvature.try_inverse()? * Vector2::new(d, e);
        // Half a window is as far as one fit can be trusted.
        let limit = 0.5 * f64::from(radius);
        let step = if step.norm() > limit { step * (limit / step.norm()) } else { step };
        middle += step;
        if (middle - start).norm() > reach_px {
            return None;
        }
        if step.norm() < 1e-4 {
            return Some(Saddle { pixel: middle, curvature });
        }
    }
    None
}

/// Coefficients `a b c d e` of the surface fitted to bilinear samples one pixel apart around `middle`.
fn quadratic(image: &GrayImage, middle: Vector2<f64>, radius: i32) -> Option<[f64; 5]> {
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut right = SVector::<f64, 6>::zeros();
    for dy in -radius..=radius {
        for dx in -radius..=radius {
            let (x, y) = (f64::from(dx), f64::from(dy));
            let row = SVector::<f64, 6>::from([x * x, x * y, y * y, x, y, 1.0]);
            normal += row * row.transpose();
            right += row * bilinear(image, middle + Vector2::new(x, y))?;
        }
    }
    let [a, b, c, d, e, _] = normal.cholesky()?.solve(&right).into();
    Some([a, b, c, d, e])
}

/// Grey value between pixels; `None` outside the image.
#[must_use]
pub fn bilinear(image: &GrayImage, at: Vector2<f64>) -> Option<f64> {
    let (left, top) = (at.x.floor(), at.y.floor());
    if !(left >= 0.0 && top >= 0.0 && left + 1.0 < f64::from(image.width()) && top + 1.0 < f64::from(image.height())) {
        return None;
    }
    // Both are whole numbers inside the image.
    let (column, row) = (left as u32, top as u32);
    let (fx, fy) = (at.x - left, at.y - top);
    let grey = |dx: u32, dy: u32| f64::from(image.get_pixel(column + dx, row + dy)[0]);
    let upper = grey(0, 0) + fx * (grey(1, 0) - grey(0, 0));
    let lower = grey(0, 1) + fx * (grey(1, 1) - grey(0, 1));
    Some(upper + fy * (lower - upper))
}
