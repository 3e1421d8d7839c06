//! Motor motion: where the motors come to within a horizon when the recorded torque drives the model, from where they were recorded to be.
//!
//! ```text
//! A qdd = tau - n(q, qd),   n = even + odd s,   A e_j = n(q, qd, e_j) - n(q, qd, 0)
//! ```
//!
//! `n` is what the model needs at no acceleration; its part that turns with the direction `s` of motion is friction, and takes speed away
//! at each step but never turns it (Moreau 1988). Cables pull as they do in the motion as recorded. The error of a torque is integrated twice on the way: the
//! longer the horizon, the less it says of where an error arose, and the more of what a simulation will be off by.

use nalgebra::{Matrix3, Vector3};
use raven::effects::Shaft;
use rayon::prelude::*;

use crate::evidence::recorded::data::WINDOW_S;

/// Steps between two torque samples.
const STEPS: usize = 8;
/// Torque samples farther apart than this are not followed [s].
const PAUSE_S: f64 = WINDOW_S;
/// Times this close are one [s].
const ROUNDING_S: f64 = 1e-6;
/// Starts per horizon.
const STARTS: f64 = 2.0;

/// A model of drives, of the sample at an index and of motors that move otherwise than recorded there.
pub(super) trait Drives: Sync {
    /// What they deliver [N m or N].
    fn delivered(&self, sample: usize, shaft: &Shaft) -> Vector3<f64>;

    /// What they must deliver for that motion [N m or N].
    fn needed(&self, sample: usize, shaft: &Shaft) -> Vector3<f64>;

    /// Speeds below which the direction of friction is in doubt [rad/s or m/s].
    fn creep(&self) -> Vector3<f64>;

    /// Joints.
    fn count(&self) -> usize;
}

/// Where motors come to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Missed {
    /// The last sample before the horizon's end.
    pub last: usize,
    /// Recorded less simulated angles there.
    pub away: Vector3<f64>,
    /// The same of drives that deliver what the motion as recorded needs: what samples and steps do, whatever the model.
    pub by_method: Vector3<f64>,
    /// By a torque of one that is lacking all the time.
    pub per_torque: Vector3<f64>,
}

/// Where motors come to after `horizon_s` from starts all over a recording.
pub(super) fn missed(drives: &dyn Drives, shafts: &[Shaft], horizon_s: f64) -> Vec<Missed> {
    let needed = shafts.iter().enumerate().map(|(k, shaft)| drives.needed(k, shaft)).collect();
    let faithful = Faithful { drives, needed };
    let mut starts: Vec<usize> = Vec::new();
    for (k, shaft) in shafts.iter().enumerate() {
        if starts.last().is_none_or(|&last| shaft.time_s - shafts[last].time_s >= 0.999 * horizon_s / STARTS) {
            starts.push(k);
        }
    }
    let from = |&start: &usize| {
        let (last, away) = after(drives, shafts, start, horizon_s)?;
        let (_, by_method) = after(&faithful, shafts, start, horizon_s)?;
        let lighter = inertia(drives, last, &shafts[last]).try_inverse()?;
        Some(Missed { last, away, by_method, per_torque: lighter.diagonal() * (0.5 * horizon_s * horizon_s) })
    };
    starts.par_iter().filter_map(from).collect()
}

/// Drives that deliver what the motion as recorded needs.
struct Faithful<'a> {
    drives: &'a dyn Drives,
    /// At each sample.
    needed: Vec<Vector3<f64>>,
}

impl Drives for Faithful<'_> {
    fn delivered(&self, sample: usize, _: &Shaft) -> Vector3<f64> {
        let next = (sample + 1).min(self.needed.len() - 1);
        0.5 * (self.needed[sample] + self.needed[next])
    }

    fn needed(&self, sample: usize, shaft: &Shaft) -> Vector3<f64> {
        self.drives.needed(sample, shaft)
    }

    fn creep(&self) -> Vector3<f64> {
        self.drives.creep()
    }

    fn count(&self) -> usize {
        self.drives.count()
    }
}

/// Recorded less simulated angles after `horizon_s`, with the last sample before its end.
fn after(drives: &dyn Drives, shafts: &[Shaft], start: usize, horizon_s: f64) -> Option<(usize, Vector3<f64>)> {
    let end_s = shafts[start].time_s + horizon_s;
    // The last sample before the end, give or take a rounding.
    let last = shafts.partition_point(|shaft| shaft.time_s < end_s - ROUNDING_S).checked_sub(1)?;
    if shafts.get(start..last + 2)?.windows(2).any(|w| w[1].time_s - w[0].time_s > PAUSE_S) {
        return None;
    }
    let mut now = shafts[start];
    for k in start..=last {
        let whole_s = shafts[k + 1].time_s - shafts[k].time_s;
        let step_s = whole_s.min(end_s - shafts[k].time_s) / STEPS as f64;
        let lighter = inertia(drives, k, &now).try_inverse()?;
        for step in 0..STEPS {
            now.commanded = shafts[k].commanded.lerp(&shafts[k + 1].commanded, (step as f64 + 0.5) * step_s / whole_s);
            now = advanced(drives, k, &now, &lighter, step_s);
        }
    }
    let ahead_s = end_s - shafts[last].time_s;
    let recorded = shafts[last].angle + shafts[last].rate * ahead_s + shafts[last].acceleration * (0.5 * ahead_s * ahead_s);
    let missed = recorded - now.angle;
    missed.iter().all(|v| v.is_finite()).then_some((last, missed))
}

