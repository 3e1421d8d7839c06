//! Channels of recordings: motor torque, motor motion, joints, and the tip.
//!
//! The motors' motion and their torque show the same residual: over a horizon it is integrated twice, see [`motion`], at once it stays
//! where it arose.

mod drive;
mod motion;
mod tip;
mod torque;

use nalgebra::Vector3;
use raven::Result;
use raven::camera::Cameras;
use raven::effects::{Measure, Model, Shaft, Stage, TipModel, TorqueModel};
use raven::log::Recording;
use raven::observation::TipCorrection;
use raven::robot::{Arm, Joint, MotorTrack, Robot, Transmission};
use raven::stats::median;

use super::{Channel, HORIZONS_S, Kind, Track};
use crate::evidence::recorded::data::Data;
use crate::phase::{Phase, phases};
use crate::residual::{self, Residuals};
use drive::{OfArm, bench_drives, last_noise, motion_tracks};
use tip::{ninth_at, ninths, pixels_known, tip_channels, tip_tracks};
use torque::torque_track;

/// Denser residuals are averaged over so long [s]: more samples say no more about motions of a few hertz.
const AVERAGED_S: f64 = 0.02;

/// All channels that recordings offer; `begun` is the robot as each begins, and `residuals` are those of its joints.
///
/// # Errors
/// If a recording has no motor angles, or the model cannot be built.
pub fn recorded(
    robot: &Robot,
    cameras: Option<&Cameras>,
    recordings: &[Recording],
    begun: &[Robot],
    residuals: &[residual::Channels],
) -> Result<Vec<Channel>> {
    let joint_channel = |joint: &Joint, stage, name: String, unit, scale| Channel {
        stage,
        joint: Some(joint.name.clone()),
        name,
        unit,
        scale,
        horizon_s: None,
        position_unit: joint.display_unit().0,
        tracks: Vec::new(),
    };
    let mut joints: Vec<Channel> = Vec::new();
    let mut torques: Vec<Channel> = Vec::new();
    // Joint by joint, horizon by horizon.
    let mut motions: Vec<Channel> = Vec::new();
    for joint in &robot.joints {
        let (unit, scale) = joint.display_unit();
        joints.push(joint_channel(joint, Stage::Transmission, joint.name.clone(), unit, scale));
        let of_drive = Measure::of(robot, joints.len() - 1, 1.0, 1.0).unit("drive torque");
        let what = if of_drive == "N" { "force" } else { "torque" };
        torques.push(joint_channel(joint, Stage::Motor, format!("{} {what}", joint.name), of_drive, 1.0));
        for horizon_s in HORIZONS_S.into_iter().flatten() {
            let channel = joint_channel(joint, Stage::Motor, format!("{} motor", joint.name), unit, scale / joint.ratio().abs());
            motions.push(Channel { horizon_s: Some(horizon_s), ..channel });
        }
    }
    let arm = robot.arm().ok();
    let seen_in_pixels = pixels_known(cameras, recordings);
    let mut tips = tip_channels(seen_in_pixels.is_some());
    for ((recording, begun), residuals) in recordings.iter().zip(begun).zip(residuals) {
        let ninths = match seen_in_pixels.zip(arm.as_ref()) {
            Some((cameras, arm)) => ninths(recording, &cameras.left, &TipCorrection::of(robot, arm)?),
            None => Vec::new(),
        };
        for (j, (channel, residuals)) in joints.iter_mut().zip(&residuals.joints).enumerate() {
            channel.tracks.push(match &arm {
                Some(arm) => joint_track(arm, &robot.joints[j], j, &recording.motor_track()?, residuals, &ninths),
                None => bench_track(recording, &robot.joints[j], j, &robot.bench_transmission()?, &averaged(residuals))?,
            });
        }
        if let Some(arm) = &arm {
            let (model, data) = (Model::new(begun, cameras)?, Data::new(recording, cameras)?);
            let model_of_torque = TorqueModel::new(&model)?;
            let (_, tensions) = TipModel::new(&model, &data.motors)?.rolled_out(&[], &data.shafts);
            let drives = OfArm::new(&model_of_torque, &data.shafts, &tensions);
            let shafts: Vec<_> = data.shafts.iter().zip(tensions).filter_map(|(shaft, tension)| Some((*shaft, tension?))).collect();
            for (j, channel) in torques.iter_mut().enumerate() {
                channel.tracks.push(torque_track(arm, &robot.joints[j], j, &model_of_torque, &shafts));
            }
            let moved = |shaft: &Shaft, j: usize| arm.transmission.joint_rate_from_motor(&shaft.rate)[j];
            let factors = |j: usize, ends: &[Shaft]| {
                let motors: Vec<Option<Vector3<f64>>> = ends.iter().map(|s| Some(s.angle)).collect();
                let (time_s, rate): (Vec<f64>, Vec<f64>) = ends.iter().map(|s| (s.time_s, moved(s, j))).unzip();
                joint_factors(arm, &robot.joints[j], j, &motors, &time_s, &rate)
            };
            motion_tracks(&mut motions, &drives, &data.shafts, &last_noise(&torques), &factors);
            let tracks = tip_tracks(&model, arm, &data, recording, seen_in_pixels, &ninths)?;
            tips.iter_mut().zip(tracks).for_each(|(channel, track)| channel.tracks.push(track));
        }
    }
    if arm.is_none() {
        bench_drives(robot, recordings, &mut torques, &mut motions)?;
    }
    let mut all = [torques, joints, tips, motions].concat();
    all.iter_mut().for_each(|channel| channel.tracks.retain(|track| !track.error.is_empty()));
    all.retain(|channel| !channel.tracks.is_empty());
    Ok(all)
}

