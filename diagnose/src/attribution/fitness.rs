//! Whether recordings can carry a diagnosis at all.

use nalgebra::Vector3;
use raven::robot::{Joint, JointType, MotorTrack, Robot, Transmission};
use raven::{Error, Result};

use crate::evidence::recorded::bench::Bench;
use crate::evidence::recorded::data::Data;

/// Shortest time with motors [s], and fewest tips, from which anything can be said.
const TIME_MIN_S: f64 = 5.0;
const TIPS_MIN: usize = 60;
/// A joint moves if it covers so much [rad, m].
const RANGE_MIN: [f64; 2] = [0.02, 0.002];
/// A tip moves if it covers so much [m]: a joint of 0.02 rad moves it by 8 mm where it is farthest from the remote centre.
const TIPS_MOVE_M: f64 = 0.03;

/// Whether a joint that covers so much [rad or m] moves.
pub(crate) fn moves(joint: &Joint, covered: f64) -> bool {
    covered > RANGE_MIN[usize::from(joint.kind == JointType::Prismatic)]
}

/// Refuses recordings of an arm that are too short, without motion, or with motion of one joint, or of one motor, only.
///
/// # Errors
/// With what is missing, and what to record.
pub fn check_fitness(robot: &Robot, data: &[Data]) -> Result<()> {
    check_time(data.iter().map(|d| &d.motors))?;
    let tips: usize = data.iter().map(|d| d.sights.len()).sum();
    let torques: usize = data.iter().map(|d| d.shafts.len()).sum();
    if tips < TIPS_MIN && torques == 0 {
        return Err(refused(&format!(
            "the recordings have {tips} tips, at least {TIPS_MIN} are needed, and no motor torque; track the marker first (raven-track)"
        )));
    }
    let transmission = &robot.arm()?.transmission;
    let motors = || data.iter().flat_map(|d| &d.motors.angle);
    let joints = moving(robot, motors().map(|motor| transmission.joint_from_motor(motor)));
    // A motor that moves alone moves other joints as well, by their coupling.
    let motors = moving(robot, motors().map(|motor| each_alone(transmission, motor)));
    let only = "causes at one joint cannot be told from causes elsewhere, move all three";
    match (joints.as_slice(), motors.as_slice()) {
        ([], _) if tips_move(data) => Err(refused("the tip moves and no motor does, as recorded; see whether the encoders are read")),
        ([], _) => Err(refused("no joint moves; a robot at rest shows nothing but its pose")),
        ([joint], _) => Err(refused(&format!("only the {joint} moves; {only}"))),
        (_, [motor]) => Err(refused(&format!("only the {motor}'s motor moves; {only}"))),
        _ => Ok(()),
    }
}

/// Whether tips cover more than a joint that stands could make them.
fn tips_move(data: &[Data]) -> bool {
    covered(data.iter().flat_map(|d| &d.sights).map(|sight| sight.position_m)).max() > TIPS_MOVE_M
}

/// Refuses recordings of a bench that are too short or without motion.
///
/// # Errors
/// With what is missing, and what to record.
pub fn check_bench_fitness(robot: &Robot, bench: &Bench) -> Result<()> {
    check_time(bench.recordings().iter().map(|recorded| &recorded.motors))?;
    let transmission = robot.bench_transmission()?;
    let joints = bench.recordings().iter().flat_map(|recorded| &recorded.motors.angle).map(|motor| each_alone(&transmission, motor));
    if moving(robot, joints).is_empty() {
        return Err(refused("no joint moves; a bench at rest shows nothing"));
    }
    Ok(())
}

fn refused(what: &str) -> Error {
    Error::Data(format!("No diagnosis: {what}."))
}

fn check_time<'a>(motors: impl Iterator<Item = &'a MotorTrack>) -> Result<()> {
    let time_s: f64 = motors.filter_map(|track| Some(track.time_s.last()? - track.time_s.first()?)).sum();
    if time_s < TIME_MIN_S {
        // Down to tenths: 4.999 s are not "5.0 s, at least 5 s are needed".
        let tenths_s = (10.0 * time_s).floor() / 10.0;
        return Err(refused(&format!(
            "{tenths_s:.1} s were recorded, at least {TIME_MIN_S} s are needed, and 40 s or more tell much more"
        )));
    }
    Ok(())
}

/// Joint positions [rad, m] of motor angles [rad], as if no joint moved another's cable.
fn each_alone(transmission: &Transmission, motor: &Vector3<f64>) -> Vector3<f64> {
    Vector3::from_fn(|j, _| transmission.joint_alone(j, motor[j]))
}

