//! Systematic errors of a pair of cameras: by how much all points that it places are off alike.
//!
//! They do not average out. With the left camera at `c`, a disparity that is off by `d` moves the point `p` along its ray, by `Z^2 / (f B) d` of two
//! cameras side by side, and a baseline that is off by a part `s` moves it by `s (p - c)`. Centres that are off by more at one place in the images than
//! at another move it across its ray, as `A (u - u_0)` about the middle `u_0` of the image.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::Cameras;

/// Standard deviation of what a calibration leaves between the cameras, where it does not say [px].
pub const CALIBRATION_STD_PX: f64 = 0.5;
/// Relative standard deviation of the baseline where a calibration does not say.
const SCALE_STD: f64 = 0.002;
/// How far a marker's centre is off alike in all images of one camera and not of the other, per axis [px]: light, shade and a shaft look a little
/// different from there. No residual shows it; judged from what is slower than noise in two sessions of two renderers, with the true cameras.
pub const CENTRE_STD_PX: f64 = 0.02;

/// By how much more a marker's centre is off, in both cameras alike, half an image's width from the middle than there [px]: light and shade change with
/// the place. Judged from the same sessions.
const PLACE_STD_PX: f64 = 0.1;

/// Number of what all points have in common.
pub const SYSTEMATIC: usize = 6;

/// Standard deviations of what all points have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Systematic {
    /// Of the disparity [px].
    pub disparity_px: f64,
    /// Of the scale: the baseline's part.
    pub scale: f64,
    /// Of how much more each coordinate of a centre is off half an image's width from the middle than there, along each axis of the image [px].
    pub place_px: f64,
}

impl Cameras {
    /// What calibration and marker leave unknown of every point alike, the poses before the robot apart; the usual, where the calibration does not say.
    #[must_use]
    pub fn systematic(&self) -> Systematic {
        let calibration_px = self.quality.disparity_std_px.unwrap_or(CALIBRATION_STD_PX);
        Systematic {
            disparity_px: calibration_px.hypot(CENTRE_STD_PX * std::f64::consts::SQRT_2),
            scale: self.quality.baseline_std_m.map_or(SCALE_STD, |std| std / self.baseline_m()),
            place_px: PLACE_STD_PX,
        }
    }

    /// How far `tip_m` is off by what is one deviation each of the disparity, of the scale, and of what changes with the place in the images: of `u`
    /// along `u` and `v`, of `v` along both [m, frame 0]. `None` without registration or where the cameras do not see it.
    #[must_use]
    pub fn moved_by(&self, std: &Systematic, tip_m: &Vector3<f64>) -> Option<[Vector3<f64>; SYSTEMATIC]> {
        // Far below a pixel the slope is straight.
        const STEP_PX: f64 = 0.05;
        let base_from_left = self.base_from_left?;
        let pixels = self.project_base(tip_m)?;
        let by_px = |directions: [Vector2<f64>; 2]| {
            let moved = self.moved_by_pixels(&pixels, &[Matrix2::identity(); 2], &directions.map(|along| STEP_PX * along))?;
            Some(base_from_left * (moved / STEP_PX))
        };
        let half_px = 0.5 * f64::from(self.left.width);
        let from_middle = (pixels[0] - 0.5 * Vector2::new(f64::from(self.left.width), f64::from(self.left.height))) / half_px;
        let (u, v) = (by_px([Vector2::x(); 2])?, by_px([Vector2::y(); 2])?);
        let larger = tip_m - base_from_left.translation.vector;
        Some([
            by_px([Vector2::zeros(), Vector2::x()])? * std.disparity_px,
            larger * std.scale,
            u * (from_middle.x * std.place_px),
            u * (from_middle.y * std.place_px),
            v * (from_middle.x * std.place_px),
            v * (from_middle.y * std.place_px),
        ])
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::{Isometry3, Point3};

    use super::super::{Pinhole, Quality};
    use super::*;

    fn side_by_side(quality: Quality) -> Cameras {
        let left = Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, distortion: [0.0; 5] };
        Cameras {
            left,
            right: left,
            right_from_left: Isometry3::translation(-0.05, 0.0, 0.0),
            base_from_left: Some(Isometry3::new(Vector3::new(-0.05, -0.4, 0.01), Vector3::new(1.2, -1.2, -1.2))),
            latency_s: 0.0,
            right_minus_left_s: 0.0,
            quality,
        }
    }

    #[test]
    fn a_disparity_moves_a_point_along_its_ray_and_a_baseline_scales() {
        let cameras = side_by_side(Quality::default());
        let base_from_left = cameras.base_from_left.unwrap();
        let seen = Vector3::new(0.03, -0.02, 0.4);
        let one = Systematic { disparity_px: 1.0, scale: 1.0, place_px: 1.0 };
        let moved = |seen: Vector3<f64>| cameras.moved_by(&one, &(base_from_left * Point3::from(seen)).coords);
        let [deeper, larger, u_along_u, u_along_v, v_along_u, v_along_v] =
            moved(seen).unwrap().map(|moved| base_from_left.inverse() * moved);
        // x_r = x_l - f B / Z: a right pixel further to the right is a smaller disparity.
        let by_px = 0.4 * 0.4 / (600.0 * 0.05);
        assert_relative_eq!(deeper, seen * (by_px / 0.4), epsilon = 1e-8);
        assert_relative_eq!(larger, seen, epsilon = 1e-12);
        // At (45, -30) px from the middle of an image of 640 columns; a pixel is 0.4 / 600 m there.
        let across = |u: f64, v: f64| Vector3::new(u, v, 0.0) * (0.4 / 600.0 / 320.0);
        for (moved, expected) in [
            (u_along_u, across(45.0, 0.0)),
            (u_along_v, across(-30.0, 0.0)),
            (v_along_u, across(0.0, 45.0)),
            (v_along_v, across(0.0, -30.0)),
        ] {
            assert_relative_eq!(moved, expected, epsilon = 1e-8);
        }
        assert!(moved(-seen).is_none(), "behind the cameras");
    }

    #[test]
    fn what_a_calibration_claims_counts_and_the_marker_beside_it() {
        let centre2 = 2.0 * 0.02 * 0.02;
        let unsaid = side_by_side(Quality::default()).systematic();
        assert_relative_eq!(unsaid.disparity_px.powi(2), 0.5 * 0.5 + centre2, epsilon = 1e-12);
        assert_eq!(unsaid.scale, 0.002);
        let quality = Quality { disparity_std_px: Some(0.03), baseline_std_m: Some(2.5e-5), ..Quality::default() };
        let said = side_by_side(quality).systematic();
        assert_relative_eq!(said.disparity_px.powi(2), 0.03 * 0.03 + centre2, epsilon = 1e-12);
        assert_relative_eq!(said.scale, 5e-4, epsilon = 1e-12);
    }
}
