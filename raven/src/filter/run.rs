//! A filter and smoother over a whole log: motor angles at the robot's rate, tip observations at their own times.

use nalgebra::{Const, Matrix3, SVector, Vector3};

use super::{Innovation, Smoothed, SmootherStep, SquareRootUkf, StateEquation, Turned, smooth};
use crate::robot::{Kinematics, MotorTrack, PAUSE_MAX_S};
use crate::stats::chi_square_quantile;

/// A tip seen by the cameras, at the time the robot had it there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipAt {
    /// [s], on the motor's clock, latency taken out.
    pub time_s: f64,
    /// Frame 0 [m].
    pub position: Vector3<f64>,
    /// [m^2].
    pub covariance: Matrix3<f64>,
}

/// Joint positions over time with their covariances.
#[derive(Debug, Clone, Default)]
pub struct JointTrack {
    /// [s].
    pub time_s: Vec<f64>,
    /// [rad, rad, m].
    pub joints: Vec<Vector3<f64>>,
    /// Lower-triangular factors of the joints' covariances [rad, rad, m].
    pub factor: Vec<Matrix3<f64>>,
}

/// What filter and smoother made of a log.
#[derive(Debug, Clone, Default)]
pub struct FilterRun {
    /// With the observations up to each time.
    pub filtered: JointTrack,
    /// With all observations.
    pub smoothed: JointTrack,
    /// Time and innovation of every tip that was offered, accepted or not.
    pub innovations: Vec<(f64, Innovation<3>)>,
    /// Tips that were not offered: their covariance is none.
    pub without_covariance: usize,
    /// Tips that were passed over in the log's pauses.
    pub in_pauses: usize,
    /// Pauses in the log after which the filter started anew.
    pub restarts: usize,
    /// What of the filtered joints' deviations is alike in all tips: rms [rad, rad, m]; see [`Self::with_shared`].
    pub shared_std: Option<Vector3<f64>>,
}

/// Time between estimates [s]. The model is integrated through every motor sample in between; no motion here changes within it.
pub const KNOT_S: f64 = 5e-3;

/// Chance that a good observation is refused by the gate.
const GATE_REFUSES: f64 = 1e-6;

/// False tips come alone or in twos. After so many refusals in a row it is the filter that errs, and the next tip is taken in.
pub(super) const REFUSALS_MAX: usize = 3;

/// A stretch of steady motor motion.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// That drives the states [rad], and its velocity [rad/s].
    driving: (Vector3<f64>, Vector3<f64>),
    /// Velocity that the encoders saw [rad/s].
    rate: Vector3<f64>,
    duration_s: f64,
}

/// Runs a filter with `N` states over a log. Tips must be sorted by time; those outside the log and in its pauses are passed over.
#[must_use]
pub fn run<const N: usize>(equation: &impl StateEquation<N>, kinematics: &Kinematics, motor: &MotorTrack, tips: &[TipAt]) -> FilterRun {
    let mut out = FilterRun::default();
    let driving = equation.driving(motor);
    let mut pending = tips;
    let mut start = 0;
    while start < motor.time_s.len() {
        let pause = (start + 1..motor.time_s.len()).find(|&k| motor.time_s[k] - motor.time_s[k - 1] > PAUSE_MAX_S);
        let end = pause.unwrap_or(motor.time_s.len());
        let passed = pending.partition_point(|tip| tip.time_s <= motor.time_s[start]);
        // What comes before the log is in no pause.
        out.in_pauses += if start > 0 { passed } else { 0 };
        let due = pending.partition_point(|tip| tip.time_s <= motor.time_s[end - 1]);
        Stretch::new(equation, kinematics, &driving.angle[start], motor.time_s[start]).run(
            [motor, &driving],
            start..end,
            &pending[passed.min(due)..due],
            &mut out,
        );
        pending = &pending[due..];
        out.restarts += usize::from(pause.is_some());
        start = end;
    }
    out
}

/// One stretch of a log without pauses.
struct Stretch<'a, const N: usize, E> {
    equation: &'a E,
    kinematics: &'a Kinematics,
    filter: SquareRootUkf<Const<N>, 3>,
    gate: Option<f64>,
    /// Tips refused since the last one that was accepted.
    refusals: usize,
    /// Motion since the last estimate.
    pieces: Vec<Piece>,
    times: Vec<f64>,
    filtered: Vec<Smoothed<N>>,
    steps: Vec<SmootherStep<N>>,
}

