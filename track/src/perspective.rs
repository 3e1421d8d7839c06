//! From the centre of a ball's outline to the image of the ball's centre.
//!
//! Seen at an angle `theta` from the camera's axis, a ball of angular radius `alpha` has an outline from `tan(theta - alpha)` to
//! `tan(theta + alpha)`. Its middle lies farther out than the centre:
//!
//! ```text
//! (tan(theta - alpha) + tan(theta + alpha)) / 2 = tan theta / (1 - sin^2 alpha / cos^2 theta)
//! ```
//!
//! by 0.04 px at 0.4 focal lengths from the axis, for a radius of 7.5 px and a focal length of 600 px. The outline's mean radius gives
//! `sin^2 alpha = (r / f)^2 cos^3 theta` to a few parts in a thousand.

use nalgebra::Vector2;
use raven::camera::Pinhole;

/// Pixel of the centre of a ball whose outline has this centre and mean radius [px]; the outline's centre where the lens cannot be undone.
#[must_use]
pub fn ball_centre(camera: &Pinhole, outline_px: &Vector2<f64>, radius_px: f64) -> Vector2<f64> {
    let Some(middle) = camera.undistort(outline_px) else { return *outline_px };
    let cos_theta = 1.0 / (1.0 + middle.norm_squared()).sqrt();
    let share = radius_px * radius_px / (camera.fx * camera.fy) * cos_theta;
    // The outline is small: the lens moves its middle as it moves the centre.
    outline_px + camera.pixel(&(middle * (1.0 - share))) - camera.pixel(&middle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// Outline by exact tangents, its middle and radius from the area and first moments of the polygon.
    #[test]
    fn the_middle_of_an_exact_outline_goes_back_to_the_centre() {
        let camera = Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, distortion: [0.0; 5] };
        for (centre, radius) in [(Vector3::new(0.12, 0.05, 0.3), 0.005), (Vector3::new(-0.1, -0.08, 0.25), 0.008)] {
            let distance = centre.norm();
            let (axis, sin_alpha): (Vector3<f64>, f64) = (centre / distance, radius / distance);
            let side = axis.cross(&Vector3::x()).normalize();
            let outline: Vec<Vector2<f64>> = (0..720)
                .map(|i| {
                    let turn =
                        nalgebra::Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(axis), f64::from(i) * 0.5_f64.to_radians());
                    let cos_alpha = (1.0 - sin_alpha * sin_alpha).sqrt();
                    camera.project(&(axis * cos_alpha + (turn * side) * sin_alpha)).unwrap()
                })
                .collect();
            let (mut area, mut first) = (0.0, Vector2::zeros());
            for i in 0..720 {
                let (p, q) = (outline[i], outline[(i + 1) % 720]);
                let c = p.perp(&q);
                area += c / 2.0;
                first += c / 6.0 * (p + q);
            }
            let middle = first / area;
            let truth = camera.project(&centre).unwrap();
            let corrected = ball_centre(&camera, &middle, (area.abs() / std::f64::consts::PI).sqrt());
            let (before, after) = ((middle - truth).norm(), (corrected - truth).norm());
            assert!(before > 0.02 && after < 0.02 * before, "{before} {after}");
        }
    }
}