fn phase_factor(time_s: &[f64], rate: &[f64]) -> Vec<f64> {
    let index = |phase: &Phase| Phase::ALL.iter().position(|p| p == phase).map_or(f64::NAN, |k| k as f64);
    phases(time_s, rate).iter().map(index).collect()
}

/// What an arm's joint may depend on, from the motors at `time_s`.
fn joint_factors(
    arm: &Arm,
    joint: &Joint,
    j: usize,
    motors: &[Option<Vector3<f64>>],
    time_s: &[f64],
    rate: &[f64],
) -> Vec<(Kind, Vec<f64>)> {
    let (_, scale) = joint.display_unit();
    let per_sample = |of: &dyn Fn(&Vector3<f64>) -> f64| motors.iter().map(|m| m.as_ref().map_or(f64::NAN, of)).collect::<Vec<f64>>();
    vec![
        (Kind::Phase, phase_factor(time_s, rate)),
        (Kind::Speed, rate.iter().map(|r| r.abs() * scale).collect()),
        (Kind::Load, per_sample(&|m| arm.dynamics.gravity(&arm.transmission.joint_from_motor(m))[j])),
        (Kind::Position, per_sample(&|m| arm.transmission.joint_from_motor(m)[j] * scale)),
        (Kind::Capstan, per_sample(&|m| turn(m[j], joint))),
    ]
}

fn turn(motor: f64, joint: &Joint) -> f64 {
    (motor / joint.gear_ratio / std::f64::consts::TAU).rem_euclid(1.0)
}

fn joint_track(arm: &Arm, joint: &Joint, j: usize, motor: &MotorTrack, residuals: &Residuals, ninths: &[(f64, f64)]) -> Track {
    let motors: Vec<Option<Vector3<f64>>> = residuals.time_s.iter().map(|&t| motor.at(t).map(|(angle, _)| angle)).collect();
    let mut factors = joint_factors(arm, joint, j, &motors, &residuals.time_s, &residuals.rate);
    factors.push((Kind::Image, residuals.time_s.iter().map(|&t| ninth_at(ninths, t)).collect()));
    Track { time_s: residuals.time_s.clone(), error: residuals.error.clone(), noise: residuals.noise.clone(), factors }
}

fn bench_track(recording: &Recording, joint: &Joint, j: usize, transmission: &Transmission, residuals: &Residuals) -> Result<Track> {
    let motor = recording.require_motor()?;
    let angles: Vec<f64> = residuals.time_s.iter().map(|&t| motor.interpolate(j, t).unwrap_or(f64::NAN)).collect();
    let factors = bench_factors(joint, j, transmission, &residuals.time_s, &residuals.rate, &angles);
    Ok(Track { time_s: residuals.time_s.clone(), error: residuals.error.clone(), noise: residuals.noise.clone(), factors })
}

/// What a bench's joint may depend on, from its motor's angles.
fn bench_factors(
    joint: &Joint,
    j: usize,
    transmission: &Transmission,
    time_s: &[f64],
    rate: &[f64],
    angles: &[f64],
) -> Vec<(Kind, Vec<f64>)> {
    let (_, scale) = joint.display_unit();
    vec![
        (Kind::Phase, phase_factor(time_s, rate)),
        (Kind::Speed, rate.iter().map(|r| r.abs() * scale).collect()),
        (Kind::Position, angles.iter().map(|&a| transmission.joint_alone(j, a) * scale).collect()),
        (Kind::Capstan, angles.iter().map(|&a| turn(a, joint)).collect()),
    ]
}

/// Means over [`AVERAGED_S`] of residuals that are denser.
fn averaged(residuals: &Residuals) -> Residuals {
    let steps: Vec<f64> = residuals.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    if median(&steps).is_none_or(|step| step > 0.5 * AVERAGED_S) {
        return residuals.clone();
    }
    let mut all = Residuals::default();
    let mut from = 0;
    while let Some(&start) = residuals.time_s.get(from) {
        let to = residuals.time_s.partition_point(|&t| t < start + AVERAGED_S).max(from + 1);
        let count = (to - from) as f64;
        let mean = |column: &[f64]| column[from..to].iter().sum::<f64>() / count;
        all.time_s.push(mean(&residuals.time_s));
        all.error.push(mean(&residuals.error));
        all.rigid_error.push(mean(&residuals.rigid_error));
        // Of a bench's encoder most is how straight it reads, which is alike from one sample to the next.
        all.noise.push(mean(&residuals.noise));
        all.rate.push(mean(&residuals.rate));
        from = to;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dense_residuals_are_averaged_and_their_noise_is_alike() {
        let count = 1000;
        let ramp: Vec<f64> = (0..count).map(f64::from).collect();
        let dense = Residuals {
            time_s: ramp.iter().map(|k| k * 1e-3).collect(),
            error: ramp.clone(),
            rigid_error: ramp.clone(),
            noise: vec![1.0; ramp.len()],
            rate: ramp,
        };
        let thin = averaged(&dense);
        assert_eq!(thin.error.len(), 50);
        assert!((thin.error[1] - 29.5).abs() < 1e-9 && (thin.time_s[1] - 0.0295).abs() < 1e-9);
        assert_eq!(thin.noise[0], 1.0);
        // What is sparse already stays as it is.
        assert_eq!(averaged(&thin).error, thin.error);
    }
}
