//! Residuals of one quantity over time, and the error of a model that was set right one horizon ago.
//!
//! ```text
//! e_h(t) = r(t) - r(t - h)      variance of its noise: n(t)^2 + n(t - h)^2
//! ```
//!
//! Over the whole recording `e(t) = r(t)`. A horizon that the sampling cannot resolve is not offered.

use raven::effects::Stage;
use raven::stats::median;

use super::bins::Kind;

/// Horizons in seconds; the whole recording, `None`, comes first.
pub const HORIZONS_S: [Option<f64>; 5] = [None, Some(0.05), Some(0.2), Some(1.0), Some(5.0)];

/// A recording has to be this many horizons long for the horizon to be offered.
const HORIZONS_MIN: f64 = 6.0;

/// Residuals of one quantity in all recordings.
#[derive(Debug, Clone)]
pub struct Channel {
    /// The part of the way from torque to image that it closes.
    pub stage: Stage,
    /// Joint; `None` for the tip.
    pub joint: Option<String>,
    /// Name: `elbow`, `elbow torque`, `left u`, `tip x`.
    pub name: String,
    /// Unit of reports.
    pub unit: &'static str,
    /// Takes the residuals to `unit`.
    pub scale: f64,
    /// The residuals are those of a model that was set right so long before [s]; `None` for residuals over the whole recording.
    pub horizon_s: Option<f64>,
    /// Unit of positions and, per second, of speeds.
    pub position_unit: &'static str,
    /// One per recording, all with the same kinds of factors.
    pub tracks: Vec<Track>,
}

/// Residuals of one recording; all columns have the same length.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// [s], increasing.
    pub time_s: Vec<f64>,
    /// Measured less modelled.
    pub error: Vec<f64>,
    /// Standard deviation of the measurement's noise; 0 where nothing says how noisy it is.
    pub noise: Vec<f64>,
    /// What the error may depend on, sample by sample; see [`Kind`] for the meaning. NaN where it is not known.
    pub factors: Vec<(Kind, Vec<f64>)>,
}

/// The error at one horizon, recordings one after the other.
#[derive(Debug, Clone, Default)]
pub(super) struct Anchored {
    /// Index among the channel's samples, counted through all tracks.
    pub sample: Vec<usize>,
    pub error: Vec<f64>,
    /// Standard deviation of the noise.
    pub noise: Vec<f64>,
    /// Whether the sample does not follow the one before: a new recording, or a gap.
    pub fresh: Vec<bool>,
    /// Median sampling interval [s].
    pub interval_s: f64,
    /// Where each recording's samples start.
    pub starts: Vec<usize>,
}

impl Channel {
    /// The error at a horizon; `None` where it cannot be seen.
    pub(super) fn anchored(&self, horizon_s: Option<f64>) -> Option<Anchored> {
        let steps: Vec<f64> = self.tracks.iter().flat_map(|t| t.time_s.windows(2).map(|w| w[1] - w[0])).collect();
        let interval_s = median(&steps).filter(|&step| step > 0.0)?;
        let mut all = Anchored { interval_s, ..Anchored::default() };
        let mut before = 0;
        for track in &self.tracks {
            all.starts.push(all.error.len());
            match horizon_s {
                None => (0..track.error.len()).for_each(|k| all.push(track, before, k, None)),
                Some(h) if h >= 0.999 * interval_s && track.duration_s() >= HORIZONS_MIN * h => {
                    for k in 0..track.error.len() {
                        if let Some(anchor) = track.nearest(track.time_s[k] - h, 0.501 * interval_s) {
                            all.push(track, before, k, Some(anchor));
                        }
                    }
                }
                Some(_) => {}
            }
            before += track.error.len();
        }
        (!all.error.is_empty()).then_some(all)
    }
}

impl Track {
    fn duration_s(&self) -> f64 {
        self.time_s.first().zip(self.time_s.last()).map_or(0.0, |(first, last)| last - first)
    }

    fn nearest(&self, time_s: f64, within_s: f64) -> Option<usize> {
        let after = self.time_s.partition_point(|&t| t < time_s);
        let away = |k: &usize| (self.time_s[*k] - time_s).abs();
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten().filter(|&k| k < self.time_s.len());
        near.min_by(|a, b| away(a).total_cmp(&away(b))).filter(|k| away(k) <= within_s)
    }
}

impl Anchored {
    fn push(&mut self, track: &Track, before: usize, k: usize, anchor: Option<usize>) {
        let (error, noise) = match anchor {
            None => (track.error[k], track.noise[k]),
            Some(a) => (track.error[k] - track.error[a], track.noise[k].hypot(track.noise[a])),
        };
        let last = self.sample.last().filter(|_| self.starts.last() != Some(&self.error.len()));
        let follows = last.is_some_and(|&last| last + 1 == before + k && track.time_s[k] - track.time_s[k - 1] <= 1.5 * self.interval_s);
        self.sample.push(before + k);
        self.error.push(error);
        self.noise.push(noise);
        self.fresh.push(!follows);
    }
}
