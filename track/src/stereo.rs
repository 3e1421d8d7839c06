//! Both cameras' tracks on one clock: what the left one sees in a frame, and what the right one saw then.
//!
//! Stamps scatter about each camera's own [pace](crate::pace). Whether frames do so too, or their stamps alone, the marker's own motion
//! tells: with `a` the part of the scatter `s` that is real, a frame misses the cubic through its neighbours by
//!
//! ```text
//! r_k = a (v_k s_k - sum_j w_j v_j s_j) + noise
//! ```
//!
//! so that frames were taken at `pace + a s`, give or take `a (1 - a)` of its variance. A right image that shows `d` more of the past than a
//! left one of the same stamp was taken `d` before its stamp says.
//!
//! What a camera's response moves centres by is claimed as all of its frames tell: see [`crate::response`].

use nalgebra::{Matrix2, Vector2};
use raven::log::Stamp;

use crate::interpolate::{Interpolated, LONGEST_STEP, Sample, Track};
use crate::look::Candidate;
use crate::pace::{Pace, pace};
use crate::response::Response;
use crate::tracker::Record;

/// Tracks of both cameras.
#[derive(Debug, Clone)]
pub struct StereoTrack {
    origin: Stamp,
    left_s: Vec<f64>,
    tracks: [Track; 2],
    jitter_s: [f64; 2],
}

impl StereoTrack {
    /// From what was seen in the frames, left and right. With `jitter_s` [s] the stamps are taken as they are and to scatter by that much.
    #[must_use]
    pub fn new(records: &[Vec<Record>; 2], jitter_s: Option<f64>, right_minus_left_s: f64) -> Self {
        let origin = records.iter().flatten().map(|r| r.stamp).min().unwrap_or_default();
        let paces = records.each_ref().map(|records| {
            let stamps_s: Vec<f64> = records.iter().map(|r| r.stamp.seconds_since(origin)).collect();
            jitter_s.map_or_else(|| pace(&stamps_s), |jitter_s| Pace { time_s: stamps_s.clone(), std_s: jitter_s, jitter_s })
        });
        let of_side = |side: usize, early_s: f64| {
            let (pace, records) = (&paces[side], &records[side]);
            let bent = Response::part(records.iter().filter_map(|record| record.sighting.seen().map(|seen| &seen.response)));
            let at = |time_s: &[f64]| -> Vec<Sample> {
                records.iter().zip(time_s).map(|(record, &time_s)| sample(record, time_s, bent)).collect()
            };
            let scatter_s: Vec<f64> = records.iter().zip(&pace.time_s).map(|(r, t)| r.stamp.seconds_since(origin) - t).collect();
            let real = Real::of(&at(&pace.time_s), &scatter_s);
            let time_s: Vec<f64> = pace.time_s.iter().zip(&scatter_s).map(|(t, s)| t + real.part * s).collect();
            let early: Vec<f64> = time_s.iter().map(|t| t - early_s).collect();
            (Track::new(at(&early), (pace.std_s.powi(2) + real.variance * pace.jitter_s.powi(2)).sqrt()), time_s)
        };
        let ((left, left_s), (right, _)) = (of_side(0, 0.0), of_side(1, right_minus_left_s));
        Self { origin, left_s, tracks: [left, right], jitter_s: [paces[0].jitter_s, paces[1].jitter_s] }
    }

    /// Left frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.left_s.len()
    }

    /// When a left frame was taken, on the clock of its stamps.
    #[must_use]
    pub fn stamp(&self, frame: usize) -> Stamp {
        self.origin.plus_seconds(self.left_s[frame])
    }

    /// What both cameras see at a left frame; `None` where the marker was not seen.
    #[must_use]
    pub fn at_left(&self, frame: usize) -> [Option<Interpolated>; 2] {
        self.tracks.each_ref().map(|track| track.at(self.left_s[frame]))
    }

    /// Standard deviation of the stamps about the cameras' pace, left and right [s].
    #[must_use]
    pub const fn jitter_s(&self) -> [f64; 2] {
        self.jitter_s
    }
}

/// What a frame shows, with such a part of a bent response.
fn sample(record: &Record, time_s: f64, bent: f64) -> Sample {
    let Some(&Candidate { centre, noise_px2, response, .. }) = record.sighting.seen() else {
        return Sample { time_s, centre: None, alike_px: 0.0 };
    };
    let alike_px = response.alike_px(bent);
    Sample { time_s, centre: Some((centre, noise_px2 + Matrix2::identity() * alike_px.powi(2))), alike_px }
}

/// How much of the stamps' scatter about the pace is the frames' own.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Real {
    /// `a`.
    part: f64,
    /// What remains unknown of a frame's time, in units of the scatter's variance.
    variance: f64,
}

/// Standard deviation of the part before anything moves: sensors run by a crystal, so none is the likeliest.
const PART_STD: f64 = 0.5;
/// Misses beyond so many standard deviations come from elsewhere.
const MISS_SIGMAS: f64 = 4.0;

