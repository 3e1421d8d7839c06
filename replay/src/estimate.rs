//! The three estimates of a log's joints: transmission kinematics, camera, filter.

use raven::Result;
use raven::filter::{BiasStates, FilterRun, JointTrack, PaperStates, TipAt, run};
use raven::log::Recording;
use raven::robot::{Arm, LinkModel, MotorTrack, Robot};

use crate::errors::{Estimate, Estimates};
use crate::{Args, FilterKind};

/// Length of the blocks in which `--occlude` hides the marker [s], as in the paper's experiment D.
const OCCLUSION_BLOCK_S: f64 = 2.0;

/// All estimates of one log, and the filter's own account.
///
/// # Errors
/// If the log has no motor angles, or the robot is no arm.
pub fn estimate(recording: &Recording, robot: &Robot, args: &Args) -> Result<(Estimates, FilterRun)> {
    let (arm, believed_arm) = (robot.arm()?, robot.before_calibration().arm()?);
    let motor = recording.motor_track()?;
    let mut tips = if recording.tip.is_empty() { Vec::new() } else { recording.tips(&arm, &robot.observation)? };
    hide(&mut tips, args.occlude);
    let camera = camera(&arm, &motor, &tips);
    let model = LinkModel::new(arm.clone());
    let filter = match args.filter {
        FilterKind::Paper => run(&PaperStates::new(model), &arm.kinematics, &motor, &tips),
        FilterKind::Bias => run(&BiasStates::tuned(arm.clone(), &motor, &tips), &arm.kinematics, &motor, &tips),
    };
    let estimates = Estimates {
        believed: transmission(&believed_arm, &motor),
        kinematic: transmission(&arm, &motor),
        camera,
        filter: track(&filter.filtered),
        smoother: track(&filter.smoothed),
    };
    Ok((estimates, filter))
}

fn track(track: &JointTrack) -> Estimate {
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

/// Takes a share of the tips away in whole blocks, spread evenly by the golden ratio so that the same share hides the same blocks.
fn hide(tips: &mut Vec<TipAt>, share: f64) {
    let Some(start) = tips.first().map(|tip| tip.time_s) else { return };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    tips.retain(|tip| (((tip.time_s - start) / OCCLUSION_BLOCK_S).floor() * golden).fract() >= share);
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;

    #[test]
    fn occlusion_hides_the_share_asked_for_in_whole_blocks() {
        let all: Vec<TipAt> =
            (0..6000).map(|k| TipAt { time_s: f64::from(k) / 15.0, position: Vector3::zeros(), covariance: Matrix3::identity() }).collect();
        for share in [0.0, 0.1, 0.4, 0.8] {
            let mut left = all.clone();
            hide(&mut left, share);
            let hidden = 1.0 - left.len() as f64 / all.len() as f64;
            assert!((hidden - share).abs() < 0.02, "{share}: {hidden}");
            let edges = left.windows(2).filter(|pair| pair[1].time_s - pair[0].time_s > 0.1);
            assert!(edges.into_iter().all(|pair| pair[1].time_s - pair[0].time_s > 1.9));
        }
    }
}
