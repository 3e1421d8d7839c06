//! Torque that the drives delivered less what their motion needed.

use nalgebra::Vector3;
use raven::effects::{Shaft, TorqueModel};
use raven::robot::{Arm, Joint};
use raven::stats::rms;

use super::{Track, joint_factors};
use crate::evidence::recorded::noise::{far_apart, white_noise};
use crate::evidence::recorded::torques::{CREEP_RAD_S, TORQUE_MODEL, surely_moving};

/// Torque delivered less torque needed where the direction of friction is beyond doubt; with each sample the cables' tension differences [N].
pub(super) fn torque_track(arm: &Arm, joint: &Joint, j: usize, model: &TorqueModel, shafts: &[(Shaft, Vector3<f64>)]) -> Track {
    let apart: Vec<&(Shaft, Vector3<f64>)> =
        far_apart(shafts.iter().map(|(shaft, _)| shaft.time_s)).into_iter().map(|k| &shafts[k]).collect();
    let all_time_s: Vec<f64> = apart.iter().map(|(s, _)| s.time_s).collect();
    let rates: Vec<f64> = apart.iter().map(|(s, _)| arm.transmission.joint_rate_from_motor(&s.rate)[j]).collect();
    let residual: Vec<f64> = apart.iter().map(|(s, tension)| model.lacking(s, Some(tension))[j]).collect();
    let commanded: Vec<f64> = apart.iter().map(|(s, _)| s.commanded.mean()[j]).collect();
    let noise = noise_of_torque(&residual, &commanded);
    let motors: Vec<Option<Vector3<f64>>> = apart.iter().map(|(s, _)| Some(s.angle)).collect();
    let factors = joint_factors(arm, joint, j, &motors, &all_time_s, &rates);
    let kept: Vec<usize> = (0..apart.len()).filter(|&k| surely_moving(&apart[k].0, j, CREEP_RAD_S)).collect();
    let pick = |column: &[f64]| kept.iter().map(|&k| column[k]).collect::<Vec<f64>>();
    Track {
        time_s: pick(&all_time_s),
        error: pick(&residual),
        noise: vec![noise; kept.len()],
        factors: factors.iter().map(|(kind, values)| (*kind, pick(values))).collect(),
    }
}

/// What noise and the model's own errors leave of a torque whose samples are far apart.
pub(super) fn noise_of_torque(residual: &[f64], commanded: &[f64]) -> f64 {
    white_noise(residual).hypot(TORQUE_MODEL * rms(commanded).unwrap_or(0.0))
}