impl Real {
    /// From a track at the pace's times and the scatter of its stamps [s].
    fn of(samples: &[Sample], scatter_s: &[f64]) -> Self {
        let times: Vec<f64> = samples.iter().map(|s| s.time_s).collect();
        let longest_s = LONGEST_STEP * raven::stats::median_step(&times).unwrap_or(0.0);
        let (mut information, mut along) = (PART_STD.powi(-2), 0.0);
        for (five, scatter_s) in samples.windows(5).zip(scatter_s.windows(5)) {
            let joined = five.windows(2).all(|w| w[1].time_s - w[0].time_s <= longest_s);
            let seen: Option<Vec<(Vector2<f64>, Matrix2<f64>)>> = five.iter().map(|s| s.centre).collect();
            let Some(seen) = seen.filter(|_| joined) else { continue };
            let times: Vec<f64> = five.iter().map(|s| s.time_s).collect();
            // Weights of the four around the middle one, which is what is predicted: -1.
            let weights: Vec<f64> = (0..5)
                .map(|i| {
                    let others = (0..5).filter(|&j| j != i && j != 2);
                    if i == 2 { -1.0 } else { others.map(|j| (times[2] - times[j]) / (times[i] - times[j])).product() }
                })
                .collect();
            let velocity = |i: usize| {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(4));
                (seen[after].0 - seen[before].0) / (times[after] - times[before])
            };
            let miss: Vector2<f64> = -(0..5).map(|i| seen[i].0 * weights[i]).sum::<Vector2<f64>>();
            let slope: Vector2<f64> = -(0..5).map(|i| velocity(i) * (weights[i] * scatter_s[i])).sum::<Vector2<f64>>();
            let variance: f64 = (0..5).map(|i| 0.5 * weights[i].powi(2) * seen[i].1.trace()).sum();
            if miss.norm_squared() < 2.0 * MISS_SIGMAS * MISS_SIGMAS * variance {
                information += slope.norm_squared() / variance;
                along += slope.dot(&miss) / variance;
            }
        }
        let part = (along / information).clamp(0.0, 1.0);
        Self { part, variance: part * (1.0 - part) + 1.0 / information }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::tracker::Sighting;

    /// A marker on a circle, 100 px/s, and frames of which a part of the stamps' scatter is real.
    fn film(real: f64, seed: u64) -> (Vec<Record>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let one = |n: u32| {
            let (own, late) = (1e-3 * real.sqrt() * normal(), 1e-3 * (1.0 - real).sqrt() * normal());
            let time_s = 1.0 + f64::from(n) / 15.0 + own;
            let noise = Vector2::new(normal(), normal()) * 0.08;
            let centre = Vector2::new(300.0 + 60.0 * (1.6 * time_s).sin(), 200.0 + 60.0 * (1.6 * time_s).cos()) + noise;
            let candidate = Candidate {
                centre,
                noise_px2: Matrix2::identity() * 0.08_f64.powi(2),
                response: Response::default(),
                radius_px: 8.0,
                share: 1.0,
            };
            (Record { stamp: Stamp(0).plus_seconds(time_s + late), sighting: Sighting::Seen(candidate) }, time_s)
        };
        (0..600).map(one).unzip()
    }

    #[test]
    fn the_markers_motion_tells_whether_frames_or_stamps_scatter() {
        for (real, most_s) in [(0.0, 0.35e-3), (1.0, 0.35e-3), (0.5, 0.65e-3)] {
            let (records, truth_s) = film(real, 1);
            let stereo = StereoTrack::new(&[records.clone(), records], None, 0.0);
            let squares: f64 = (0..600).map(|i| (stereo.stamp(i).seconds_since(Stamp(0)) - truth_s[i]).powi(2)).sum();
            let off_s = (squares / 600.0).sqrt();
            assert!(off_s < most_s, "{real} of the scatter real: frames off by {off_s} s");
        }
    }

    #[test]
    fn a_track_errs_by_what_its_covariance_says() {
        let mut sum = 0.0;
        for seed in 0..6 {
            let real = [0.0, 0.5, 1.0][seed as usize % 3];
            let (records, truth_s) = film(real, seed);
            let stereo = StereoTrack::new(&[records.clone(), records], None, 0.0);
            for (i, taken_s) in truth_s.iter().enumerate().take(595).skip(5) {
                let Some(seen) = stereo.at_left(i)[0] else { continue };
                // The time that the track names, not the one at which the frame was taken, is where the marker is compared.
                let named_s = stereo.stamp(i).seconds_since(Stamp(0));
                let at = Vector2::new(300.0 + 60.0 * (1.6 * named_s).sin(), 200.0 + 60.0 * (1.6 * named_s).cos());
                let error = seen.pixel - at;
                sum += error.dot(&seen.covariance.try_inverse().unwrap_or_default().tr_mul(&error)) / (2.0 * 590.0 * 6.0);
                assert!((taken_s - named_s).abs() < 4e-3);
            }
        }
        assert!((0.7..1.4).contains(&sum), "squared error over covariance, per axis: {sum}");
    }
}
