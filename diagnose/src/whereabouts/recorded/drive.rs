//! Channels of drives, and the models behind them: an arm's, with what its cables pull, and a bench's, with the load that was measured.

use nalgebra::Vector3;
use raven::Result;
use raven::effects::{BenchModel, Driven, Shaft, TorqueModel};
use raven::log::Recording;
use raven::robot::Robot;

use super::motion::{Drives, missed};
use super::torque::noise_of_torque;
use super::{Channel, HORIZONS_S, Kind, Track, bench_factors};
use crate::evidence::recorded::bench::Bench;
use crate::evidence::recorded::noise::far_apart;
use crate::evidence::recorded::torques::CREEP_RAD_S;

/// What samples may depend on.
type Factors = Vec<(Kind, Vec<f64>)>;

/// Drives of an arm. Whatever the motors do, its cables pull by as much more than those of links that follow rigidly as they do where the motors
/// move as recorded.
pub(super) struct OfArm<'a> {
    model: &'a TorqueModel,
    /// Of each sample [N].
    beyond_rigid_n: Vec<Vector3<f64>>,
}

impl<'a> OfArm<'a> {
    /// With the cables' tension differences [N] at the samples as recorded, as far as they are known.
    pub(super) fn new(model: &'a TorqueModel, shafts: &[Shaft], tensions_n: &[Option<Vector3<f64>>]) -> Self {
        let beyond = |(shaft, tension): (&Shaft, &Option<Vector3<f64>>)| tension.map_or_else(Vector3::zeros, |n| n - model.rigid_n(shaft));
        Self { model, beyond_rigid_n: shafts.iter().zip(tensions_n).map(beyond).collect() }
    }
}

impl Drives for OfArm<'_> {
    fn delivered(&self, _: usize, shaft: &Shaft) -> Vector3<f64> {
        self.model.delivered(&shaft.commanded)
    }

    fn needed(&self, sample: usize, shaft: &Shaft) -> Vector3<f64> {
        let beyond_n = self.beyond_rigid_n.get(sample).copied().unwrap_or_default();
        self.model.needed(shaft, &(self.model.rigid_n(shaft) + beyond_n))
    }

    fn creep(&self) -> Vector3<f64> {
        Vector3::repeat(CREEP_RAD_S)
    }

    fn count(&self) -> usize {
        3
    }
}

/// Drives of a bench.
pub(super) struct OfBench<'a> {
    pub model: &'a BenchModel<'a>,
    /// As recorded.
    pub driven: &'a [Driven],
    pub creep: Vector3<f64>,
    pub count: usize,
}

impl OfBench<'_> {
    fn moved(&self, sample: usize, shaft: &Shaft) -> Driven {
        let load = self.driven.get(sample).map_or_else(Vector3::zeros, |driven| driven.load);
        Driven { shaft: *shaft, load, joint: None }
    }
}

impl Drives for OfBench<'_> {
    fn delivered(&self, sample: usize, shaft: &Shaft) -> Vector3<f64> {
        self.model.delivered(&self.moved(sample, shaft))
    }

    fn needed(&self, sample: usize, shaft: &Shaft) -> Vector3<f64> {
        self.model.needed(&self.moved(sample, shaft))
    }

    fn creep(&self) -> Vector3<f64> {
        self.creep
    }

    fn count(&self) -> usize {
        self.count
    }
}

/// Adds a recording's motor motion, horizon by horizon; of torques that err by `noise` [N m or N], at worst all the time.
pub(super) fn motion_tracks(
    motions: &mut [Channel],
    drives: &dyn Drives,
    shafts: &[Shaft],
    noise: &[f64],
    factors: &dyn Fn(usize, &[Shaft]) -> Factors,
) {
    let horizons: Vec<f64> = HORIZONS_S.into_iter().flatten().collect();
    for (k, &horizon_s) in horizons.iter().enumerate() {
        let missed = missed(drives, shafts, horizon_s);
        let ends: Vec<Shaft> = missed.iter().map(|missed| shafts[missed.last]).collect();
        for (j, channel) in motions.iter_mut().skip(k).step_by(horizons.len()).enumerate() {
            channel.tracks.push(Track {
                time_s: ends.iter().map(|shaft| shaft.time_s).collect(),
                error: missed.iter().map(|missed| missed.away[j]).collect(),
                noise: missed.iter().map(|missed| missed.by_method[j].hypot(missed.per_torque[j] * noise[j])).collect(),
                factors: factors(j, &ends),
            });
        }
    }
}

/// Noise of each joint's torque in the recording that was added last; zero where none of its samples counts.
pub(super) fn last_noise(torques: &[Channel]) -> Vec<f64> {
    let of = |channel: &Channel| channel.tracks.last().and_then(|track| track.noise.first().copied()).unwrap_or(0.0);
    torques.iter().map(of).collect()
}

/// Torque or force and motion of a bench's drives, where torque was recorded.
pub(super) fn bench_drives(robot: &Robot, recordings: &[Recording], torques: &mut [Channel], motions: &mut [Channel]) -> Result<()> {
    let (bench, transmission) = (Bench::new(robot, recordings)?, robot.bench_transmission()?);
    let model = bench.model(&[], 0)?;
    let model = BenchModel::new(&model, bench.creep())?;
    let factors = |j: usize, shafts: &[Shaft]| match robot.joints.get(j) {
        Some(joint) => {
            let time_s: Vec<f64> = shafts.iter().map(|s| s.time_s).collect();
            let rate: Vec<f64> = shafts.iter().map(|s| s.rate[j] / joint.ratio()).collect();
            let angles: Vec<f64> = shafts.iter().map(|s| s.angle[j]).collect();
            bench_factors(joint, j, &transmission, &time_s, &rate, &angles)
        }
        None => Vec::new(),
    };
    let errors = bench.errors(&[], &[raven::effects::Channel::Torque])?;
    for (r, (recorded, (errors, _))) in bench.recordings().iter().zip(errors).enumerate().filter(|(_, (recorded, _))| recorded.has[0]) {
        let shafts: Vec<Shaft> = recorded.driven.iter().map(|driven| driven.shaft).collect();
        let apart = far_apart(shafts.iter().map(|shaft| shaft.time_s));
        for (j, channel) in torques.iter_mut().enumerate() {
            let lacking: Vec<f64> = apart.iter().map(|&k| errors[k][1][j]).collect();
            let commanded: Vec<f64> = apart.iter().map(|&k| shafts[k].commanded.mean()[j]).collect();
            let noise = noise_of_torque(&lacking, &commanded);
            let counted: Vec<usize> = apart.iter().copied().filter(|&k| bench.weights(r)[k][1][j] > 0.0).collect();
            let kept: Vec<Shaft> = counted.iter().map(|&k| shafts[k]).collect();
            channel.tracks.push(Track {
                time_s: kept.iter().map(|shaft| shaft.time_s).collect(),
                error: counted.iter().map(|&k| errors[k][1][j]).collect(),
                noise: vec![noise; kept.len()],
                factors: factors(j, &kept),
            });
        }
        let drives = OfBench { model: &model, driven: &recorded.driven, creep: bench.creep(), count: robot.joints.len() };
        motion_tracks(motions, &drives, &shafts, &last_noise(torques), &factors);
    }
    Ok(())
}
