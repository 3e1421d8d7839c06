//! Whether recordings can carry a diagnosis at all.

use nalgebra::Vector3;
use raven::robot::{JointType, Robot};
use raven::{Error, Result};

use crate::evidence::recorded::data::Data;

/// Shortest time with motors [s], and fewest tips, from which anything can be said.
const TIME_MIN_S: f64 = 5.0;
const TIPS_MIN: usize = 60;
/// A joint moves if it covers so much [rad, m].
pub(crate) const RANGE_MIN: [f64; 2] = [0.02, 0.002];

/// Refuses recordings that are too short, without motion, or with motion of one joint only.
///
/// # Errors
/// With what is missing, and what to record.
pub fn check_fitness(robot: &Robot, data: &[Data]) -> Result<()> {
    let refused = |what: String| Err(Error::Data(format!("No diagnosis: {what}.")));
    let time_s: f64 = data.iter().filter_map(|d| Some(d.motors.time_s.last()? - d.motors.time_s.first()?)).sum();
    if time_s < TIME_MIN_S {
        return refused(format!("{time_s:.1} s were recorded, at least {TIME_MIN_S} s are needed, and 40 s or more tell much more"));
    }
    let tips: usize = data.iter().map(|d| d.sights.len()).sum();
    let torques: usize = data.iter().map(|d| d.shafts.len()).sum();
    if tips < TIPS_MIN && torques == 0 {
        return refused(format!(
            "the recordings have {tips} tips, at least {TIPS_MIN} are needed, and no motor torque; track the marker first (raven-track)"
        ));
    }
    let arm = robot.arm()?;
    let joints = data.iter().flat_map(|d| d.motors.angle.iter().map(|angle| arm.transmission.joint_from_motor(angle)));
    let extremes = joints.fold(None, |extremes: Option<[Vector3<f64>; 2]>, joint| {
        Some(extremes.map_or([joint, joint], |[low, high]| [low.inf(&joint), high.sup(&joint)]))
    });
    let Some([low, high]) = extremes else { return refused("there is no motor sample".to_owned()) };
    let moves = |j: &usize| {
        let least = match robot.joints[*j].kind {
            JointType::Revolute => RANGE_MIN[0],
            JointType::Prismatic => RANGE_MIN[1],
        };
        high[*j] - low[*j] > least
    };
    let moving: Vec<&str> = (0..3).filter(moves).map(|j| robot.joints[j].name.as_str()).collect();
    match moving.as_slice() {
        [] => refused("no joint moves; a robot at rest shows nothing but its pose".to_owned()),
        [only] => refused(format!("only the {only} moves; causes at one joint cannot be told from causes elsewhere, move all three")),
        _ => Ok(()),
    }
}
