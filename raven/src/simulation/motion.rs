//! Motions of a lab session, as set-points over time: moves of minimum jerk between poses, holds, and sums of sines.
//!
//! Poses and amplitudes are parts of each joint's range, so that they fit any robot file. For the nominal robot the sinusoid is the
//! paper's: the shoulder swings by 26 deg to either side.

use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;
use rand::{Rng, RngExt};

use super::controller::SetPoint;
use crate::{Error, Result};

/// What the robot, or the board, does in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// A checkerboard before the cameras; no robot.
    Board,
    /// The robot rests in its hard stop.
    Hardstop,
    /// All joints swing.
    Sinusoid,
    /// Point to point as in surgical training, with a number for the trial.
    Fls(u32),
    /// Slow poses over the range from both sides under a small multisine of 0.07 to 4.6 Hz.
    Rich,
    /// Moves of several speeds and a multisine for a drive whose joint is measured.
    Bench,
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Board => f.write_str("board"),
            Self::Hardstop => f.write_str("hardstop"),
            Self::Sinusoid => f.write_str("sinusoid"),
            Self::Fls(0) => f.write_str("fls"),
            Self::Fls(trial) => write!(f, "fls{trial}"),
            Self::Rich => f.write_str("rich"),
            Self::Bench => f.write_str("bench"),
        }
    }
}

impl FromStr for Motion {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let trial = text.strip_prefix("fls").map(|number| if number.is_empty() { Ok(0) } else { number.parse() });
        Ok(match (text, trial) {
            ("board", _) => Self::Board,
            ("hardstop", _) => Self::Hardstop,
            ("sinusoid", _) => Self::Sinusoid,
            ("rich", _) => Self::Rich,
            ("bench", _) => Self::Bench,
            (_, Some(Ok(trial))) => Self::Fls(trial),
            _ => {
                return Err(Error::Argument(format!(
                    "--motion `{text}` is not known; there are board, hardstop, sinusoid, fls, fls1 (another trial), rich and bench."
                )));
            }
        })
    }
}

/// One move of minimum jerk, and the hold after it up to the next move's start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Move {
    start_s: f64,
    duration_s: f64,
    to: Vector3<f64>,
}

/// One line of a multisine.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Line {
    frequency_hz: f64,
    amplitude: Vector3<f64>,
    phase: Vector3<f64>,
}

/// Set-points over time, from rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    start: Vector3<f64>,
    moves: Vec<Move>,
    lines: Vec<Line>,
    /// Amplitude of the lines grows from nothing over this [s].
    fade_s: f64,
}

/// Limits of the joints [rad, rad, m].
pub type Limits = [[f64; 2]; 3];

impl Trajectory {
    /// Stays at a pose.
    #[must_use]
    pub fn rest(joint: Vector3<f64>) -> Self {
        Self { start: joint, moves: Vec::new(), lines: Vec::new(), fade_s: 1.0 }
    }

    /// The motion of a recording of `duration_s`, within `limits`. The board's and the hard stop's is rest at `hard_stop`.
    #[must_use]
    pub fn of(motion: Motion, duration_s: f64, limits: &Limits, hard_stop: Vector3<f64>, rng: &mut impl Rng) -> Self {
        let range = Range(*limits);
        match motion {
            Motion::Board | Motion::Hardstop => Self::rest(hard_stop),
            Motion::Sinusoid => Self::sinusoid(&range),
            Motion::Fls(_) => Self::point_to_point(&range, duration_s, rng),
            Motion::Rich => Self::rich(&range, duration_s, rng),
            Motion::Bench => Self::bench(&range, duration_s, rng),
        }
    }

    /// Appends a move to `to` after a hold at the last pose.
    #[must_use]
    pub fn then(mut self, hold_s: f64, duration_s: f64, to: Vector3<f64>) -> Self {
        let start_s = self.end_s() + hold_s;
        self.moves.push(Move { start_s, duration_s, to });
        self
    }

