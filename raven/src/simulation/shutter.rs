//! When the cameras look, and what they say about it.
//!
//! Both run free: each has its own phase and its own idea of a second. A frame's stamp is the middle of its exposure plus the latency
//! that the lab does not know, plus jitter. Some frames never arrive, and now and then something comes between camera and marker.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::effect::{Effect, EffectKind};
use crate::log::Side;
use crate::robot::Observation;

/// Standard deviation of a stamp [s].
const JITTER_S: f64 = 0.001;
/// Part of the frames that never arrive.
const DROPPED: f64 = 0.005;
/// A camera's clock runs fast or slow by at most this part.
const CLOCK_ERROR: f64 = 5e-5;
/// Shortest and longest time that something hides the marker [s].
const HIDDEN_S: [f64; 2] = [0.3, 1.5];

/// Delays between the world and the stamps of its images.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Delays {
    /// Of both images [s].
    pub latency_s: f64,
    /// Growth per second.
    pub drift: f64,
    /// Of the right image beyond the left [s].
    pub right_minus_left_s: f64,
    /// From the first row to the last [s].
    pub readout_s: f64,
}

impl Delays {
    /// The delay that a robot file corrects, and those that effects cause.
    #[must_use]
    pub fn of(corrected: &Observation, effects: &[Effect]) -> Self {
        let sum = |kind| effects.iter().filter(|e| e.kind == kind).map(|e| e.values[0]).sum::<f64>();
        Self {
            latency_s: corrected.latency + sum(EffectKind::TimeOffset),
            drift: sum(EffectKind::ClockDrift),
            right_minus_left_s: sum(EffectKind::StereoDesync),
            readout_s: sum(EffectKind::RollingShutter),
        }
    }

    /// What to add to the middle of an exposure at `time_s` to have the stamp [s].
    #[must_use]
    pub fn of_image(&self, side: Side, time_s: f64) -> f64 {
        let beyond = match side {
            Side::Left => 0.0,
            Side::Right => self.right_minus_left_s,
        };
        self.latency_s + self.drift * time_s + beyond
    }

    /// When a row of `rows` is exposed, relative to the middle row [s].
    #[must_use]
    pub fn of_row(&self, row: f64, rows: u32) -> f64 {
        self.readout_s * ((row + 0.5) / f64::from(rows) - 0.5)
    }
}

/// One frame that arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Its number since the camera started, gaps included.
    pub sequence: u32,
    /// Middle of the exposure [s].
    pub time_s: f64,
    /// What its stamp says [s].
    pub stamp_s: f64,
    /// Whether something hides the marker from this camera.
    pub hidden: bool,
}

/// A time during which something is between the marker and a camera, or both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hiding {
    from_s: f64,
    to_s: f64,
    left: bool,
    right: bool,
}

impl Hiding {
    /// Whether the marker is hidden from a camera at a time [s].
    #[must_use]
    pub fn hides(&self, side: Side, time_s: f64) -> bool {
        let from_this = match side {
            Side::Left => self.left,
            Side::Right => self.right,
        };
        from_this && (self.from_s..self.to_s).contains(&time_s)
    }
}

/// The frames of one camera over a recording.
#[must_use]
pub fn exposures(side: Side, duration_s: f64, rate_hz: f64, delays: &Delays, hidden: &[Hiding], rng: &mut impl Rng) -> Vec<Exposure> {
    let period_s = (1.0 + rng.random_range(-CLOCK_ERROR..CLOCK_ERROR)) / rate_hz;
    let first_s = rng.random_range(0.0..period_s);
    let count = ((duration_s - first_s) / period_s).ceil().max(0.0) as u32;
    (0..count)
        .filter_map(|sequence| {
            let time_s = first_s + f64::from(sequence) * period_s;
            let jitter: f64 = StandardNormal.sample(rng);
            let dropped = rng.random_bool(DROPPED);
            let stamp_s = time_s + delays.of_image(side, time_s) + JITTER_S * jitter.clamp(-3.0, 3.0);
            let hidden = hidden.iter().any(|hiding| hiding.hides(side, time_s));
            (!dropped).then_some(Exposure { sequence, time_s, stamp_s, hidden })
        })
        .collect()
}

/// Times during which something hides the marker from at least one camera, for `part` of the recording on average.
#[must_use]
pub fn hidings(duration_s: f64, part: f64, rng: &mut impl Rng) -> Vec<Hiding> {
    let [shortest, longest] = HIDDEN_S;
    let mut hidings = Vec::new();
    let mut now = 0.0;
    if part <= 0.0 {
        return hidings;
    }
    // Mean time in sight between two blocks, so that blocks are `part` of the whole.
    let between = 0.5 * (shortest + longest) * (1.0 - part) / part;
    loop {
        let from_s = now + between * rng.random_range(0.2..1.8);
        now = from_s + rng.random_range(shortest..longest);
        if from_s >= duration_s {
            return hidings;
        }
        let side = rng.random_range(0..3);
        hidings.push(Hiding { from_s, to_s: now, left: side != 1, right: side != 0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::truth::stream;

    #[test]
    fn cameras_run_free_and_lose_a_frame_now_and_then() {
        let mut rng = stream(1, "frames");
        let both = Side::BOTH.map(|side| exposures(side, 300.0, 15.0, &Delays::default(), &[], &mut rng));
        for frames in &both {
            let lost = 4500 - frames.len() as i64;
            // 22 on average.
            assert!((5..=45).contains(&lost), "{lost} lost");
            let gap = frames.windows(2).map(|w| w[1].sequence - w[0].sequence).max();
            assert!(gap >= Some(2));
            let late: Vec<f64> = frames.iter().map(|f| f.stamp_s - f.time_s).collect();
            let spread = (late.iter().map(|l| l * l).sum::<f64>() / late.len() as f64).sqrt();
            assert!((0.9e-3..1.1e-3).contains(&spread), "{spread}");
        }
        assert!((both[0][0].time_s - both[1][0].time_s).abs() > 1e-3);
    }

    #[test]
    fn the_marker_is_hidden_for_the_part_asked_for() {
        let hidings = hidings(20_000.0, 0.1, &mut stream(2, "hidden"));
        let hidden: f64 = hidings.iter().map(|h| h.to_s - h.from_s).sum();
        assert!((hidden / 20_000.0 - 0.1).abs() < 0.01, "{hidden}");
        assert!(hidings.iter().all(|h| h.left || h.right));
        assert!(super::hidings(100.0, 0.0, &mut stream(2, "hidden")).is_empty());
    }
}
