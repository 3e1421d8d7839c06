//! Observations of the tip without images: true pixels with noise, triangulated with the cameras as they are believed to be.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::rig::Rig;
use super::shutter::Delays;
use crate::camera::Pinhole;
use crate::log::{Side, Stamp, TipObservation, TipStatus};

/// How the tip is observed.
#[derive(Debug, Clone, Copy)]
pub struct Observer<'a> {
    /// Cameras.
    pub rig: &'a Rig,
    /// Delays of their stamps.
    pub delays: &'a Delays,
    /// Standard deviation of a coordinate [px].
    pub noise_px: f64,
    /// Name of the arm's frame 0.
    pub frame_id: &'a str,
}

impl Observer<'_> {
    /// One observation. `tip_at` is the true tip over time [m, frame 0]; `time_s` the middle of the left exposure.
    #[must_use]
    pub fn observe(
        &self,
        time_s: f64,
        stamp: Stamp,
        hidden: bool,
        tip_at: impl Fn(f64) -> Vector3<f64>,
        rng: &mut impl Rng,
    ) -> TipObservation {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let noise = [Vector2::new(normal(), normal()), Vector2::new(normal(), normal())].map(|n| n * self.noise_px);
        let lost = TipObservation {
            stamp,
            frame_id: self.frame_id.to_owned(),
            status: TipStatus::Occluded,
            left_px: [f64::NAN; 2],
            right_px: [f64::NAN; 2],
            position_m: Vector3::repeat(f64::NAN),
            covariance_m2: Matrix3::repeat(f64::NAN),
        };
        if hidden {
            return lost;
        }
        // Both images carry one stamp: the one that is later shows an earlier moment.
        let right_time_s = time_s - self.delays.right_minus_left_s;
        let pixel = |side, time_s| self.pixel(side, time_s, &tip_at);
        let (Some(left), Some(right)) = (pixel(Side::Left, time_s), pixel(Side::Right, right_time_s)) else { return lost };
        let pixels = [left + noise[0], right + noise[1]];
        let variance = Matrix2::identity() * (self.noise_px * self.noise_px).max(1e-8);
        let cameras = &self.rig.believed;
        let (Some(point), Some(registration)) = (cameras.triangulate(&pixels, &[variance; 2]), cameras.base_from_left) else { return lost };
        let rotation = registration.rotation.to_rotation_matrix().into_inner();
        TipObservation {
            status: TipStatus::Seen,
            left_px: pixels[0].into(),
            right_px: pixels[1].into(),
            position_m: rotation * point.point_left + registration.translation.vector,
            covariance_m2: rotation * point.covariance * rotation.transpose(),
            ..lost
        }
    }

    /// Where a camera sees the tip; `None` outside its image.
    fn pixel(&self, side: Side, time_s: f64, tip_at: impl Fn(f64) -> Vector3<f64>) -> Option<Vector2<f64>> {
        let (index, camera): (usize, &Pinhole) = match side {
            Side::Left => (0, &self.rig.actual.left),
            Side::Right => (1, &self.rig.actual.right),
        };
        let seen = |time_s| self.rig.actual.project_base(&tip_at(time_s)).map(|pixels| pixels[index]);
        let mut pixel = seen(time_s)?;
        // The row decides when it is exposed, and the motion decides the row; a second pass is exact to a thousandth of a pixel.
        for _ in 0..if self.delays.readout_s > 0.0 { 2 } else { 0 } {
            pixel = seen(time_s + self.delays.of_row(pixel.y, camera.height))?;
        }
        camera.contains(&pixel, 1.0).then_some(pixel)
    }
}
