//! A camera's track of the marker, at times between its frames.
//!
//! Two free-running cameras are up to half a frame apart, which at 50 mm/s and 15 Hz is tens of millimetres of depth if the nearest frames
//! are taken for a pair. So the pixels of one camera are interpolated at the other's times: by the cubic through four frames, or the line
//! through two where there are no four; never across a frame that is missing or in which the marker was not seen.

use nalgebra::{Matrix2, Vector2};

/// Longest step between frames that is bridged, in frame intervals: one frame and a jitter, less than two.
pub const LONGEST_STEP: f64 = 1.6;

/// One frame of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time of the frame [s].
    pub time_s: f64,
    /// Marker's centre [px] and its covariance [px^2]; `None` where it was not seen.
    pub centre: Option<(Vector2<f64>, Matrix2<f64>)>,
    /// Standard deviation per axis of the part that all cameras share [px].
    pub alike_px: f64,
}

/// The marker in one camera over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    samples: Vec<Sample>,
    interval_s: f64,
    jitter_s: f64,
}

/// A track at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interpolated {
    /// Marker's centre [px].
    pub pixel: Vector2<f64>,
    /// Its covariance from the noise of the centres and of the stamps [px^2].
    pub covariance: Matrix2<f64>,
    /// Its velocity [px/s].
    pub velocity: Vector2<f64>,
    /// Standard deviation per axis of what all cameras err by alike [px].
    pub alike_px: f64,
}

impl Track {
    /// A track of frames at increasing times that are known to `jitter_s` [s], one standard deviation.
    #[must_use]
    pub fn new(samples: Vec<Sample>, jitter_s: f64) -> Self {
        let times: Vec<f64> = samples.iter().map(|s| s.time_s).collect();
        let interval_s = raven::stats::median_step(&times).unwrap_or(0.0);
        Self { samples, interval_s, jitter_s }
    }

    /// The track at a time; `None` outside it, at a missing frame and where the marker was not seen in both frames around.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<Interpolated> {
        let after = self.samples.partition_point(|s| s.time_s < time_s);
        let here = self.samples.get(after).filter(|s| s.time_s == time_s);
        if let Some((&Sample { alike_px, .. }, (pixel, noise))) = here.and_then(|s| Some((s, s.centre?))) {
            let velocity = self.velocity(after);
            return Some(self.with_jitter(pixel, noise, velocity, alike_px));
        }
        let before = after.checked_sub(1)?;
        if !self.joined(before) {
            return None;
        }
        let outer = before.checked_sub(1).filter(|&first| self.joined(first)).filter(|_| self.joined(after));
        match outer {
            Some(first) => self.through(first..first + 4, time_s),
            None => self.through(before..before + 2, time_s),
        }
    }

    /// Whether the marker was seen in frame `i` and in the next, with none missing between.
    fn joined(&self, i: usize) -> bool {
        let (Some(here), Some(next)) = (self.samples.get(i), self.samples.get(i + 1)) else { return false };
        here.centre.is_some() && next.centre.is_some() && next.time_s - here.time_s <= LONGEST_STEP * self.interval_s
    }

    /// Polynomial through some frames, by Lagrange's weights and their derivatives.
    fn through(&self, frames: std::ops::Range<usize>, time_s: f64) -> Option<Interpolated> {
        let samples = self.samples.get(frames)?;
        let (mut pixel, mut velocity, mut noise, mut alike_px) = (Vector2::zeros(), Vector2::zeros(), Matrix2::zeros(), 0.0);
        for (i, sample) in samples.iter().enumerate() {
            let (centre, covariance) = sample.centre?;
            let others = || samples.iter().enumerate().filter(move |(j, _)| *j != i).map(|(_, s)| s.time_s);
            let weight: f64 = others().map(|t| (time_s - t) / (sample.time_s - t)).product();
            let slope: f64 = others()
                .map(|skip| {
                    others().filter(|&t| t != skip).map(|t| (time_s - t) / (sample.time_s - t)).product::<f64>() / (sample.time_s - skip)
                })
                .sum();
            pixel += weight * centre;
            velocity += slope * centre;
            noise += (covariance - alike(sample.alike_px)) * weight.powi(2);
            alike_px += weight * sample.alike_px;
        }
        // What cameras err by alike, neighbouring frames do too: no mean makes it less.
        Some(self.with_jitter(pixel, noise + alike(alike_px), velocity, alike_px))
    }

    /// Velocity at a frame from its neighbours; zero where there are none.
    fn velocity(&self, i: usize) -> Vector2<f64> {
        let first = i.checked_sub(1).filter(|&before| self.joined(before)).unwrap_or(i);
        let last = if self.joined(i) { i + 1 } else { i };
        let ends = (self.samples.get(first), self.samples.get(last));
        let (Some(&Sample { time_s: t0, centre: Some((p0, _)), .. }), Some(&Sample { time_s: t1, centre: Some((p1, _)), .. })) = ends
        else {
            return Vector2::zeros();
        };
        if t1 > t0 { (p1 - p0) / (t1 - t0) } else { Vector2::zeros() }
    }

    fn with_jitter(&self, pixel: Vector2<f64>, noise: Matrix2<f64>, velocity: Vector2<f64>, alike_px: f64) -> Interpolated {
        let covariance = noise + velocity * velocity.transpose() * (self.jitter_s * self.jitter_s);
        Interpolated { pixel, covariance, velocity, alike_px }
    }
}

/// Covariance of what all cameras err by alike [px^2].
fn alike(std_px: f64) -> Matrix2<f64> {
    Matrix2::identity() * std_px.powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_frames_noise_averages_out_and_what_is_alike_does_not() {
        let sample = |k: i32| Sample {
            time_s: f64::from(k),
            centre: Some((Vector2::new(f64::from(k), 0.0), Matrix2::new(0.05, 0.01, 0.01, 0.02) + alike(0.1))),
            alike_px: 0.1,
        };
        let track = Track::new((0..4).map(sample).collect(), 0.0);
        let between = track.at(1.5).unwrap();
        // Weights of the cubic half way: -1/16, 9/16, 9/16, -1/16.
        let averaged = Matrix2::new(0.05, 0.01, 0.01, 0.02) * (164.0 / 256.0);
        approx::assert_relative_eq!(between.covariance, averaged + alike(0.1), epsilon = 1e-12);
        approx::assert_relative_eq!(between.pixel, Vector2::new(1.5, 0.0), epsilon = 1e-12);
        approx::assert_relative_eq!(between.alike_px, 0.1, epsilon = 1e-12);
    }
}
