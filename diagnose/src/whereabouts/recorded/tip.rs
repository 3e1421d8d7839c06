//! The tip against its prediction: in the pixels of both images where they are known, else in metres.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Point3, Vector2, Vector3};
use raven::Result;
use raven::camera::{Cameras, Pinhole};
use raven::effects::{Model, Stage, TipModel};
use raven::log::{Recording, TipObservation};
use raven::observation::TipCorrection;
use raven::robot::Arm;

use super::{Channel, Kind, Track, phase_factor};
use crate::evidence::recorded::data::Data;

/// The cameras, where they are registered and every tip came with its pixels.
pub(super) fn pixels_known<'a>(cameras: Option<&'a Cameras>, recordings: &[Recording]) -> Option<&'a Cameras> {
    let with_pixels = |tip: &TipObservation| tip.left_px.iter().chain(&tip.right_px).all(|v| v.is_finite());
    let all = recordings.iter().all(|recording| recording.seen_tips().all(with_pixels));
    cameras.filter(|cameras| all && cameras.base_from_left.is_some())
}

pub(super) fn tip_channels(pixels: bool) -> Vec<Channel> {
    let (names, unit, scale): (&[&str], _, _) =
        if pixels { (&["left u", "left v", "right u", "right v"], "px", 1.0) } else { (&["tip x", "tip y", "tip z"], "mm", 1e3) };
    let channel = |name: &&str| Channel {
        stage: if pixels { Stage::Camera } else { Stage::Kinematics },
        joint: None,
        name: (*name).to_owned(),
        unit,
        scale,
        horizon_s: None,
        position_unit: "mm",
        tracks: Vec::new(),
    };
    names.iter().map(channel).collect()
}

/// When the left image showed the tip in which ninth of it [s, 0 to 8].
pub(super) fn ninths(recording: &Recording, left: &Pinhole, correction: &TipCorrection) -> Vec<(f64, f64)> {
    let third = |pixel: f64, size: u32| (3.0 * (pixel + 0.5) / f64::from(size)).floor().clamp(0.0, 2.0);
    let ninth = |tip: &TipObservation| third(tip.left_px[0], left.width) + 3.0 * third(tip.left_px[1], left.height);
    recording.seen_tips().map(|tip| (correction.shown_at_s(tip.stamp.seconds_since(recording.start)), ninth(tip))).collect()
}

pub(super) fn ninth_at(ninths: &[(f64, f64)], time_s: f64) -> f64 {
    let at = ninths.partition_point(|(t, _)| *t < time_s - 1e-6);
    ninths.get(at).filter(|(t, _)| (t - time_s).abs() < 1e-3).map_or(f64::NAN, |(_, ninth)| *ninth)
}

/// Tip residuals: left u, left v, right u, right v [px] where pixels are known, else x, y, z [m].
pub(super) fn tip_tracks(
    model: &Model,
    arm: &Arm,
    data: &Data,
    recording: &Recording,
    cameras: Option<&Cameras>,
    ninths: &[(f64, f64)],
) -> Result<Vec<Track>> {
    if data.sights.is_empty() {
        return Ok(Vec::new());
    }
    let mut tracks = vec![Track::default(); if cameras.is_some() { 4 } else { 3 }];
    let (mut speed, mut ninth) = (Vec::new(), Vec::new());
    let (predicted, _) = TipModel::new(model, &data.motors)?.rolled_out(&data.sights, &[]);
    let observed: BTreeMap<i64, &TipObservation> =
        recording.seen_tips().map(|tip| (nanoseconds(tip.stamp.seconds_since(recording.start)), tip)).collect();
    for (sight, predicted_m) in data.sights.iter().zip(predicted) {
        let shown_s = model.view.shown_at_s(sight.stamp_s);
        let Some((predicted_m, (angle, rate))) = predicted_m.zip(data.motors.at(shown_s)) else { continue };
        let rows = match cameras {
            Some(cameras) => {
                observed.get(&nanoseconds(sight.stamp_s)).and_then(|tip| pixel_residuals(cameras, tip, &predicted_m, &sight.covariance_m2))
            }
            None => Some((0..3).map(|k| (sight.position_m[k] - predicted_m[k], sight.covariance_m2[(k, k)].sqrt())).collect()),
        };
        let Some(rows) = rows else { continue };
        let joint = arm.transmission.joint_from_motor(&angle);
        speed.push((arm.kinematics.jacobian(&joint) * arm.transmission.joint_rate_from_motor(&rate)).norm() * 1e3);
        ninth.push(ninth_at(ninths, shown_s));
        for (track, (error, noise)) in tracks.iter_mut().zip(rows) {
            track.time_s.push(shown_s);
            track.error.push(error);
            track.noise.push(noise);
        }
    }
    for track in &mut tracks {
        track.factors =
            vec![(Kind::Phase, phase_factor(&track.time_s, &speed)), (Kind::Speed, speed.clone()), (Kind::Image, ninth.clone())];
    }
    Ok(tracks)
}

fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// Measured less predicted pixels with the deviations that the triangulated point's covariance stands for.
fn pixel_residuals(
    cameras: &Cameras,
    tip: &TipObservation,
    predicted_m: &Vector3<f64>,
    covariance_m2: &Matrix3<f64>,
) -> Option<Vec<(f64, f64)>> {
    let left_from_base = cameras.base_from_left?.inverse();
    let in_left = left_from_base * Point3::from(*predicted_m);
    let in_right = cameras.right_from_left * in_left;
    let left_turn = left_from_base.rotation.to_rotation_matrix();
    let right_turn = cameras.right_from_left.rotation.to_rotation_matrix() * left_turn;
    let mut rows = Vec::new();
    for (camera, point, turn, measured) in
        [(&cameras.left, in_left, left_turn, tip.left_px), (&cameras.right, in_right, right_turn, tip.right_px)]
    {
        let (pixel, slope) = camera.project_with_slope(&point.coords)?;
        let slope = slope * turn.matrix();
        let covariance = slope * covariance_m2 * slope.transpose();
        let miss = Vector2::from(measured) - pixel;
        rows.extend((0..2).map(|k| (miss[k], covariance[(k, k)].sqrt())));
    }
    rows.iter().all(|(miss, deviation)| miss.is_finite() && deviation.is_finite()).then_some(rows)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix2, Translation3, UnitQuaternion};
    use raven::camera::Quality;
    use raven::log::{Stamp, TipStatus};

    use super::*;

    #[test]
    fn pixels_miss_by_what_they_were_moved_and_know_their_noise() {
        let pinhole =
            Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 319.5, cy: 239.5, distortion: [-0.1, 0.02, 0.001, 0.0, 0.0] };
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.2, 1.0);
        let cameras = Cameras {
            left: pinhole,
            right: pinhole,
            right_from_left: Isometry3::from_parts(Translation3::new(-0.06, 0.0, 0.0), UnitQuaternion::from_euler_angles(0.0, 0.1, 0.0)),
            base_from_left: Some(Isometry3::from_parts(Translation3::new(0.1, -0.2, 0.4), turn)),
            latency_s: 0.0,
            right_minus_left_s: 0.0,
            quality: Quality::default(),
        };
        let point_left = Vector3::new(0.02, 0.03, 0.4);
        let predicted_m = (cameras.base_from_left.unwrap() * Point3::from(point_left)).coords;
        let [left, right] = cameras.project_base(&predicted_m).unwrap();
        let sigma_px = 0.3;
        let seen = cameras.triangulate(&[left, right], &[Matrix2::identity() * sigma_px * sigma_px; 2]).unwrap();
        let covariance_m2 = turn.to_rotation_matrix() * seen.covariance * turn.to_rotation_matrix().inverse();
        let tip = TipObservation {
            stamp: Stamp(0),
            frame_id: String::new(),
            status: TipStatus::Seen,
            left_px: [left.x + 1.5, left.y],
            right_px: [right.x, right.y - 0.5],
            position_m: predicted_m,
            covariance_m2,
        };
        let rows = pixel_residuals(&cameras, &tip, &predicted_m, &covariance_m2).unwrap();
        for ((miss, deviation), expected) in rows.iter().zip([1.5, 0.0, 0.0, -0.5]) {
            assert!((miss - expected).abs() < 1e-9, "{rows:?}");
            // A point has three numbers and four pixel coordinates: along the fourth direction its covariance knows nothing.
            assert!(*deviation > 0.6 * sigma_px && *deviation <= 1.001 * sigma_px, "{rows:?}");
        }
    }

    #[test]
    fn a_ninth_is_found_at_its_time_only() {
        let ninths = [(1.0, 4.0), (1.1, 5.0)];
        assert_eq!(ninth_at(&ninths, 1.1 + 1e-9), 5.0);
        assert!(ninth_at(&ninths, 1.05).is_nan() && ninth_at(&[], 0.0).is_nan());
    }
}
