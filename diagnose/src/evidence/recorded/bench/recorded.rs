//! A bench's recording as the hypotheses see it: drives and joints at fifty times a second, signs put right.

use nalgebra::Vector3;
use raven::Result;
use raven::effects::{Driven, LinkMotion};
use raven::log::{JointSeries, Recording};
use raven::robot::{MotorTrack, Robot};

use super::super::data::{STRIDE_S, shaft};
use super::by_joint;
use super::signs::Signs;

/// What an encoder's coupling is good for, as part of the range that was moved through: a data sheet's linearity.
const OF_RANGE: f64 = 1e-3;

/// What one recording offers.
#[derive(Clone)]
pub struct Recorded {
    /// Motors.
    pub motors: MotorTrack,
    /// Drives, where there was enough of the motors' motion to know it.
    pub driven: Vec<Driven>,
    /// Joints at the same times [rad or m]; not finite where they were not recorded.
    pub joints: Vec<Vector3<f64>>,
    /// What each joint's encoder is good for [rad or m]; 0 where there is none.
    pub joint_noise: Vector3<f64>,
    /// Whether the motors' torque, and the joints', were recorded.
    pub has: [bool; 2],
}

impl Recorded {
    /// Of a recording.
    ///
    /// # Errors
    /// If it has no motor side, or a side has fewer joints than the robot.
    pub fn new(robot: &Robot, recording: &Recording, signs: &[Signs]) -> Result<Self> {
        let motor = recording.require_motor()?;
        let (motors, torque) = side(robot, recording, motor, "motor", &|_| 1.0, &|j| signs[j].torque)?;
        let joints = match &recording.joint_encoders {
            Some(encoders) => Some(side(robot, recording, encoders, "joint", &|j| signs[j].joint, &|j| signs[j].load)?),
            None => None,
        };
        let still = |track: &MotorTrack| vec![Vector3::zeros(); track.time_s.len()];
        let torque_there = torque.clone().unwrap_or_else(|| still(&motors));
        let joints_there = joints.as_ref().map(|(track, load)| (track, load.clone().unwrap_or_else(|| still(track))));
        let has = [torque.is_some(), joints.as_ref().is_some_and(|(_, load)| load.is_some())];
        let (mut driven, mut shown) = (Vec::new(), Vec::new());
        for time_s in motors.times_every(STRIDE_S) {
            let Some(shaft_there) = shaft(&motors, &torque_there, 0.0, time_s) else { continue };
            let joint = joints_there.as_ref().and_then(|(track, load)| shaft(track, load, 0.0, time_s));
            driven.push(Driven {
                shaft: shaft_there,
                load: joint.map_or_else(Vector3::zeros, |joint| joint.commanded.mean()),
                joint: joint.map(|joint| LinkMotion { position: joint.angle, rate: joint.rate, acceleration: joint.acceleration }),
            });
            shown.push(joint.map_or_else(|| Vector3::repeat(f64::NAN), |joint| joint.angle));
        }
        let joint_noise = Vector3::from_fn(|j, _| {
            let track = joints.as_ref().map(|(track, _)| track).filter(|_| j < robot.joints.len());
            track.map_or(0.0, |track| encoder_noise(track.angle.iter().map(|q| q[j])))
        });
        Ok(Self { motors, driven, joints: shown, joint_noise, has })
    }
}

/// One side of the drives, with what it was driven by if that was recorded.
fn side(
    robot: &Robot,
    recording: &Recording,
    series: &JointSeries,
    what: &str,
    sign: &dyn Fn(usize) -> f64,
    effort_sign: &dyn Fn(usize) -> f64,
) -> Result<(MotorTrack, Option<Vec<Vector3<f64>>>)> {
    let mut angle = vec![Vector3::zeros(); series.len()];
    let mut effort = series.effort.as_ref().map(|_| angle.clone());
    for (j, joint) in robot.joints.iter().enumerate() {
        let position = by_joint(&series.position, recording, what, joint, j)?;
        angle.iter_mut().zip(position).for_each(|(angle, q)| angle[j] = sign(j) * q);
        if let (Some(effort), Some(recorded)) = (&mut effort, &series.effort) {
            let recorded = by_joint(recorded, recording, what, joint, j)?;
            effort.iter_mut().zip(recorded).for_each(|(effort, f)| effort[j] = effort_sign(j) * f);
        }
    }
    // Some recorders fill up what they do not know.
    let effort = effort.filter(|effort| effort.iter().any(|f| f.iter().all(|v| v.is_finite()) && *f != Vector3::zeros()));
    Ok((MotorTrack { time_s: series.time_s.clone(), angle }, effort))
}

/// What an encoder with these readings is good for [their unit]: its step, and its coupling.
pub(crate) fn encoder_noise(positions: impl Iterator<Item = f64>) -> f64 {
    let (mut low, mut high, mut step, mut last) = (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NAN);
    for q in positions {
        (low, high) = (low.min(q), high.max(q));
        let moved = (q - last).abs();
        if moved > 0.0 {
            step = step.min(moved);
        }
        last = q;
    }
    if high > low { (step / 12_f64.sqrt()).hypot(OF_RANGE * (high - low)) } else { 0.0 }
}
