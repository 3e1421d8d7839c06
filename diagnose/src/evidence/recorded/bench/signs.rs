//! Which way the sides of a bench count: a sign convention is no effect, so the sign that agrees with the motion is taken.

use raven::Result;
use raven::log::{JointSeries, Recording};
use raven::robot::Robot;

use super::by_joint;

/// Shares of a spread by which a slope is off: a rigid ratio so far from the file's is said in words.
const GROSSLY: f64 = 0.05;
/// Time over which torque and speed are compared [s].
const STRIDE_S: f64 = 0.02;

/// Signs of one joint, and what there is to say about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Signs {
    /// Of the joint's encoder against the motor's through the file's ratio.
    pub joint: f64,
    /// Of the motor's torque against its motion: positive work on the whole.
    pub torque: f64,
    /// Of the torque measured at the joint against the motor's.
    pub load: f64,
    /// Sentences for the report.
    pub remarks: Vec<String>,
}

impl Signs {
    /// Of every joint by all recordings.
    ///
    /// # Errors
    /// If a recording has no motor side, or fewer joints than the robot.
    pub fn of(robot: &Robot, recordings: &[Recording]) -> Result<Vec<Self>> {
        (0..robot.joints.len()).map(|j| Self::of_joint(robot, recordings, j)).collect()
    }

    fn of_joint(robot: &Robot, recordings: &[Recording], j: usize) -> Result<Self> {
        let joint = &robot.joints[j];
        let (mut turned, mut work, mut torques) = (Spread::default(), 0.0, Spread::default());
        for recording in recordings {
            let motor = recording.require_motor()?;
            let angle = by_joint(&motor.position, recording, "motor", joint, j)?;
            for (k, &time_s) in motor.time_s.iter().enumerate() {
                if let Some(shown) = recording.joint_encoders.as_ref().and_then(|e| e.interpolate(j, time_s)) {
                    turned.add(angle[k] / joint.ratio(), shown);
                }
                let efforts = recording.joint_encoders.as_ref().and_then(|e| e.interpolate_effort(j, time_s));
                if let Some((torque, load)) = motor.effort.as_ref().and_then(|e| e.get(j)).and_then(|e| e.get(k)).zip(efforts) {
                    torques.add(*torque, load);
                }
            }
            work += worked(motor, j);
        }
        let (slope, torque) = (turned.slope(), sign(work));
        let mut signs = Self {
            joint: slope.map_or(1.0, sign),
            torque,
            load: torques.slope().map_or(1.0, |slope| sign(slope) * torque),
            remarks: Vec::new(),
        };
        let name = &joint.name;
        if signs.joint < 0.0 {
            signs.remarks.push(format!("{name}: the joint side counts against the motor side; its sign was turned."));
        }
        if signs.torque < 0.0 {
            signs.remarks.push(format!("{name}: the motor's torque counts against its motion, or it would brake; its sign was turned."));
        }
        if signs.load < 0.0 {
            signs.remarks.push(format!("{name}: the torque at the joint counts against the motor's; its sign was turned."));
        }
        if let Some(slope) = slope.filter(|slope| (slope.abs() - 1.0).abs() > GROSSLY) {
            let times = slope.abs();
            signs.remarks.push(format!(
                "{name}: the joint moves {times:.2} times as far as the file's ratio has it; as an effect that is pulley-radius, {:+.2}.",
                1.0 / times - 1.0
            ));
        }
        Ok(signs)
    }
}

/// Work of a motor [J]; its torque may count the other way.
fn worked(motor: &JointSeries, j: usize) -> f64 {
    let Some(effort) = motor.effort.as_ref().and_then(|effort| effort.get(j)) else { return 0.0 };
    let mut work = 0.0;
    let mut last = 0;
    for k in 1..motor.len() {
        if motor.time_s[k] - motor.time_s[last] >= STRIDE_S {
            let mean = effort[last..=k].iter().sum::<f64>() / (k - last + 1) as f64;
            let step = mean * (motor.position[j][k] - motor.position[j][last]);
            work += if step.is_finite() { step } else { 0.0 };
            last = k;
        }
    }
    work
}

fn sign(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

/// Sums of a regression.
#[derive(Default)]
struct Spread {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl Spread {
    fn add(&mut self, x: f64, y: f64) {
        if x.is_finite() && y.is_finite() {
            self.count += 1.0;
            self.x += x;
            self.y += y;
            self.xx += x * x;
            self.xy += x * y;
        }
    }

    /// Of `y` by `x`; `None` where `x` does not move.
    fn slope(&self) -> Option<f64> {
        let spread = self.xx - self.x * self.x / self.count;
        let slope = (self.xy - self.x * self.y / self.count) / spread;
        (self.count > 1.0 && spread > 0.0 && slope.is_finite()).then_some(slope)
    }
}
