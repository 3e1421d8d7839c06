//! The plant against statics, energy, its own step and the parameters of each effect.

mod effects;
mod images;
mod off_nominal;
mod outside;
mod plant;
mod sealed;
mod session;

use nalgebra::Vector3;

use super::*;
use crate::robot::{Robot, nominal};

/// The nominal robot with stiff cables, so that nothing but the effect under test moves the joints.
fn stiff() -> Robot {
    let mut robot = nominal::gold();
    for joint in &mut robot.joints {
        if let Some(cable) = &mut joint.cable {
            cable.stiffness *= 100.0;
            cable.damping *= 10.0;
        }
    }
    robot
}

fn pose(shoulder_deg: f64, elbow_deg: f64, insertion_m: f64) -> Vector3<f64> {
    Vector3::new(shoulder_deg.to_radians(), elbow_deg.to_radians(), insertion_m)
}

fn effects(texts: &[&str]) -> Vec<Effect> {
    texts.iter().map(|text| text.parse().unwrap()).collect()
}

/// A session at `path` of a machine with effects, the controller believing `robot`.
fn session(robot: &Robot, hidden: &[&str], path: &Trajectory, duration_s: f64) -> Trace {
    let machine = Machine::new(robot, &effects(hidden)).unwrap();
    let mut recorder = Recorder::at_hard_stop(robot, machine, [100, -200, 300]).unwrap();
    recorder.approach(path.start());
    recorder.record(path, duration_s, || {})
}

/// Joint angles that the controller makes of the encoders.
fn believed(robot: &Robot, sample: &Sample) -> Vector3<f64> {
    robot.arm().unwrap().transmission.joint_from_motor(&sample.cycle.motor)
}

fn rng(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand::SeedableRng::seed_from_u64(seed)
}

/// What the cables are longer than wound [m], by the controller's encoders and the true joints.
fn stretch_m(robot: &Robot, sample: &Sample) -> Vector3<f64> {
    robot.arm().unwrap().transmission.stretch_m(&sample.cycle.motor, &sample.joint)
}
