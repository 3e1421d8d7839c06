//! Systematic errors of a pair of cameras: by how much all points that it places are off alike.
//!
//! They do not average out. With the left camera at `c`, a disparity that is off by `d` moves the point `p` along its ray, by `Z^2 / (f B) d` of two
//! cameras side by side, and a baseline that is off by a part `s` moves it by `s (p - c)`.

use nalgebra::{Matrix2, Point3, Vector2, Vector3};

use super::Cameras;

/// Standard deviation of what a calibration leaves between the cameras, where it does not say [px].
pub const CALIBRATION_STD_PX: f64 = 0.5;
/// Relative standard deviation of the baseline where a calibration does not say.
const SCALE_STD: f64 = 0.002;
/// How far a marker's centre is off alike in all images of one camera and not of the other, per axis [px]: light, shade and a shaft look a little
/// different from there. No residual shows it; judged from what is slower than noise in two sessions of two renderers, with the true cameras.
pub const CENTRE_STD_PX: f64 = 0.02;

/// Standard deviations of what all points have in common.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Systematic {
    /// Of the disparity [px].
    pub disparity_px: f64,
    /// Of the scale: the baseline's part.
    pub scale: f64,
}

impl Cameras {
    /// What the calibration leaves unknown of every point alike, the poses before the robot apart; the usual, where it does not say.
    #[must_use]
    pub fn systematic(&self) -> Systematic {
        let quality = &self.quality;
        Systematic {
            disparity_px: quality.disparity_std_px.unwrap_or(CALIBRATION_STD_PX),
            scale: quality.baseline_std_m.map_or(SCALE_STD, |std| std / self.baseline_m()),
        }
    }

    /// The same of a marker's centre, which each camera takes for another place.
    #[must_use]
    pub fn systematic_of_marker(&self) -> Systematic {
        let calibration = self.systematic();
        Systematic { disparity_px: calibration.disparity_px.hypot(CENTRE_STD_PX * std::f64::consts::SQRT_2), ..calibration }
    }

    /// How far `tip_m` is off by one pixel of disparity, and by a baseline that is off by all of it [m, frame 0]; `None` without registration or
    /// where the cameras do not see it.
    #[must_use]
    pub fn moved_by_systematic(&self, tip_m: &Vector3<f64>) -> Option<[Vector3<f64>; 2]> {
        // Far below a pixel the slope is straight.
        const STEP_PX: f64 = 0.05;
        let base_from_left = self.base_from_left?;
        let [left, right] = self.project_base(tip_m)?;
        let point = |step_px: f64| {
            let point = self.triangulate(&[left, right + Vector2::new(step_px, 0.0)], &[Matrix2::identity(); 2])?;
            Some((base_from_left * Point3::from(point.point_left)).coords)
        };
        let deeper = (point(STEP_PX)? - point(-STEP_PX)?) / (2.0 * STEP_PX);
        Some([deeper, tip_m - base_from_left.translation.vector])
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::Isometry3;

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
        let [deeper, larger] = cameras.moved_by_systematic(&(base_from_left * Point3::from(seen)).coords).unwrap();
        // x_r = x_l - f B / Z: a right pixel further to the right is a smaller disparity.
        let by_px = 0.4 * 0.4 / (600.0 * 0.05);
        assert_relative_eq!(base_from_left.inverse() * deeper, seen * (by_px / 0.4), epsilon = 1e-8);
        assert_relative_eq!(base_from_left.inverse() * larger, seen, epsilon = 1e-12);
        assert!(cameras.moved_by_systematic(&(base_from_left * Point3::from(-seen)).coords).is_none(), "behind the cameras");
    }

    #[test]
    fn what_a_calibration_claims_counts_and_the_marker_beside_it() {
        let unsaid = side_by_side(Quality::default()).systematic();
        assert_eq!(unsaid, Systematic { disparity_px: 0.5, scale: 0.002 });
        let said = side_by_side(Quality { disparity_std_px: Some(0.03), baseline_std_m: Some(2.5e-5), ..Quality::default() });
        assert_relative_eq!(said.systematic().scale, 5e-4, epsilon = 1e-12);
        assert_relative_eq!(said.systematic_of_marker().disparity_px.powi(2), 0.03 * 0.03 + 2.0 * 0.02 * 0.02, epsilon = 1e-12);
    }
}
