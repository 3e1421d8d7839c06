//! The three estimates of a log's joints: transmission kinematics, camera, filter.

use nalgebra::{Matrix3, Vector3};
use raven::Result;
use raven::camera::Cameras;
use raven::filter::{BiasStates, FilterRun, JointTrack, PaperStates, TipAt, Tuning, run};
use raven::log::Recording;
use raven::robot::{Arm, LinkModel, MotorTrack, Robot};
use raven_track::shared;

use crate::errors::{Estimate, Estimates};
use crate::{FilterKind, Occlusion};

/// Length of the blocks in which `--occlude` hides the marker [s], as in the paper's experiment D.
const OCCLUSION_BLOCK_S: f64 = 2.0;

/// How the filter runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Its states.
    pub filter: FilterKind,
    /// Share of the time in which the marker is hidden from it.
    pub occlude: f64,
    /// What it makes of that.
    pub occlusion: Occlusion,
    /// How friction holds, the bias wanders and the cameras' errors persist; by default as the log's own tips say.
    pub tuning: Option<Tuning>,
}

/// All estimates of one log, and the filter's own account.
///
/// # Errors
/// If the log has no motor angles, or the robot is no arm.
pub fn estimate(recording: &Recording, robot: &Robot, settings: &Settings) -> Result<(Estimates, FilterRun)> {
    let (arm, believed_arm) = (robot.arm()?, robot.before_calibration().arm()?);
    let motor = recording.motor_track()?;
    let driving = arm.motor_laws.applied(&arm, &motor);
    let mut tips = if recording.tip.is_empty() { Vec::new() } else { recording.tips(robot)? };
    let hidden = hide(&mut tips, settings.occlude);
    let camera = camera(&arm, &motor, &tips);
    let mut offered = tips.clone();
    if settings.occlusion == Occlusion::Kinematics {
        offered.extend(stand_ins(&arm, &driving, &tips, &hidden));
        offered.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    let (filter, tuning) = match settings.filter {
        FilterKind::Paper => (run(&PaperStates::new(LinkModel::new(arm.clone())), &arm.kinematics, &motor, &offered), None),
        FilterKind::Bias => {
            let states = match settings.tuning {
                Some(tuning) => BiasStates::new(arm.clone(), tuning),
                None => BiasStates::tuned(&arm, &motor, &tips),
            };
            let run = run(&states, &arm.kinematics, &motor, &offered);
            (run.with_shared(&arm.kinematics, shared_covariance(recording, robot, &arm)), Some(states.tuning))
        }
    };
    let estimates = Estimates {
        believed: transmission(&believed_arm, &motor),
        kinematic: transmission(&arm, &driving),
        camera,
        filter: track(&filter.filtered),
        smoother: track(&filter.smoothed),
        tuning,
    };
    Ok((estimates, filter))
}

/// What all tips near one share [m^2]: as identification left it, or, of a robot whose registration nobody has corrected, as calibration and registration
/// of the cameras that tracked them did.
fn shared_covariance(recording: &Recording, robot: &Robot, arm: &Arm) -> impl Fn(&Vector3<f64>) -> Option<Matrix3<f64>> {
    let observation = robot.observation;
    let hard_stop_m = arm.kinematics.forward(&arm.hard_stop);
    let cameras = if observation.corrects_registration() { None } else { Cameras::of_tracked(recording) };
    move |tip_m| match &cameras {
        Some(cameras) => shared::covariance(cameras, tip_m, &hard_stop_m),
        None => observation.shared_covariance_m2(&(tip_m - hard_stop_m)),
    }
}

/// The positions of a track.
pub(crate) fn track(track: &JointTrack) -> Estimate {
    Estimate { time_s: track.time_s.clone(), joints: track.joints.clone() }
}

fn transmission(arm: &Arm, motor: &MotorTrack) -> Estimate {
    let joints = motor.angle.iter().map(|angle| arm.transmission.joint_from_motor(angle)).collect();
    Estimate { time_s: motor.time_s.clone(), joints }
}

/// Inverse kinematics of each tip, on the side of the remote centre where the motors say it is.
fn camera(arm: &Arm, motor: &MotorTrack, tips: &[TipAt]) -> Estimate {
    let mut estimate = Estimate::default();
    for tip in tips {
        let Some((angle, _)) = motor.at(tip.time_s) else { continue };
        let branch = arm.kinematics.branch(&arm.transmission.joint_from_motor(&angle));
        if let Some(joints) = arm.kinematics.inverse(&tip.position, branch) {
            estimate.time_s.push(tip.time_s);
            estimate.joints.push(joints);
        }
    }
    estimate
}

/// Takes a share of the tips away in whole blocks, spread evenly by the golden ratio so that more hides what less does, and more.
///
/// The first block stays: where a filter starts is not what occlusion is about.
fn hide(tips: &mut Vec<TipAt>, share: f64) -> Vec<TipAt> {
    let Some(start) = tips.first().map(|tip| tip.time_s) else { return Vec::new() };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let seen = |tip: &TipAt| (((tip.time_s - start) / OCCLUSION_BLOCK_S).floor() * golden).fract() < 1.0 - share;
    let (left, hidden) = std::mem::take(tips).into_iter().partition(seen);
    *tips = left;
    hidden
}

/// The paper's stand-in for hidden tips: where transmission kinematics has them, with the mean covariance of those seen.
fn stand_ins(arm: &Arm, motor: &MotorTrack, seen: &[TipAt], hidden: &[TipAt]) -> Vec<TipAt> {
    let covariance = seen.iter().map(|tip| tip.covariance).sum::<Matrix3<f64>>() / seen.len().max(1) as f64;
    let stand_in = |tip: &TipAt| {
        let (angle, _) = motor.at(tip.time_s)?;
        let position = arm.kinematics.forward(&arm.transmission.joint_from_motor(&angle));
        Some(TipAt { time_s: tip.time_s, position, covariance })
    };
    hidden.iter().filter_map(stand_in).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn occlusion_hides_the_share_asked_for_in_whole_blocks() {
        let all: Vec<TipAt> =
            (0..6000).map(|k| TipAt { time_s: f64::from(k) / 15.0, position: Vector3::zeros(), covariance: Matrix3::identity() }).collect();
        for share in [0.0, 0.1, 0.4, 0.8] {
            let mut left = all.clone();
            let taken = hide(&mut left, share);
            assert_eq!(left.len() + taken.len(), all.len());
            let hidden = 1.0 - left.len() as f64 / all.len() as f64;
            assert!((hidden - share).abs() < 0.02, "{share}: {hidden}");
            let edges = left.windows(2).filter(|pair| pair[1].time_s - pair[0].time_s > 0.1);
            assert!(edges.into_iter().all(|pair| pair[1].time_s - pair[0].time_s > 1.9));
        }
    }

    #[test]
    fn a_hidden_tip_is_replaced_by_the_one_of_transmission_kinematics() {
        let arm = raven::robot::nominal::gold().arm().unwrap();
        let joints = Vector3::new(0.8, 1.5, 0.35);
        let motor = MotorTrack { time_s: vec![0.0, 0.1], angle: vec![arm.transmission.motor_from_joint(&joints); 2] };
        let tip = |time_s, scale| TipAt { time_s, position: Vector3::zeros(), covariance: Matrix3::identity() * scale };
        let [only, beyond] =
            [stand_ins(&arm, &motor, &[tip(0.0, 1.0), tip(0.01, 3.0)], &[tip(0.05, 9.0)]), stand_ins(&arm, &motor, &[], &[tip(5.0, 1.0)])];
        assert!((only[0].position - arm.kinematics.forward(&joints)).norm() < 1e-12);
        assert_eq!(only[0].covariance, Matrix3::identity() * 2.0);
        assert!(beyond.is_empty());
    }
}