/// Torque per acceleration; joints that are not there are as heavy as one.
fn inertia(drives: &dyn Drives, sample: usize, shaft: &Shaft) -> Matrix3<f64> {
    let with = |acceleration: Vector3<f64>| drives.needed(sample, &Shaft { acceleration, ..*shaft });
    let rest = with(Vector3::zeros());
    let column = |j: usize| if j < drives.count() { with(Vector3::ith(j, 1.0)) - rest } else { Vector3::ith(j, 1.0) };
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

fn advanced(drives: &dyn Drives, sample: usize, now: &Shaft, lighter: &Matrix3<f64>, step_s: f64) -> Shaft {
    let way = now.rate.map(f64::signum);
    let fast = now.rate.abs().sup(&drives.creep());
    let needed =
        |side: f64| drives.needed(sample, &Shaft { rate: way.component_mul(&fast) * side, acceleration: Vector3::zeros(), ..*now });
    let (along, against) = (needed(1.0), needed(-1.0));
    let friction = (0.5 * (along - against)).component_mul(&way).map(|f| f.max(0.0));
    let pushed = now.rate + lighter * (drives.delivered(sample, now) - 0.5 * (along + against)) * step_s;
    let rate = Vector3::from_fn(|j, _| pushed[j].signum() * (pushed[j].abs() - lighter[(j, j)] * friction[j] * step_s).max(0.0));
    let present = Vector3::from_fn(|j, _| if j < drives.count() { 1.0 } else { 0.0 });
    let rate = rate.component_mul(&present);
    Shaft { rate, angle: now.angle + rate * step_s, ..*now }
}

#[cfg(test)]
mod tests {
    use raven::effects::Command;

    use super::*;

    /// One motor with inertia, a spring and dry friction.
    struct Spring {
        inertia: f64,
        spring: f64,
        dry: f64,
    }

    impl Drives for Spring {
        fn delivered(&self, _: usize, shaft: &Shaft) -> Vector3<f64> {
            shaft.commanded.mean()
        }

        fn needed(&self, _: usize, shaft: &Shaft) -> Vector3<f64> {
            let needed = self.inertia * shaft.acceleration.x + self.spring * shaft.angle.x + self.dry * shaft.rate.x.signum();
            Vector3::new(needed, 0.0, 0.0)
        }

        fn creep(&self) -> Vector3<f64> {
            Vector3::repeat(1e-3)
        }

        fn count(&self) -> usize {
            1
        }
    }

    fn shafts(seconds: f64, angle: impl Fn(f64) -> [f64; 3], torque: f64) -> Vec<Shaft> {
        let at = |k: usize| {
            let time_s = k as f64 * 0.02;
            let [angle, rate, acceleration] = angle(time_s).map(|v| Vector3::new(v, 0.0, 0.0));
            Shaft { time_s, angle, rate, acceleration, commanded: Command::steady(Vector3::new(torque, 0.0, 0.0)), window_s: 0.0 }
        };
        (0..(seconds / 0.02) as usize).map(at).collect()
    }

    #[test]
    fn a_motor_on_a_spring_swings_as_it_was_recorded() {
        let drives = Spring { inertia: 2.0, spring: 8.0, dry: 0.0 };
        // About the angle where the spring holds the torque, at 2 rad/s.
        let recorded = shafts(20.0, |t| [0.5 + (2.0 * t).sin(), 2.0 * (2.0 * t).cos(), -4.0 * (2.0 * t).sin()], 4.0);
        for horizon_s in [0.05, 1.0, 5.0] {
            let missed = missed(&drives, &recorded, horizon_s);
            // Starts are a sample apart at least.
            assert!(missed.len() as f64 > (20.0 - horizon_s) / (0.5 * horizon_s).max(0.04) - 2.0, "{}", missed.len());
            assert!(missed.iter().all(|missed| missed.away.x.abs() < 0.01), "{missed:?}");
        }
    }

    #[test]
    fn what_sticks_stays_and_what_was_not_modelled_is_missed() {
        let sticks = Spring { inertia: 1e-3, spring: 0.0, dry: 1.0 };
        let still = shafts(10.0, |_| [0.3, 0.0, 0.0], 0.9);
        assert!(missed(&sticks, &still, 5.0).iter().all(|missed| missed.away.x.abs() < 1e-12));
        // 0.5 N m on 2 kg m^2 that the recording did not follow: t^2 / 8.
        let free = Spring { inertia: 2.0, spring: 0.0, dry: 0.0 };
        for horizon_s in [0.05, 1.0] {
            let pulled = missed(&free, &shafts(10.0, |_| [0.0; 3], 0.5), horizon_s);
            let expected = -0.125 * horizon_s * horizon_s;
            // That lacks in no motion as recorded, and a torque of one makes four times as much of a quarter of it.
            assert!(pulled.iter().all(|missed| missed.by_method.x.abs() < 1e-12 && (missed.per_torque.x / -expected - 2.0).abs() < 1e-9));
            assert!(!pulled.is_empty() && pulled.iter().all(|missed| (missed.away.x / expected - 1.0).abs() < 0.06), "{pulled:?}");
        }
    }
}
