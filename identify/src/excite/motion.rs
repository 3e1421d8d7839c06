//! Set points of an exciting motion: segments that begin and end at rest, and moves of minimum jerk between them.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use raven::robot::{JointType, MotorTrack, Robot, Transmission};
use raven::simulation::{CYCLE_S, Trajectory, minimum_jerk};

/// Fastest motion that is proposed, of a revolute and a prismatic joint [rad/s, m/s]: a third at most of what 790 rad/s of the motors, at
/// which the public simulator clips, make of them.
const SPEED_MAX: [f64; 2] = [1.0, 0.1];
/// Time over which waves grow and fade [s].
const FADE_S: f64 = 1.0;
/// Peak speed of a move of minimum jerk over its mean speed.
const PEAK: f64 = 1.875;

/// Speed limits of the joints of a robot [rad/s, rad/s, m/s].
#[must_use]
pub fn speed_max(robot: &Robot) -> Vector3<f64> {
    Vector3::from_fn(|j, _| SPEED_MAX[usize::from(robot.joints.get(j).is_some_and(|joint| joint.kind == JointType::Prismatic))])
}

/// One sine of all joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// [Hz].
    pub frequency_hz: Vector3<f64>,
    /// [rad, rad, m].
    pub amplitude: Vector3<f64>,
    /// [rad].
    pub phase: Vector3<f64>,
}

/// A piece of motion from rest to rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    path: Trajectory,
    waves: Vec<Wave>,
    duration_s: f64,
    /// Part of the excursion that the speed limits leave.
    kept: Vector3<f64>,
}

impl Segment {
    /// A path with waves on top for `duration_s`, its excursions shrunk until no joint is faster than `speed_max`.
    #[must_use]
    pub fn new(path: Trajectory, waves: Vec<Wave>, duration_s: f64, speed_max: &Vector3<f64>) -> Self {
        let mut segment = Self { path, waves, duration_s, kept: Vector3::repeat(1.0) };
        let fastest = segment.fastest();
        segment.kept = Vector3::from_fn(|j, _| if fastest[j] > speed_max[j] { speed_max[j] / fastest[j] } else { 1.0 });
        segment
    }

    /// First set point; the last one is [`Self::at`] the duration.
    #[must_use]
    pub fn start(&self) -> Vector3<f64> {
        self.at(0.0)
    }

    /// Set point [rad, rad, m] at a time from the segment's start [s].
    #[must_use]
    pub fn at(&self, time_s: f64) -> Vector3<f64> {
        let time_s = time_s.clamp(0.0, self.duration_s);
        let fade = minimum_jerk(time_s.min(self.duration_s - time_s) / FADE_S).0;
        let wave = |w: &Wave| Vector3::from_fn(|j, _| w.amplitude[j] * (TAU * w.frequency_hz[j] * time_s + w.phase[j]).sin());
        let start = self.path.start();
        let excursion = self.path.at(time_s).joint - start + self.waves.iter().map(wave).sum::<Vector3<f64>>() * fade;
        start + excursion.component_mul(&self.kept)
    }

    /// Largest speed of each joint.
    fn fastest(&self) -> Vector3<f64> {
        let step_s = 5.0 * CYCLE_S;
        let steps = (self.duration_s / step_s) as usize;
        let speed = |i: usize| (self.at((i + 1) as f64 * step_s) - self.at(i as f64 * step_s)).abs() / step_s;
        (0..steps).map(speed).fold(Vector3::zeros(), |most, v| most.sup(&v))
    }
}

/// Segments one after the other.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plan {
    placed: Vec<Placed>,
}

/// A segment with the move that leads to it.
#[derive(Debug, Clone, PartialEq)]
struct Placed {
    from_s: f64,
    approach: Trajectory,
    segment: Segment,
}

impl Plan {
    /// Appends a segment.
    #[must_use]
    pub fn then(mut self, segment: Segment, speed_max: &Vector3<f64>) -> Self {
        let (from_s, to) = (self.duration_s(), segment.start());
        let from = if self.placed.is_empty() { to } else { self.at(from_s) };
        let approach_s = ((to - from).abs().component_div(speed_max).max() * PEAK).max(CYCLE_S);
        self.placed.push(Placed { from_s, approach: Trajectory::rest(from).then(0.0, approach_s, to), segment });
        self
    }

    /// Length [s].
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.placed.last().map_or(0.0, |p| p.from_s + p.approach.end_s() + p.segment.duration_s)
    }

    /// Set point [rad, rad, m] at a time [s]; at rest before and after.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Vector3<f64> {
        let index = self.placed.partition_point(|p| p.from_s <= time_s).saturating_sub(1);
        self.placed.get(index).map_or_else(Vector3::zeros, |placed| {
            let local_s = time_s - placed.from_s;
            let approach_s = placed.approach.end_s();
            if local_s < approach_s { placed.approach.at(local_s).joint } else { placed.segment.at(local_s - approach_s) }
        })
    }
}

/// The motors of a robot that follows set points exactly, once per control cycle.
#[must_use]
pub fn motors(transmission: &Transmission, duration_s: f64, set_point: impl Fn(f64) -> Vector3<f64>) -> MotorTrack {
    let time_s: Vec<f64> = (0..=(duration_s / CYCLE_S).round() as usize).map(|i| i as f64 * CYCLE_S).collect();
    let angle = time_s.iter().map(|&t| transmission.motor_from_joint(&set_point(t))).collect();
    MotorTrack { time_s, angle }
}
