//! Tip observations from the two cameras' tracks: one for each left frame, with the right track interpolated at its time.

use nalgebra::{Isometry3, Matrix3, Matrix3x4, Matrix4, Point3, Vector2, Vector3};
use raven::camera::{Cameras, StereoPoint};
use raven::log::{CameraSkew, Stamp, TipObservation, TipStatus};

use crate::interpolate::Interpolated;
use crate::stereo::StereoTrack;
use crate::tracker::{Record, Sighting, meet};

/// Observations and what was found out on the way.
#[derive(Debug, Clone)]
pub struct Tips {
    /// One per left frame.
    pub tips: Vec<TipObservation>,
    /// Median of the stamp of the nearest right frame minus that of each left frame [s].
    pub right_minus_left_s: f64,
    /// Standard deviation of the stamps about the cameras' pace, left and right [s].
    pub jitter_s: [f64; 2],
}

/// Triangulates the marker at every left frame.
///
/// The covariance holds what differs from frame to frame: the noise of both centres, carried through the interpolation, and how well the
/// times of the frames are known, times the velocity in the image (see [`crate::pace`]). It does not hold what all observations have in
/// common: calibration, registration, latency, and the part of the marker that the shaft hides.
#[must_use]
pub fn tips(cameras: &Cameras, base_from_left: &Isometry3<f64>, frame_id: &str, records: &[Vec<Record>; 2], jitter_s: Option<f64>) -> Tips {
    let [left, right] = records;
    let stereo = StereoTrack::new(records, jitter_s, cameras.right_minus_left_s);
    let tips = left
        .iter()
        .enumerate()
        .map(|(i, record)| {
            let seen = stereo.at_left(i);
            let observation = |status| TipObservation {
                stamp: stereo.stamp(i).plus_seconds(-cameras.latency_s),
                frame_id: frame_id.to_owned(),
                status,
                left_px: seen[0].map_or([f64::NAN; 2], |s| s.pixel.into()),
                right_px: seen[1].map_or([f64::NAN; 2], |s| s.pixel.into()),
                position_m: Vector3::repeat(f64::NAN),
                covariance_m2: Matrix3::repeat(f64::NAN),
            };
            let [Some(l), Some(r)] = seen else {
                let rejected =
                    matches!(record.sighting, Sighting::Rejected(_)) || (seen[0].is_some() && is_rejected_near(right, record.stamp));
                return observation(if rejected { TipStatus::Jumped } else { TipStatus::Occluded });
            };
            match triangulate(cameras, &[l, r]) {
                Some(point) => {
                    let rotation = base_from_left.rotation.to_rotation_matrix();
                    TipObservation {
                        position_m: (base_from_left * Point3::from(point.point_left)).coords,
                        covariance_m2: rotation * point.covariance * rotation.transpose(),
                        ..observation(TipStatus::Seen)
                    }
                }
                None => observation(TipStatus::Jumped),
            }
        })
        .collect();
    Tips { tips, right_minus_left_s: right_minus_left_s(records), jitter_s: stereo.jitter_s() }
}

/// Step of the difference quotients [px].
const STEP_PX: f64 = 0.01;

/// The point that both cameras see; `None` where their rays do not meet, the calibration's error allowed for.
///
/// Its covariance is that of both pixels, of which a part is alike, as the cameras' response is: it moves the point sideways, and not in depth.
#[must_use]
pub fn triangulate(cameras: &Cameras, seen: &[Interpolated; 2]) -> Option<StereoPoint> {
    let pixels = seen.map(|s| s.pixel);
    let covariances = seen.map(|s| s.covariance);
    meet(cameras, &pixels, &covariances)?;
    let point = cameras.triangulate(&pixels, &covariances)?;
    let mut slope = Matrix3x4::zeros();
    for k in 0..4 {
        let mut by = [Vector2::zeros(); 2];
        by[k / 2][k % 2] = STEP_PX;
        slope.set_column(k, &(cameras.moved_by_pixels(&pixels, &covariances, &by)? / STEP_PX));
    }
    let mut of_pixels = Matrix4::zeros();
    of_pixels.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariances[0]);
    of_pixels.fixed_view_mut::<2, 2>(2, 2).copy_from(&covariances[1]);
    for axis in 0..2 {
        let alike = seen.iter().map(|s| s.covariance[(axis, axis)].min(s.alike_px * s.alike_px)).fold(f64::INFINITY, f64::min);
        of_pixels[(axis, axis + 2)] = alike;
        of_pixels[(axis + 2, axis)] = alike;
    }
    Some(StereoPoint { covariance: slope * of_pixels * slope.transpose(), ..point })
}

/// Whether the marker was rejected in one of the frames around a time, and hidden in none.
fn is_rejected_near(records: &[Record], stamp: Stamp) -> bool {
    let after = records.partition_point(|r| r.stamp < stamp);
    let near = [after.checked_sub(1).and_then(|before| records.get(before)), records.get(after)];
    let is = |wanted: fn(&Sighting) -> bool| near.iter().flatten().any(|r| wanted(&r.sighting));
    is(|s| matches!(s, Sighting::Rejected(_))) && !is(|s| matches!(s, Sighting::Hidden))
}

/// By how much right frames are later than left ones [s]; NaN without frames.
#[must_use]
pub fn right_minus_left_s(records: &[Vec<Record>; 2]) -> f64 {
    let [left, right] = records.each_ref().map(|records| records.iter().map(|record| record.stamp).collect::<Vec<Stamp>>());
    CameraSkew::of(&left, &right).map_or(f64::NAN, |skew| skew.right_minus_left_s)
}
