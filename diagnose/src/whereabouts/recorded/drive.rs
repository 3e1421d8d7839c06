//! Channels of drives, and the models behind them: an arm's, whose links follow rigidly, and a bench's, with the load that was measured.

use nalgebra::Vector3;
use raven::Result;
use raven::effects::{BenchModel, Driven, Shaft, TorqueModel};
use raven::log::Recording;
use raven::robot::Robot;

use super::motion::{Drives, missed};
use super::torque::{far_apart, noise_of_torque};
use super::{Channel, HORIZONS_S, Kind, Track, bench_factors};
use crate::evidence::recorded::bench::Bench;
use crate::evidence::recorded::torques::CREEP_RAD_S;

/// What samples may depend on.
type Factors = Vec<(Kind, Vec<f64>)>;

/// Drives of an arm.
pub(super) struct OfArm<'a>(pub &'a TorqueModel);

impl Drives for OfArm<'_> {
    fn delivered(&self, _: usize, shaft: &Shaft) -> Vector3<f64> {
        self.0.delivered(&shaft.commanded)
    }

    fn needed(&self, _: usize, shaft: &Shaft) -> Vector3<f64> {
        self.0.needed(shaft, &self.0.rigid_n(shaft))
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

/// Adds a recording's motor motion, horizon by horizon.
pub(super) fn motion_tracks(motions: &mut [Channel], drives: &dyn Drives, shafts: &[Shaft], factors: &dyn Fn(usize, &[Shaft]) -> Factors) {
    let horizons: Vec<f64> = HORIZONS_S.into_iter().flatten().collect();
    for (k, &horizon_s) in horizons.iter().enumerate() {
        let missed = missed(drives, shafts, horizon_s);
        let ends: Vec<Shaft> = missed.iter().map(|(end, _)| shafts[*end]).collect();
        for (j, channel) in motions.iter_mut().skip(k).step_by(horizons.len()).enumerate() {
            channel.tracks.push(Track {
                time_s: ends.iter().map(|shaft| shaft.time_s).collect(),
                error: missed.iter().map(|(_, away)| away[j]).collect(),
                // Nothing in a log says how noisy its motors' torque is.
                noise: vec![0.0; ends.len()],
                factors: factors(j, &ends),
            });
        }
    }
}

/// Torque or force and motion of a bench's drives, where torque was recorded.
pub(super) fn bench_drives(robot: &Robot, recordings: &[Recording], torques: &mut [Channel], motions: &mut [Channel]) -> Result<()> {
    let (bench, transmission) = (Bench::new(robot, recordings)?, robot.bench_transmission()?);
    let model = bench.model(&[])?;
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
        motion_tracks(motions, &drives, &shafts, &factors);
    }
    Ok(())
}
