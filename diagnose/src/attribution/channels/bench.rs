//! A bench's channels: its joints' encoders, and its drives' torque or force.

use raven::Result;
use raven::effects::{Channel, Measure};

use super::{Measured, Sample, Sampled};
use crate::evidence::recorded::bench::Bench;
use crate::evidence::recorded::noise::{far_apart, white_noise_of};
use crate::evidence::recorded::rows::{ALL, Observed};
use crate::evidence::recorded::settings::Setting;

impl Sampled for Bench<'_> {
    fn measured(&self) -> Vec<Measured> {
        let robot = self.robot();
        let mut all = Vec::new();
        for joint in &robot.joints {
            let (unit, scale) = joint.display_unit();
            all.push(Measured { name: joint.name.clone(), unit, scale, side: Channel::Tip, signed: true });
        }
        for (j, joint) in robot.joints.iter().enumerate() {
            let unit = Measure::of(robot, j, 1.0, 1.0).unit("drive torque");
            let what = if unit == "N" { "force" } else { "torque" };
            all.push(Measured { name: format!("{} {what}", joint.name), unit, scale: 1.0, side: Channel::Torque, signed: true });
        }
        all
    }

    fn samples(&self, settings: &[Setting]) -> Result<Vec<Sample>> {
        let joints = self.robot().joints.len();
        let mut samples = Vec::new();
        for (recording, (errors, _)) in self.errors(settings, &ALL)?.into_iter().enumerate() {
            let recorded = &self.recordings()[recording];
            let apart = far_apart(recorded.driven.iter().map(|driven| driven.shaft.time_s));
            let weights = self.weights(recording);
            let noise = |j: usize| white_noise_of(&apart, |k| (weights[k][1][j] > 0.0).then(|| errors[k][1][j]));
            let noise: Vec<f64> = (0..joints).map(noise).collect();
            for ((driven, [position, torque, _]), weights) in recorded.driven.iter().zip(errors).zip(weights) {
                let rate = |j: usize| driven.shaft.rate[j] / self.robot().joints[j].ratio();
                let of = |channel, j: usize, error, variance| Sample {
                    channel,
                    recording,
                    time_s: driven.shaft.time_s,
                    error,
                    variance,
                    rate: rate(j),
                };
                let counted = |k: usize| (0..joints).filter(move |&j| weights[k][j] > 0.0);
                samples.extend(counted(0).map(|j| of(j, j, position[j], recorded.joint_noise[j].powi(2))));
                samples.extend(counted(1).map(|j| of(joints + j, j, torque[j], noise[j].powi(2))));
            }
        }
        Ok(samples)
    }

    fn only(&self, keep: &dyn Fn(f64) -> bool) -> Box<dyn Observed + '_> {
        Box::new(self.clone().weighted(|_, time_s| if keep(time_s) { 1.0 } else { 0.0 }))
    }
}
