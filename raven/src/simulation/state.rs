//! A control cycle as the robot's own message tells it, and as the reference encoders at the joints read it.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::controller::{CYCLE_S, Controller};
use super::trace::Sample;
use crate::log::{RavenState, arm_offset};
use crate::robot::{JointType, Kinematics, Robot};

/// Step of a reference encoder at a revolute joint [rad].
const REFERENCE_STEP_RAD: f64 = TAU / 80_000.0;
/// Step of a reference encoder at a prismatic joint [m].
const REFERENCE_STEP_M: f64 = 5e-6;
/// Pedal down: the robot follows its set-points.
const RUNLEVEL: i32 = 3;

/// The robot's message of one cycle, units and quirks included: degrees for everything, `jvel` without the coupling.
#[must_use]
pub fn raven_state(kinematics: &Kinematics, controller: &Controller, sample: &Sample) -> RavenState {
    let (cycle, transmission) = (&sample.cycle, controller.transmission());
    let arm = arm_offset(kinematics.arm);
    let side = arm / 8;
    let joint = transmission.joint_from_motor(&cycle.motor);
    let mut state = RavenState { runlevel: RUNLEVEL, dt: [0, (CYCLE_S * 1e9) as i32], ..RavenState::default() };
    let mut deg = |field: fn(&mut RavenState) -> &mut [f32; 16], values: &Vector3<f64>| {
        for j in 0..3 {
            field(&mut state)[arm + j] = values[j].to_degrees() as f32;
        }
    };
    deg(|s| &mut s.mpos_deg, &cycle.motor);
    deg(|s| &mut s.mvel_deg_s, &cycle.motor_rate);
    deg(|s| &mut s.mpos_d_deg, &cycle.motor_wanted);
    deg(|s| &mut s.jpos_deg, &joint);
    deg(|s| &mut s.jvel_deg_s, &cycle.motor_rate.component_div(&transmission.ratio));
    deg(|s| &mut s.jpos_d_deg, &sample.joint_wanted);
    for j in 0..3 {
        state.encoder_counts[arm + j] = cycle.counts[j];
        state.dac[arm + j] = cycle.converter[j];
        state.tau[arm + j] = cycle.torque[j] as f32;
        state.encoder_offsets[arm + j] = controller.encoder_offset(j) as f32;
    }
    for (position, orientation, joint) in
        [(&mut state.pos_um, &mut state.ori, &joint), (&mut state.pos_d_um, &mut state.ori_d, &sample.joint_wanted)]
    {
        let tip = kinematics.forward(joint);
        let turned = kinematics.axes(joint).1.into_inner().transpose();
        for i in 0..3 {
            position[3 * side + i] = (tip[i] * 1e6).round() as i32;
        }
        for (i, value) in turned.iter().enumerate() {
            orientation[9 * side + i] = *value as f32;
        }
    }
    state
}

/// What encoders at the joints read.
#[must_use]
pub fn reference(robot: &Robot, joint: &Vector3<f64>) -> Vec<f64> {
    let step = |kind| match kind {
        JointType::Revolute => REFERENCE_STEP_RAD,
        JointType::Prismatic => REFERENCE_STEP_M,
    };
    robot.joints.iter().take(3).zip(joint.iter()).map(|(j, q)| (q / step(j.kind)).round() * step(j.kind)).collect()
}
