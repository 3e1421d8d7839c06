//! The robot as a recording begins.

use raven::Result;
use raven::log::Recording;
use raven::robot::{KinematicsKind, Robot};

use crate::attribution::{Nominal, data};
use crate::evidence::left::left;
use crate::evidence::numbers::coordinates::Coordinates;
use crate::evidence::recorded::rows::Rows;

/// The robot file with what the motion before each of the recordings left of effects that it has, as far as they show that; a bench's as it is.
///
/// # Errors
/// If the robot file makes no arm, or a recording has no motor angles.
pub fn begun(nominal: &Nominal, recordings: &[Recording]) -> Result<Vec<Robot>> {
    let Nominal { robot, cameras, .. } = nominal;
    let of_one = |recording: &Recording| {
        let begun = (*robot).clone();
        if matches!(robot.kinematics, KinematicsKind::Bench) {
            return Ok(begun);
        }
        let data = data(std::slice::from_ref(recording), *cameras)?;
        let rows = Rows::new(robot, *cameras, &data)?;
        let left = left(&rows, &Coordinates::new(robot, &rows), &[], &[])?;
        left.iter().try_fold(begun, |robot, (sited, u)| sited.begun(&robot, &sited.values(u)))
    };
    recordings.iter().map(of_one).collect()
}