/// From the least to the largest of positions, coordinate by coordinate; zero of none.
fn covered(positions: impl Iterator<Item = Vector3<f64>>) -> Vector3<f64> {
    let extremes = positions.fold(None, |extremes: Option<[Vector3<f64>; 2]>, position| {
        Some(extremes.map_or([position, position], |[low, high]| [low.inf(&position), high.sup(&position)]))
    });
    extremes.map_or_else(Vector3::zeros, |[low, high]| high - low)
}

/// The joints that move where they take these positions [rad, m].
fn moving(robot: &Robot, positions: impl Iterator<Item = Vector3<f64>>) -> Vec<&str> {
    robot
        .joints
        .iter()
        .zip(&covered(positions))
        .filter(|(joint, covered)| moves(joint, **covered))
        .map(|(joint, _)| joint.name.as_str())
        .collect()
}

#[cfg(test)]
mod tests {
    use raven::effects::Sight;
    use raven::robot::nominal::gold;

    use super::*;

    /// Where the robot rests [rad, rad, m].
    const REST: Vector3<f64> = Vector3::new(0.6, 1.8, 0.4);

    /// Ten samples a second of joints [rad, rad, m] by time [s], with tips.
    fn recorded(time_s: f64, joints: impl Fn(f64) -> Vector3<f64>) -> Data {
        let transmission = gold().arm().unwrap().transmission;
        let time_s: Vec<f64> = (0..=(10.0 * time_s).round() as usize).map(|k| 0.1 * k as f64).collect();
        let motors = MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&joints(t))).collect(), time_s };
        let sight =
            |&stamp_s: &f64| Sight { stamp_s, position_m: Vector3::zeros(), covariance_m2: nalgebra::Matrix3::identity(), rows: [0.0; 2] };
        let sights = motors.time_s.iter().map(sight).collect();
        Data { motors_at_rest: motors.clone(), sights, shafts: Vec::new(), motors }
    }

    fn said(data: &[Data]) -> Option<String> {
        check_fitness(&gold(), data).err().map(|error| error.to_string())
    }

    #[test]
    fn what_cannot_carry_a_diagnosis_is_refused_with_what_is_missing() {
        let swing = |parts: [f64; 3]| move |t: f64| REST + Vector3::new(0.3, 0.2, 0.03).component_mul(&Vector3::from(parts)) * t.sin();
        let (all, short) = (recorded(12.0, swing([1.0; 3])), recorded(4.9, swing([1.0; 3])));
        assert_eq!(said(&[all]), None);
        assert_eq!(said(&[recorded(12.0, swing([1.0, 0.5, 0.0]))]), None);
        // Two short ones are as long as one.
        assert_eq!(said(&[recorded(4.9, swing([1.0; 3])), recorded(4.9, swing([1.0; 3]))]), None);
        let short = said(&[short]).unwrap();
        assert!(short.contains("4.9 s were recorded, at least 5 s"), "{short}");
        let mut unknown = recorded(12.0, swing([1.0; 3]));
        unknown.sights.iter_mut().for_each(|sight| sight.covariance_m2.fill(0.0));
        let unknown = said(&[unknown.weighed()]).unwrap();
        assert!(unknown.contains("0 tips, at least 60"), "{unknown}");
        let at_rest = said(&[recorded(12.0, swing([0.0; 3]))]).unwrap();
        assert!(at_rest.contains("no joint moves"), "{at_rest}");
        let mut unread = recorded(12.0, swing([0.0; 3]));
        unread.sights.iter_mut().for_each(|sight| sight.position_m.x = 0.05 * sight.stamp_s.sin());
        let unread = said(&[unread]).unwrap();
        assert!(unread.contains("the tip moves and no motor does"), "{unread}");
        let one = said(&[recorded(12.0, swing([0.0, 1.0, 0.0]))]).unwrap();
        assert!(one.contains("only the elbow moves"), "{one}");
        let blind = said(&[Data { sights: Vec::new(), ..recorded(12.0, swing([1.0; 3])) }]).unwrap();
        assert!(blind.contains("0 tips, at least 60") && blind.contains("raven-track"), "{blind}");
    }

    #[test]
    fn one_motor_alone_is_refused_though_its_cable_moves_all_joints() {
        let mut data = recorded(12.0, |_| REST);
        let time_s = data.motors.time_s.clone();
        data.motors.angle.iter_mut().zip(time_s).for_each(|(motor, t)| motor[0] += 40.0 * t.sin());
        let transmission = gold().arm().unwrap().transmission;
        assert_eq!(moving(&gold(), data.motors.angle.iter().map(|motor| transmission.joint_from_motor(motor))).len(), 3);
        let one = said(&[data]).unwrap();
        assert!(one.contains("only the shoulder's motor moves"), "{one}");
    }
}
