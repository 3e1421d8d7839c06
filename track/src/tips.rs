//! Tip observations from the two cameras' tracks: one for each left frame, with the right track interpolated at its time.

use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, Vector3};
use raven::camera::Cameras;
use raven::log::{Stamp, TipObservation, TipStatus};

use crate::interpolate::{Sample, Track};
use crate::tracker::{CALIBRATION_STD_PX, EPIPOLAR_CHI2, Record, Sighting};

/// Observations and what was found out on the way.
#[derive(Debug, Clone)]
pub struct Tips {
    /// One per left frame.
    pub tips: Vec<TipObservation>,
    /// Median of the stamp of the nearest right frame minus that of each left frame [s].
    pub right_minus_left_s: f64,
    /// Standard deviation of the stamps that the covariance holds, left and right [s].
    pub jitter_s: [f64; 2],
}

/// Triangulates the marker at every left frame.
///
/// The covariance holds the noise of both centres, carried through the interpolation, and the scatter of the stamps times the velocity in
/// the image: `jitter_s`, or what the stamps themselves show. It does not hold what all observations have in common: calibration,
/// registration, latency, and the part of the marker that the shaft hides.
#[must_use]
pub fn tips(cameras: &Cameras, base_from_left: &Isometry3<f64>, frame_id: &str, records: &[Vec<Record>; 2], jitter_s: Option<f64>) -> Tips {
    let [left, right] = records;
    let origin = left.iter().chain(right).map(|r| r.stamp).min().unwrap_or_default();
    let track = |records: &[Record]| {
        let sample = |record: &Record| Sample {
            time_s: record.stamp.seconds_since(origin),
            centre: match record.sighting {
                Sighting::Seen(candidate) => Some((candidate.centre, candidate.std_px)),
                Sighting::Hidden | Sighting::Rejected(_) => None,
            },
        };
        Track::new(records.iter().map(sample).collect(), jitter_s)
    };
    let tracks = [track(left), track(right)];
    let tips = left
        .iter()
        .map(|record| {
            let seen = tracks.each_ref().map(|t| t.at(record.stamp.seconds_since(origin)));
            let observation = |status| TipObservation {
                stamp: record.stamp.plus_seconds(-cameras.latency_s),
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
            let calibration = Matrix2::identity() * (CALIBRATION_STD_PX * CALIBRATION_STD_PX);
            let pixels = [l.pixel, r.pixel];
            let meet = cameras.triangulate(&pixels, &[l.covariance + calibration, r.covariance + calibration]);
            match cameras.triangulate(&pixels, &[l.covariance, r.covariance]) {
                Some(point) if meet.is_some_and(|m| m.chi2 < EPIPOLAR_CHI2) => {
                    let rotation = base_from_left.rotation.to_rotation_matrix();
                    TipObservation {
                        position_m: (base_from_left * Point3::from(point.point_left)).coords,
                        covariance_m2: rotation * point.covariance * rotation.transpose(),
                        ..observation(TipStatus::Seen)
                    }
                }
                _ => observation(TipStatus::Jumped),
            }
        })
        .collect();
    Tips { tips, right_minus_left_s: right_minus_left_s(left, right), jitter_s: tracks.map(|t| t.jitter_s()) }
}

/// The frames before and after a time, of which either may be missing.
fn around(records: &[Record], stamp: Stamp) -> [Option<&Record>; 2] {
    let after = records.partition_point(|r| r.stamp < stamp);
    [after.checked_sub(1).and_then(|before| records.get(before)), records.get(after)]
}

/// Whether the marker was rejected in one of the frames around a time, and hidden in none.
fn is_rejected_near(records: &[Record], stamp: Stamp) -> bool {
    let near = around(records, stamp);
    let is = |wanted: fn(&Sighting) -> bool| near.iter().flatten().any(|r| wanted(&r.sighting));
    is(|s| matches!(s, Sighting::Rejected(_))) && !is(|s| matches!(s, Sighting::Hidden))
}

/// Median over the left frames of the offset of the nearest right frame [s]; NaN without frames.
fn right_minus_left_s(left: &[Record], right: &[Record]) -> f64 {
    let nearest = |record: &Record| {
        let offsets = around(right, record.stamp).into_iter().flatten().map(|r| r.stamp.seconds_since(record.stamp));
        offsets.min_by(|a, b| a.abs().total_cmp(&b.abs()))
    };
    let offsets: Vec<f64> = left.iter().filter_map(nearest).collect();
    raven::stats::median(&offsets).unwrap_or(f64::NAN)
}