    /// When the last move ends [s].
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.moves.last().map_or(0.0, |m| m.start_s + m.duration_s)
    }

    /// First set-point.
    #[must_use]
    pub fn start(&self) -> Vector3<f64> {
        self.start
    }

    /// Set-point at a time from the start [s].
    #[must_use]
    pub fn at(&self, time_s: f64) -> SetPoint {
        let mut set = SetPoint { joint: self.start, rate: Vector3::zeros() };
        let current = self.moves.partition_point(|m| m.start_s <= time_s);
        if let Some(index) = current.checked_sub(1) {
            let step = self.moves[index];
            let from = index.checked_sub(1).map_or(self.start, |before| self.moves[before].to);
            let (part, slope) = minimum_jerk((time_s - step.start_s) / step.duration_s);
            set.joint = from + (step.to - from) * part;
            set.rate = (step.to - from) * (slope / step.duration_s);
        }
        let (fade, fade_slope) = minimum_jerk(time_s / self.fade_s);
        for line in &self.lines {
            let turn = TAU * line.frequency_hz;
            let angle = line.phase.map(|p| turn * time_s + p);
            let wave = line.amplitude.zip_map(&angle, |a, x| a * x.sin());
            set.joint += wave * fade;
            set.rate += line.amplitude.zip_map(&angle, |a, x| a * turn * x.cos()) * fade + wave * (fade_slope / self.fade_s);
        }
        set
    }

    fn sinusoid(range: &Range) -> Self {
        let swing = range.size(Sinusoid::SWING);
        let line = |j: usize| {
            let mut amplitude = Vector3::zeros();
            amplitude[j] = swing[j];
            Line { frequency_hz: Sinusoid::HZ[j], amplitude, phase: Vector3::zeros() }
        };
        Self { lines: (0..3).map(line).collect(), fade_s: 2.0, ..Self::rest(range.at(Sinusoid::CENTRE)) }
    }

    /// Rounds of reaching, lowering, working, lifting and carrying between stations; every round has its own pace.
    fn point_to_point(range: &Range, duration_s: f64, rng: &mut impl Rng) -> Self {
        let mut station = |depth: f64| range.at([rng.random_range(0.30..0.80), rng.random_range(0.25..0.70), depth]);
        let stations: Vec<_> = (0..6).map(|_| station(0.36)).collect();
        let mut path = Self::rest(stations[0]);
        let lower = range.size([0.0, 0.0, -0.10]);
        while path.end_s() < duration_s {
            let pace = rng.random_range(0.7..1.6);
            let over = stations[rng.random_range(0..stations.len())];
            path = path.then(rng.random_range(0.2..0.6), 1.2 * pace, over).then(0.15, 0.7 * pace, over + lower);
            for _ in 0..rng.random_range(0..4) {
                let reach = range.size([0.05, 0.05, 0.04]);
                let stir = reach.map(|r| r * rng.random_range(-1.0..1.0));
                path = path.then(rng.random_range(0.05..0.4), 0.4 * pace, over + lower + stir);
            }
            path = path.then(rng.random_range(0.3..0.9), 0.7 * pace, over);
        }
        path
    }

    /// Poses up and down each joint's range, the other joints elsewhere each time, and the multisine on top.
    fn rich(range: &Range, duration_s: f64, rng: &mut impl Rng) -> Self {
        let (move_s, hold_s) = (1.6, 0.7);
        let mut path = Self::rest(range.at([0.42, 0.48, 0.33]));
        let rounds = (duration_s / (move_s + hold_s)).ceil() as usize;
        let inner = [[0.16, 0.82], [0.18, 0.80], [0.16, 0.47]];
        for round in 0..rounds {
            // One joint walks its range up and down in eight poses while the others take any place.
            let (walker, place) = (round / 8 % 3, round % 8);
            let part = if place < 4 { place as f64 / 3.0 } else { (7 - place) as f64 / 3.0 };
            let parts = std::array::from_fn(|j| {
                let inside = if j == walker { part } else { rng.random_range(0.0..1.0) };
                inner[j][0] + inside * (inner[j][1] - inner[j][0])
            });
            path = path.then(hold_s, move_s, range.at(parts));
        }
        Self { lines: multisine(range, rng), ..path }
    }

    fn bench(range: &Range, duration_s: f64, rng: &mut impl Rng) -> Self {
        let mut path = Self::rest(range.at([0.5; 3]));
        while path.end_s() < duration_s {
            let to = range.at(std::array::from_fn(|_| rng.random_range(0.1..0.9)));
            path = path.then(rng.random_range(0.1..0.6), rng.random_range(0.5..3.0), to);
        }
        Self { lines: multisine(range, rng), ..path }
    }
}

/// The lab's sinusoid; shoulder, elbow and insertion each have a sine of their own.
#[derive(Debug, Clone, Copy)]
pub struct Sinusoid;

impl Sinusoid {
    /// About what part of their ranges the joints swing.
    pub const CENTRE: [f64; 3] = [0.50, 0.50, 0.30];
    /// To either side, as a part of the range.
    pub const SWING: [f64; 3] = [26.0 / 90.0, 0.25, 0.15];
    /// [Hz].
    pub const HZ: [f64; 3] = [0.11, 0.083, 0.13];
}