impl<'a, const N: usize, E: StateEquation<N>> Stretch<'a, N, E> {
    fn new(equation: &'a E, kinematics: &'a Kinematics, motor: &Vector3<f64>, time_s: f64) -> Self {
        let (mean, factor) = equation.initial(motor);
        Self {
            equation,
            kinematics,
            filter: SquareRootUkf::new(mean, factor),
            gate: chi_square_quantile(3, 1.0 - GATE_REFUSES),
            refusals: 0,
            pieces: Vec::new(),
            times: vec![time_s],
            filtered: vec![Smoothed { mean, factor }],
            steps: Vec::new(),
        }
    }

    fn run(mut self, [motor, driving]: [&MotorTrack; 2], samples: std::ops::Range<usize>, tips: &[TipAt], out: &mut FilterRun) {
        let mut pending = tips.iter().peekable();
        for k in samples.start + 1..samples.end {
            let (from, now) = (motor.time_s[k - 1], motor.time_s[k]);
            let rate_of = |track: &MotorTrack| (track.angle[k] - track.angle[k - 1]) / (now - from);
            let (rate, driving_rate) = (rate_of(motor), rate_of(driving));
            let piece = |at: f64, to: f64| Piece {
                driving: (driving.angle[k - 1] + driving_rate * (at - from), driving_rate),
                rate,
                duration_s: to - at,
            };
            let mut at = from;
            while let Some(tip) = pending.next_if(|tip| tip.time_s <= now) {
                self.pieces.push(piece(at, tip.time_s));
                at = tip.time_s;
                self.advance(at);
                self.observe(tip, out);
            }
            self.pieces.push(piece(at, now));
            if now - self.times[self.times.len() - 1] >= KNOT_S || k + 1 == samples.end {
                self.advance(now);
            }
        }
        let last = self.filtered[self.filtered.len() - 1];
        out.filtered.append(self.equation, &self.times, &self.filtered);
        out.smoothed.append(self.equation, &self.times, &smooth(&self.steps, last));
    }

    fn advance(&mut self, time_s: f64) {
        let total_s: f64 = self.pieces.iter().map(|piece| piece.duration_s).sum();
        if total_s > 0.0 {
            let (equation, pieces) = (self.equation, &self.pieces);
            let turned = Turned {
                seen: pieces.iter().map(|piece| piece.rate.abs() * piece.duration_s).sum(),
                driving: pieces.iter().map(|piece| piece.driving.1.abs() * piece.duration_s).sum(),
            };
            let step = |x, piece: &Piece| equation.transition(&x, &piece.driving.0, &piece.driving.1, piece.duration_s);
            let along = |x: &SVector<f64, N>| pieces.iter().fold(*x, step);
            self.steps.push(self.filter.predict_recorded(along, &equation.noise_factor(total_s, &turned)));
            self.times.push(time_s);
            self.filtered.push(Smoothed { mean: self.filter.mean, factor: self.filter.factor });
        }
        self.pieces.clear();
    }

    fn observe(&mut self, tip: &TipAt, out: &mut FilterRun) {
        let Some(noise) = tip.covariance.cholesky() else {
            out.without_covariance += 1;
            return;
        };
        let (equation, kinematics) = (self.equation, self.kinematics);
        let gate = self.gate.filter(|_| self.refusals < REFUSALS_MAX);
        let claimed = noise.l();
        let seen = |x: &SVector<f64, N>| kinematics.forward(&equation.joints(x)) + equation.persistent_error(x, &claimed);
        let innovation = self.filter.update(&tip.position, seen, &(claimed * equation.new_part()), gate);
        self.refusals = if innovation.accepted { 0 } else { self.refusals + 1 };
        out.innovations.push((tip.time_s, innovation));
        if let Some(last) = self.filtered.last_mut() {
            *last = Smoothed { mean: self.filter.mean, factor: self.filter.factor };
        }
    }
}

impl JointTrack {
    fn append<const N: usize>(&mut self, equation: &impl StateEquation<N>, times: &[f64], states: &[Smoothed<N>]) {
        self.time_s.extend(times);
        self.joints.extend(states.iter().map(|state| equation.joints(&state.mean)));
        // The joints come first in every state, so the factor's first block is the factor of their covariance.
        self.factor.extend(states.iter().map(|state| state.factor.fixed_view::<3, 3>(0, 0).into_owned()));
    }

    /// Standard deviations [rad, rad, m] of every estimate.
    pub fn std(&self) -> impl Iterator<Item = Vector3<f64>> {
        self.factor.iter().map(|factor| Vector3::from_fn(|j, _| factor.row(j).norm()))
    }
}
