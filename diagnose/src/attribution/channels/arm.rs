//! An arm's channels: its tip, what that says of the joints, and its torques.

use nalgebra::{Matrix3, Vector3};
use raven::Result;
use raven::effects::{Channel, Shaft, TipModel, TorqueModel};

use super::{Measured, Sample, Sampled};
use crate::evidence::recorded::noise::{far_apart, white_noise_of};
use crate::evidence::recorded::rows::{Inflation, Observed, Rows};
use crate::evidence::recorded::settings::Setting;

/// Place of the tip among the channels; the joints come before, their torques after.
const TIP: usize = 3;

impl Sampled for Rows<'_> {
    fn measured(&self) -> Vec<Measured> {
        let joints = &self.robot().joints[..3];
        let mut all = Vec::new();
        for joint in joints {
            let (unit, scale) = joint.display_unit();
            all.push(Measured { name: joint.name.clone(), unit, scale, side: Channel::Tip, signed: true });
        }
        all.push(Measured { name: "tip".to_owned(), unit: "mm", scale: 1e3, side: Channel::Tip, signed: false });
        let torque = |name: &str| Measured { name: format!("{name} torque"), unit: "N m", scale: 1.0, side: Channel::Torque, signed: true };
        all.extend(joints.iter().map(|joint| torque(&joint.name)));
        all
    }

    fn samples(&self, settings: &[Setting]) -> Result<Vec<Sample>> {
        let nominal = self.robot().arm()?;
        let transmission = &nominal.transmission;
        let mut samples = Vec::new();
        for (recording, data) in self.data().iter().enumerate() {
            let model = self.model(settings, recording)?;
            let torque = TorqueModel::new(&model)?;
            let (seen, tensions) = TipModel::new(&model, &data.motors)?.rolled_out(&data.sights, &data.shafts);
            for (sight, seen) in data.sights.iter().zip(seen) {
                let time_s = sight.stamp_s;
                let Some(motor) = data.motors.steady(time_s) else { continue };
                let rate = transmission.joint_rate_from_motor(&motor.rate);
                let error = seen.map_or_else(|| Vector3::repeat(f64::NAN), |seen| sight.position_m - seen);
                let slope = nominal.kinematics.jacobian(&transmission.joint_from_motor(&motor.angle)).try_inverse();
                let slope = slope.unwrap_or_else(Matrix3::zeros);
                let (joint, covariance) = (slope * error, slope * sight.covariance_m2 * slope.transpose());
                let of = |channel, error, variance, rate| Sample { channel, recording, time_s, error, variance, rate };
                samples.extend((0..3).map(|j| of(j, joint[j], covariance[(j, j)], rate[j])));
                samples.push(of(TIP, error.norm(), sight.covariance_m2.trace(), 0.0));
            }
            let lacking = |(shaft, tension): (&Shaft, &Option<Vector3<f64>>)| torque.lacking(shaft, tension.as_ref());
            let errors: Vec<Vector3<f64>> = data.shafts.iter().zip(&tensions).map(lacking).collect();
            let apart = far_apart(data.shafts.iter().map(|shaft| shaft.time_s));
            let weights = self.torque_weights(recording);
            let noise = [0, 1, 2].map(|j| white_noise_of(&apart, |k| (weights[k][j] > 0.0).then(|| errors[k][j])));
            for ((shaft, error), weight) in data.shafts.iter().zip(&errors).zip(weights) {
                let rate = transmission.joint_rate_from_motor(&shaft.rate);
                let of = |j: usize| Sample {
                    channel: TIP + 1 + j,
                    recording,
                    time_s: shaft.time_s,
                    error: error[j],
                    variance: noise[j].powi(2),
                    rate: rate[j],
                };
                samples.extend((0..3).filter(|&j| weight[j] > 0.0).map(of));
            }
        }
        Ok(samples)
    }

    fn reweighted(&self, settings: &[Setting]) -> Result<Option<Box<dyn Sampled + '_>>> {
        Ok(Rows::reweighted(self, settings)?.map(|rows| Box::new(rows) as Box<dyn Sampled>))
    }

    fn only(&self, keep: &dyn Fn(f64) -> bool) -> Box<dyn Observed + '_> {
        Box::new(self.inflated(|_, time_s| {
            let inflation = if keep(time_s) { 1.0 } else { f64::INFINITY };
            Inflation { tip: inflation, torque: Vector3::repeat(inflation) }
        }))
    }
}
