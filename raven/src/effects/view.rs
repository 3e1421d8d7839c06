//! How the cameras see the tip: where they stand, what their lenses do, and when they look.
//!
//! A tip was triangulated with the cameras as they are believed to be. What departs from that moves the pixels, and the pixels move the
//! triangulated point; without cameras at hand the rig's pose is taken in frame 0 and the lenses are out of reach.

use nalgebra::{Isometry3, Matrix2, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::camera::Cameras;
use crate::robot::Observation;

/// The rig and its clock, as they may be.
#[derive(Debug, Clone)]
pub struct View {
    believed: Option<Cameras>,
    tip_at_hard_stop_m: Vector3<f64>,
    correction: Observation,
    /// Rotation vector of the rig about the tip at the hard stop, left camera's frame [rad].
    pub rotation: Vector3<f64>,
    /// Shift of the rig, left camera's frame [m].
    pub translation_m: Vector3<f64>,
    /// Relative error of the baseline.
    pub baseline: f64,
    /// What the first radial coefficient of both lenses lacks.
    pub k1: f64,
    /// Images show the past of their stamps by this [s].
    pub latency_s: f64,
    /// It grows by this per second.
    pub drift: f64,
    /// The right image shows the past by this much more [s].
    pub right_minus_left_s: f64,
    /// From the first row of an image to its last [s]; the stamp belongs to the middle one.
    pub readout_s: f64,
}

impl View {
    pub(super) fn new(cameras: Option<&Cameras>, tip_at_hard_stop_m: Vector3<f64>, correction: &Observation) -> Self {
        Self {
            believed: cameras.filter(|c| c.base_from_left.is_some()).cloned(),
            tip_at_hard_stop_m,
            correction: *correction,
            rotation: Vector3::zeros(),
            translation_m: Vector3::zeros(),
            baseline: 0.0,
            k1: 0.0,
            latency_s: correction.latency,
            drift: 0.0,
            right_minus_left_s: 0.0,
            readout_s: 0.0,
        }
    }

    /// Whether there are cameras to bend.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        self.believed.is_some()
    }

    /// When the robot was where an image with this stamp shows it [s].
    #[must_use]
    pub fn shown_at_s(&self, stamp_s: f64) -> f64 {
        stamp_s - self.latency_s - self.drift * stamp_s
    }

    /// When the robot was where the left and the right image with this stamp show it at these rows, from -1/2 at the top to 1/2 at the bottom [s].
    #[must_use]
    pub fn images_at_s(&self, stamp_s: f64, rows: [f64; 2]) -> [f64; 2] {
        let of_row = |row: f64| self.shown_at_s(stamp_s) + self.readout_s * row;
        [of_row(rows[0]), of_row(rows[1]) - self.right_minus_left_s]
    }

    /// The file's corrections that make up for latency and pose of this rig, once the tip at the hard stop is `tip_at_hard_stop_m`.
    ///
    /// Seen is `S(x) = R' (A x - p - t) + p`, with `A` the rig's motion in frame 0 and `R`, `t`, `p` the old correction; the new one has
    /// `R_n = A_R' R` and puts `p_n` where `S^-1(p_n) = A^-1 (R (p_n - p) + p + t)` is.
    #[must_use]
    pub fn observation(&self, tip_at_hard_stop_m: &Vector3<f64>) -> Observation {
        let look = self.look();
        let moved = look.believed_from_base.inverse() * look.actual_from_base;
        let (pivot, turn) = (self.tip_at_hard_stop_m, UnitQuaternion::from_scaled_axis(Vector3::from(self.correction.rotation)));
        let corrected = turn * (tip_at_hard_stop_m - pivot) + pivot + Vector3::from(self.correction.translation);
        let translation = moved.inverse_transform_point(&Point3::from(corrected)).coords - tip_at_hard_stop_m;
        let rotation = (moved.rotation.inverse() * turn).scaled_axis();
        Observation { latency: self.latency_s, rotation: rotation.into(), translation: translation.into(), ..self.correction }
    }

    /// A camera to see through, ready for many sightings.
    #[must_use]
    pub fn look(&self) -> Look<'_> {
        let left_from_base = self.believed.as_ref().and_then(|c| c.base_from_left).map_or_else(Isometry3::identity, |pose| pose.inverse());
        let pivot = left_from_base * Point3::from(self.tip_at_hard_stop_m);
        let turn = UnitQuaternion::from_scaled_axis(self.rotation);
        // The registration saw the tip at the hard stop: that point keeps its place in the left camera.
        let believed_from_base = left_from_base;
        let actual_from_base = {
            let turned = Isometry3::from_parts((pivot.coords - turn.inverse() * pivot.coords).into(), turn.inverse());
            turned * Isometry3::translation(-self.translation_m.x, -self.translation_m.y, -self.translation_m.z) * left_from_base
        };
        let bent = self.believed.as_ref().filter(|_| self.baseline != 0.0 || self.k1 != 0.0).map(|believed| {
            let mut bent = believed.clone();
            bent.right_from_left.translation.vector *= 1.0 + self.baseline;
            bent.left.distortion[0] += self.k1;
            bent.right.distortion[0] += self.k1;
            bent
        });
        Look { view: self, believed_from_base, actual_from_base, bent }
    }
}

/// A [`View`] made ready.
#[derive(Debug)]
pub struct Look<'a> {
    view: &'a View,
    believed_from_base: Isometry3<f64>,
    actual_from_base: Isometry3<f64>,
    bent: Option<Cameras>,
}

impl Look<'_> {
    /// Where a tip is triangulated that is at these points (frame 0) when the left and when the right image show it.
    #[must_use]
    pub fn seen_m(&self, tip_m: &[Vector3<f64>; 2]) -> Option<Vector3<f64>> {
        let [in_left, in_right] = tip_m.map(|tip_m| self.actual_from_base * Point3::from(tip_m));
        let seen_left = match (&self.view.believed, in_left != in_right || self.bent.is_some()) {
            (Some(believed), true) => {
                let actual = self.bent.as_ref().unwrap_or(believed);
                let left = actual.left.project(&in_left.coords)?;
                let right = actual.right.project(&(actual.right_from_left * in_right).coords)?;
                Point3::from(believed.triangulate(&[left, right], &[Matrix2::identity(); 2])?.point_left)
            }
            _ => in_left,
        };
        let in_base = self.believed_from_base.inverse_transform_point(&seen_left).coords;
        Some(self.corrected(&in_base))
    }

    /// As the file's own corrections would have it seen.
    fn corrected(&self, seen: &Vector3<f64>) -> Vector3<f64> {
        let Observation { rotation, translation, .. } = self.view.correction;
        let pivot = self.view.tip_at_hard_stop_m;
        Rotation3::new(Vector3::from(rotation)).inverse() * (seen - pivot - Vector3::from(translation)) + pivot
    }
}
