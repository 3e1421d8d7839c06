//! What a recording says against the robot model: at the joints, at the tip, and against the controller's own joint angles.

use nalgebra::Vector3;
use raven::log::Recording;
use raven::observation::three_joints;
use raven::robot::{Arm, KinematicsKind, LinkModel, Robot};
use raven::{Error, Result};

use crate::evidence::recorded::bench::{Signs, by_joint, encoder_noise};

/// Residuals of one channel over time.
#[derive(Debug, Clone, Default)]
pub struct Residuals {
    /// [s].
    pub time_s: Vec<f64>,
    /// Measured less modelled, cables and links included [rad or m].
    pub error: Vec<f64>,
    /// Measured less transmission kinematics, which is what the controller believes [rad or m].
    pub rigid_error: Vec<f64>,
    /// Standard deviation of the measurement's noise [rad or m].
    pub noise: Vec<f64>,
    /// Velocity of the joint by its motor [rad/s or m/s]; 0 for the tip.
    pub rate: Vec<f64>,
}

/// Residuals of all channels of a recording.
#[derive(Debug, Clone, Default)]
pub struct Channels {
    /// One per joint; empty where nothing measures the joints.
    pub joints: Vec<Residuals>,
    /// Distance of the tip from where the model has it; empty without a tip.
    pub tip: Residuals,
    /// Largest difference between the controller's logged joint angles and transmission kinematics by the numbers it then had.
    pub controller_difference: Option<Vec<f64>>,
    /// Tips that the kinematics cannot reach and that could not be used.
    pub unreachable: usize,
}

/// Residuals of each of `recordings` against the robot as it begins there, which for each of them is in `begun`.
///
/// # Errors
/// If a log lacks motor angles, or neither tip, joint encoders of a bench, torque nor the controller's angles can be compared with them.
pub fn channels(robot: &Robot, recordings: &[Recording], begun: &[Robot]) -> Result<Vec<Channels>> {
    let mut all: Vec<Channels> = if matches!(robot.kinematics, KinematicsKind::Bench) {
        let signs = Signs::of(robot, recordings)?;
        recordings.iter().map(|recording| bench_channels(recording, robot, &signs)).collect::<Result<_>>()?
    } else {
        recordings.iter().zip(begun).map(|(recording, begun)| arm_channels(recording, begun)).collect::<Result<_>>()?
    };
    for channels in &mut all {
        channels.joints.iter_mut().chain([&mut channels.tip]).for_each(drop_non_finite);
    }
    Ok(all)
}

fn arm_channels(recording: &Recording, robot: &Robot) -> Result<Channels> {
    let (arm, motor) = (robot.arm()?, recording.motor_track()?);
    let mut channels =
        Channels { controller_difference: controller_difference(recording, &robot.before_calibration().arm()?)?, ..Channels::default() };
    if recording.tip.is_empty() {
        if channels.controller_difference.is_some() || recording.require_motor()?.effort.is_some() {
            return Ok(channels);
        }
        let message =
            "has motor angles but neither /tip, motor torque nor the controller's joint angles: there is nothing to compare them with.";
        return Err(Error::file(&recording.path, message));
    }
    let tips = recording.tips(robot)?;
    let times: Vec<f64> = tips.iter().map(|tip| tip.time_s).collect();
    let states = LinkModel::new(arm.clone()).rollout_gripped(&arm.winding(&motor), &times);
    channels.joints = vec![Residuals::default(); 3];
    for (tip, state) in tips.iter().zip(&states) {
        let Some(state) = state else { continue };
        let Some(moved) = motor.steady(tip.time_s) else { continue };
        let rigid = arm.transmission.joint_from_motor(&moved.angle);
        let rate = arm.transmission.joint_rate_from_motor(&moved.rate);
        let away = |joint: &Vector3<f64>| (tip.position - arm.kinematics.forward(joint)).norm();
        channels.tip.push(tip.time_s, [away(&state.position), away(&rigid)], tip.covariance.trace().sqrt(), 0.0);
        let seen = arm.kinematics.inverse(&tip.position, arm.kinematics.branch(&state.position));
        let slope = seen.and_then(|joint| arm.kinematics.jacobian(&joint).try_inverse());
        let Some((joint, slope)) = seen.zip(slope) else {
            channels.unreachable += 1;
            continue;
        };
        let covariance = slope * tip.covariance * slope.transpose();
        for (j, residuals) in channels.joints.iter_mut().enumerate() {
            let errors = [joint[j] - state.position[j], joint[j] - rigid[j]];
            residuals.push(tip.time_s, errors, covariance[(j, j)].sqrt(), rate[j]);
        }
    }
    Ok(channels)
}