/// Frequencies of a multisine [Hz]: six from 0.07 to 4.6, each as many times the one before.
#[must_use]
pub fn multisine_hz() -> [f64; 6] {
    let (lowest_hz, highest_hz) = (0.07_f64, 4.6_f64);
    std::array::from_fn(|i| lowest_hz * (highest_hz / lowest_hz).powf(i as f64 / 5.0))
}

/// Lines with equal peak speeds, a few thousandths of the range at the fastest.
fn multisine(range: &Range, rng: &mut impl Rng) -> Vec<Line> {
    multisine_hz()
        .into_iter()
        .map(|frequency_hz| {
            let part = (0.012 / frequency_hz).min(0.03);
            let phase = Vector3::from_fn(|_, _| rng.random_range(0.0..TAU));
            Line { frequency_hz, amplitude: range.size([part, part, 0.6 * part]), phase }
        })
        .collect()
}

/// Position and velocity of a move of minimum jerk from 0 to 1 over unit time (Flash, Hogan 1985).
#[must_use]
pub fn minimum_jerk(time: f64) -> (f64, f64) {
    let t = time.clamp(0.0, 1.0);
    (t * t * t * (10.0 + t * (6.0 * t - 15.0)), 30.0 * t * t * (1.0 - t) * (1.0 - t))
}

/// The joints' ranges.
struct Range(Limits);

impl Range {
    fn at(&self, parts: [f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|j, _| self.0[j][0] + parts[j] * (self.0[j][1] - self.0[j][0]))
    }

    fn size(&self, parts: [f64; 3]) -> Vector3<f64> {
        Vector3::from_fn(|j, _| parts[j] * (self.0[j][1] - self.0[j][0]))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const LIMITS: Limits = [[0.0, FRAC_PI_2], [FRAC_PI_4, 3.0 * FRAC_PI_4], [0.23, 0.56]];

    #[test]
    fn every_motion_stays_within_the_limits_and_starts_at_rest() {
        let stop = Vector3::new(0.0, 2.3998, 0.562);
        for motion in [Motion::Sinusoid, Motion::Fls(0), Motion::Rich, Motion::Bench] {
            for seed in 0..20 {
                let path = Trajectory::of(motion, 60.0, &LIMITS, stop, &mut ChaCha8Rng::seed_from_u64(seed));
                assert_eq!(path.at(0.0), SetPoint { joint: path.start(), rate: Vector3::zeros() });
                for k in 0..6000 {
                    let set = path.at(f64::from(k) * 0.01);
                    for (j, [low, high]) in LIMITS.iter().enumerate() {
                        assert!(set.joint[j] > *low && set.joint[j] < *high, "{motion} {seed}: joint {j} at {}", set.joint[j]);
                    }
                }
            }
        }
    }

    #[test]
    fn the_rate_is_the_slope_of_the_position() {
        for motion in [Motion::Sinusoid, Motion::Fls(1), Motion::Rich, Motion::Bench] {
            let path = Trajectory::of(motion, 20.0, &LIMITS, Vector3::zeros(), &mut ChaCha8Rng::seed_from_u64(3));
            for k in 1..1900 {
                let time_s = f64::from(k) * 0.01 + 0.0037;
                let slope = (path.at(time_s + 1e-6).joint - path.at(time_s - 1e-6).joint) / 2e-6;
                assert!((slope - path.at(time_s).rate).amax() < 1e-6);
            }
        }
    }

    #[test]
    fn the_shoulder_of_the_sinusoid_swings_by_26_degrees() {
        let path = Trajectory::of(Motion::Sinusoid, 60.0, &LIMITS, Vector3::zeros(), &mut ChaCha8Rng::seed_from_u64(0));
        let angles: Vec<f64> = (0..6000).map(|k| path.at(f64::from(k) * 0.01).joint[0].to_degrees()).collect();
        let swing = angles.iter().fold(0.0_f64, |most, a| most.max((a - 45.0).abs()));
        assert!((swing - 26.0).abs() < 0.05, "{swing}");
    }

    #[test]
    fn names_read_back() {
        for name in ["board", "hardstop", "sinusoid", "fls", "fls3", "rich", "bench"] {
            assert_eq!(name.parse::<Motion>().unwrap().to_string(), name);
        }
        assert!("flsx".parse::<Motion>().unwrap_err().to_string().contains("sinusoid"));
    }
}
