//! What all observations of the tip have in common: what calibration and registration leave unknown.
//!
//! The covariance of an observation holds what differs from frame to frame. The rest does not average out, so it is said apart, per point:
//!
//! ```text
//! C = X diag(rotation) X' + diag(translation) + sum_k d_k d_k',   X = -[p - p_hs]x
//! ```
//!
//! with `p_hs` the tip at the hard stop, about which the registration turns, and `d_k` the shifts of the point by one standard deviation each of the
//! disparity, the scale, and what of the marker's centres changes with the place. A registration whose file does not say counts as known exactly.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use raven::camera::Cameras;
use raven::log::{TipObservation, TipStatus};
use raven::observation::covariance_by_pose_m2;

/// Covariance that observations near `tip_m` share [m^2, frame 0]; `None` without registration or where the cameras do not see the tip.
#[must_use]
pub fn covariance(cameras: &Cameras, tip_m: &Vector3<f64>, hard_stop_m: &Vector3<f64>) -> Option<Matrix3<f64>> {
    let quality = &cameras.quality;
    let stds = [quality.registration_rotation_std_rad, quality.registration_translation_std_m].map(Option::unwrap_or_default);
    let variances = Vector6::from_row_slice(&stds.concat()).map(|std: f64| std * std);
    let pose = covariance_by_pose_m2(&Matrix6::from_diagonal(&variances), &(tip_m - hard_stop_m));
    let moved = cameras.moved_by(&cameras.systematic(), tip_m)?;
    Some(pose + moved.iter().map(|moved| moved * moved.transpose()).sum::<Matrix3<f64>>())
}

/// The covariance that all tips of a log share [m^2], at the mean of those that were seen, and that mean [m].
#[must_use]
pub fn of_tips(cameras: &Cameras, tips: &[TipObservation], hard_stop_m: &Vector3<f64>) -> Option<(Matrix3<f64>, Vector3<f64>)> {
    let seen: Vec<Vector3<f64>> = tips.iter().filter(|tip| tip.status == TipStatus::Seen).map(|tip| tip.position_m).collect();
    let middle = seen.iter().sum::<Vector3<f64>>() / seen.len().max(1) as f64;
    Some((covariance(cameras, &middle, hard_stop_m)?, middle))
}

/// What a log says about its tips beside each one's covariance, as metadata.
#[must_use]
pub fn metadata(cameras: &Cameras, tips: &[TipObservation], hard_stop_m: &Vector3<f64>) -> BTreeMap<String, String> {
    let mut pairs = BTreeMap::new();
    let mut put = |key: &str, value: String| pairs.insert(key.to_owned(), value);
    put("covariance", "per observation: centres and times of frames; not what all observations share".to_owned());
    if let Some((shared, middle)) = of_tips(cameras, tips, hard_stop_m) {
        let numbers: Vec<String> = shared.iter().map(|v| format!("{v:.6e}")).collect();
        put("shared_covariance_m2", numbers.join(" "));
        put("shared_covariance_at_m", middle.iter().map(|v| format!("{v:.6}")).collect::<Vec<_>>().join(" "));
    }
    if let Some(std_s) = cameras.quality.latency_std_s {
        put("latency_std_s", format!("{std_s:.6}"));
    }
    pairs
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix2, Point3, UnitQuaternion, Vector2};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use raven::camera::{CENTRE_STD_PX, Pinhole, Quality};

    use super::*;

    #[test]
    fn cameras_that_are_off_by_their_deviations_shift_the_tip_as_claimed() {
        let left = Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0, distortion: [0.0; 5] };
        let (rotation, translation) = ([2e-3, 1e-3, 3e-3], [3e-4, 5e-4, 2e-4]);
        let quality = Quality {
            registration_rotation_std_rad: Some(rotation),
            registration_translation_std_m: Some(translation),
            disparity_std_px: Some(0.1),
            baseline_std_m: Some(1e-4),
            ..Quality::default()
        };
        let base_from_left = Isometry3::new(Vector3::new(-0.05, -0.4, 0.01), Vector3::new(1.2092, -1.2092, -1.2092));
        let cameras = Cameras {
            left,
            right: left,
            right_from_left: Isometry3::translation(-0.048, 0.0, 0.0),
            base_from_left: Some(base_from_left),
            latency_s: 0.0,
            right_minus_left_s: 0.0,
            quality,
        };
        let hard_stop_m = Vector3::new(0.06, -0.02, -0.06);
        let tip_m = (base_from_left * Point3::new(0.03, -0.02, 0.4)).coords;
        let pixels = cameras.project_base(&tip_m).unwrap();
        let claimed = covariance(&cameras, &tip_m, &hard_stop_m).unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut scatter = Matrix3::zeros();
        let samples = 4000;
        for _ in 0..samples {
            let mut off = cameras.clone();
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from(rotation.map(|std| std * normal())));
            let shift = Vector3::from(translation.map(|std| std * normal()));
            let about = Isometry3::from_parts((hard_stop_m - turn * hard_stop_m + shift).into(), turn);
            off.base_from_left = Some(about * base_from_left);
            off.right.cx += 0.1 * normal();
            off.right_from_left.translation.vector *= 1.0 + 1e-4 / 0.048 * normal();
            let seen = pixels.map(|pixel| pixel + Vector2::new(CENTRE_STD_PX * normal(), 0.0));
            let point = off.triangulate(&seen, &[Matrix2::identity(); 2]).unwrap().point_left;
            let error = (off.base_from_left.unwrap() * Point3::from(point)).coords - tip_m;
            scatter += error * error.transpose() / f64::from(samples);
        }
        let ratio = claimed.try_inverse().unwrap() * scatter;
        // The trace of three unit variances has a standard deviation of sqrt(2 3 / 4000) = 0.039.
        assert!((ratio.trace() - 3.0).abs() < 0.16, "{ratio}");
    }
}