fn bench_channels(recording: &Recording, robot: &Robot, signs: &[Signs]) -> Result<Channels> {
    let (motor, transmission) = (recording.require_motor()?, robot.bench_transmission()?);
    let mut channels = Channels::default();
    let Some(encoders) = &recording.joint_encoders else {
        if motor.effort.is_some() {
            return Ok(channels);
        }
        let message = "has neither /joint_encoders nor motor torque: on a bench there is no gap to see without either.";
        return Err(Error::file(&recording.path, message));
    };
    for (j, (joint, signs)) in robot.joints.iter().zip(signs).enumerate() {
        let angles = by_joint(&motor.position, recording, "motor", joint, j)?;
        let measured = by_joint(&encoders.position, recording, "joint", joint, j)?;
        let modelled: Vec<f64> = angles.iter().map(|angle| transmission.joint_alone(j, *angle)).collect();
        let mut residuals = Residuals::default();
        let noise = encoder_noise(measured.iter().copied());
        for k in 1..modelled.len().saturating_sub(1) {
            let time_s = motor.time_s[k];
            let rate = (modelled[k + 1] - modelled[k - 1]) / (motor.time_s[k + 1] - motor.time_s[k - 1]);
            if let Some(measured) = encoders.interpolate(j, time_s) {
                residuals.push(time_s, [signs.joint * measured - modelled[k]; 2], noise, rate);
            }
        }
        channels.joints.push(residuals);
    }
    Ok(channels)
}

fn controller_difference(recording: &Recording, arm: &Arm) -> Result<Option<Vec<f64>>> {
    let Some(logged) = &recording.controller_joints else { return Ok(None) };
    let motor = recording.motor_track()?;
    three_joints(logged, recording)?;
    let mut largest = Vector3::<f64>::zeros();
    for (time_s, angle) in motor.time_s.iter().zip(&motor.angle) {
        // A message that lacks the one need not lack the other.
        let joint: Option<Vec<f64>> = (0..3).map(|j| logged.interpolate(j, *time_s).filter(|q| q.is_finite())).collect();
        if let Some(joint) = joint {
            largest = largest.sup(&(arm.transmission.joint_from_motor(angle) - Vector3::from_vec(joint)).abs());
        }
    }
    Ok(Some(largest.as_slice().to_vec()))
}

fn drop_non_finite(residuals: &mut Residuals) {
    let keep: Vec<bool> = (0..residuals.error.len()).map(|k| residuals.error[k].is_finite() && residuals.noise[k].is_finite()).collect();
    for column in residuals.columns() {
        let mut flags = keep.iter();
        column.retain(|_| flags.next().copied().unwrap_or(false));
    }
}

impl Residuals {
    fn push(&mut self, time_s: f64, [error, rigid_error]: [f64; 2], noise: f64, rate: f64) {
        for (column, value) in self.columns().into_iter().zip([time_s, error, rigid_error, noise, rate]) {
            column.push(value);
        }
    }

    /// Adds the residuals of another recording.
    pub fn extend(&mut self, other: &Self) {
        let mut other = other.clone();
        for (column, more) in self.columns().into_iter().zip(other.columns()) {
            column.append(more);
        }
    }

    fn columns(&mut self) -> [&mut Vec<f64>; 5] {
        [&mut self.time_s, &mut self.error, &mut self.rigid_error, &mut self.noise, &mut self.rate]
    }
}

#[cfg(test)]
mod tests {
    use raven::log::{LogWriter, MotorSource, RavenState, Stamp};

    use super::*;

    #[test]
    fn a_message_without_motors_does_not_shift_the_controllers_angles() {
        let arm = raven::robot::nominal::gold().arm().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let mut log = LogWriter::create(&path).unwrap();
        for k in 0..20_u8 {
            let motor = Vector3::repeat(0.5 * f64::from(k));
            let joint = arm.transmission.joint_from_motor(&motor);
            let mut state = RavenState::default();
            for j in 0..3 {
                state.mpos_deg[j] = if k == 7 { f32::NAN } else { motor[j].to_degrees() as f32 };
                state.jpos_deg[j] = joint[j].to_degrees() as f32;
            }
            log.robot_state(Stamp(1_000_000_000 + 1_000_000 * u64::from(k)), &state).unwrap();
        }
        log.finish().unwrap();
        let recording = Recording::read(&path, &MotorSource::default()).unwrap();
        assert_eq!(recording.motor.as_ref().unwrap().len(), 19);
        let difference = controller_difference(&recording, &arm).unwrap().unwrap();
        assert!(difference.iter().all(|d| *d < 1e-6), "{difference:?}");
    }
}
