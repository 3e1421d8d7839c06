//! Motions to choose from. Each shows something that the others do not:
//!
//! | motion | shows |
//! |---|---|
//! | the lab's sinusoid | radii: much travel |
//! | slow poses up and down one joint's range | stiffness by gravity, friction by the direction of approach |
//! | six sines of 0.07 to 4.6 Hz | damping and stiffness by inertia, latency |
//! | reversals near the limits | friction, and radii by the distance from the hard stop |

use std::f64::consts::TAU;

use nalgebra::Vector3;
use raven::simulation::{Limits, Sinusoid, Trajectory, multisine_hz};

use super::motion::{Segment, Wave};

/// Part of the range that the multisine's lines and reversals may sweep.
const SWEEP: f64 = 0.04;
/// Phases that never line up: the golden section of a turn.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A kind of motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Candidate {
    /// The lab's.
    Sinusoid,
    /// Up and down the range of one joint, the others at a part of theirs.
    Poses(usize, f64),
    /// The same with the multisine on top.
    ShakenPoses(usize, f64),
    /// About a part of the ranges.
    Multisine([f64; 3]),
    /// To and fro about a part of the ranges.
    Reversals(f64),
}

/// All there are.
pub const ALL: [Candidate; 12] = [
    Candidate::Sinusoid,
    Candidate::Poses(0, 0.3),
    Candidate::Poses(1, 0.3),
    Candidate::Poses(2, 0.3),
    Candidate::ShakenPoses(0, 0.3),
    Candidate::ShakenPoses(1, 0.3),
    Candidate::ShakenPoses(2, 0.3),
    Candidate::Multisine([0.5, 0.5, 0.5]),
    Candidate::Multisine([0.8, 0.2, 0.3]),
    Candidate::Multisine([0.2, 0.8, 0.3]),
    Candidate::Reversals(0.12),
    Candidate::Reversals(0.88),
];

impl Candidate {
    /// In words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Sinusoid => "sinusoid".to_owned(),
            Self::Poses(joint, part) => format!("slow poses up and down joint {}, the others at {:.0} %", joint + 1, 100.0 * part),
            Self::ShakenPoses(joint, part) => format!("{}, under the multisine", Self::Poses(joint, part).name()),
            Self::Multisine([a, b, c]) => format!("multisine about {:.0}, {:.0}, {:.0} % of the ranges", 100.0 * a, 100.0 * b, 100.0 * c),
            Self::Reversals(part) => format!("reversals near {:.0} % of the ranges", 100.0 * part),
        }
    }

    /// This motion for `duration_s` within `limits`.
    #[must_use]
    pub fn segment(self, duration_s: f64, limits: &Limits, speed_max: &Vector3<f64>) -> Segment {
        let range = Vector3::from_fn(|j, _| limits[j][1] - limits[j][0]);
        let at = |parts: [f64; 3]| Vector3::from_fn(|j, _| limits[j][0] + parts[j] * range[j]);
        let poses = |joint: usize, part: f64| {
            let pose = |own: f64| at(std::array::from_fn(|j| if j == joint { own } else { part }));
            let stops = [0.39, 0.64, 0.87, 0.64, 0.39, 0.13];
            let step_s = duration_s / stops.len() as f64;
            let walk = |path: Trajectory, own: f64| path.then(0.3 * step_s, 0.7 * step_s, pose(own));
            stops.into_iter().fold(Trajectory::rest(pose(0.13)), walk)
        };
        let lines_hz = multisine_hz();
        let line = |(line, &frequency_hz): (usize, &f64)| {
            let by_speed = speed_max / (lines_hz.len() as f64 * TAU * frequency_hz);
            let phase = Vector3::from_fn(|j, _| TAU * GOLDEN * (3 * line + j) as f64);
            Wave { frequency_hz: Vector3::repeat(frequency_hz), amplitude: by_speed.inf(&(range * (0.6 * SWEEP))), phase }
        };
        let multisine = lines_hz.iter().enumerate().map(line).collect();
        let (path, waves) = match self {
            Self::Sinusoid => {
                let amplitude = range.component_mul(&Vector3::from(Sinusoid::SWING));
                let wave = Wave { frequency_hz: Sinusoid::HZ.into(), amplitude, phase: Vector3::zeros() };
                (Trajectory::rest(at(Sinusoid::CENTRE)), vec![wave])
            }
            Self::Poses(joint, part) => (poses(joint, part), Vec::new()),
            Self::ShakenPoses(joint, part) => (poses(joint, part), multisine),
            Self::Multisine(parts) => (Trajectory::rest(at(parts)), multisine),
            Self::Reversals(part) => {
                let count = (duration_s / 1.5).floor().max(2.0) as usize / 2 * 2;
                let step_s = duration_s / count as f64;
                let turn = |path: Trajectory, i: usize| {
                    let to = if i.is_multiple_of(2) { part + SWEEP } else { part - SWEEP };
                    path.then(0.2 * step_s, 0.8 * step_s, at([to; 3]))
                };
                ((0..count).fold(Trajectory::rest(at([part - SWEEP; 3])), turn), Vec::new())
            }
        };
        Segment::new(path, waves, duration_s, speed_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excite::motion::{Plan, speed_max};
    use raven::robot::nominal;

    #[test]
    fn all_of_them_in_a_row_keep_to_the_limits() {
        let robot = nominal::gold();
        let (limits, fastest) = (robot.arm().unwrap().limits, speed_max(&robot));
        let plan = ALL.iter().fold(Plan::default(), |plan, c| plan.then(c.segment(10.0, &limits, &fastest), &fastest));
        let step_s = 2e-3;
        let mut before = plan.at(0.0);
        for i in 1..(plan.duration_s() / step_s) as usize {
            let now = plan.at(i as f64 * step_s);
            for (j, [low, high]) in limits.iter().enumerate() {
                assert!((*low..=*high).contains(&now[j]), "joint {j} at {} after {} s", now[j], i as f64 * step_s);
                let speed = (now[j] - before[j]).abs() / step_s;
                assert!(speed <= 1.01 * fastest[j], "joint {j} at a speed of {speed} after {} s", i as f64 * step_s);
            }
            before = now;
        }
    }
}
