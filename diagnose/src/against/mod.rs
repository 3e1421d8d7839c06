//! The gap between a recording and somebody's own simulation of it, logged in the same format.
//!
//! ```text
//! y' = y_real - (y_sim - m(motors_sim)),      y' - m(motors_real) = (y_real - y_sim) - (m(motors_real) - m(motors_sim))
//! ```
//!
//! `y` is what a channel measures (tip, joint, torque) and `m` the robot file's model of it over recorded motors. The recording is put right
//! by what the simulation departs from the model, and is then held against the model as any other: its residual is real less simulated, at
//! equal motor motion. Where the motors took the same path the model drops out altogether; where they differ a little, as two controllers'
//! do, it stands in for the difference only. An effect that is built into the model is in this way added to the simulation's output: what
//! is named is what the robot has and the simulation lacks. What is interpolated to the real stamps is the departure, which is smooth and
//! small, not the motion.
//!
//! The clocks are set by the motors' paths, see `shift`: a simulation may start at any epoch. A controller that lags more in one of the two
//! moves the shift by its lag. That does little harm: each log's tip is held against its own motors, and the shift only says which of the
//! simulation's departures belongs to which stamp.

mod deviation;
mod shift;
#[cfg(test)]
mod tests;
mod turned;

use std::path::PathBuf;

use raven::camera::Cameras;
use raven::effects::Stage;
use raven::log::{JointSeries, Recording};
use raven::plot::svg::figure;
use raven::robot::{KinematicsKind, Robot};
use raven::stats::rms;
use raven::{Error, Result};
use serde::Serialize;

use crate::attribution::Side;
use crate::evidence::recorded::bench::Signs;
use crate::gap::Gap;
use crate::whereabouts::Channel;
use deviation::Deviation;
pub use turned::{stronger, turned_about};

/// What recordings were held against, and how large the gap is.
#[derive(Debug, Clone, Serialize)]
pub struct Against {
    /// One per recording.
    pub simulations: Vec<Simulation>,
    /// Real less simulated.
    pub gap: Vec<ChannelGap>,
    /// Which of the two has the effects that are named; nothing where causes were not looked for.
    pub effects_of: Option<Side>,
}

/// One simulation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Simulation {
    /// Its file.
    pub file: String,
    /// The recording it is a simulation of.
    pub recording: String,
    /// What its stamps lack to the recording's [s].
    pub shift_s: f64,
    /// How well the motors' paths agree, at the joint where they do least: 1 is the same path.
    pub agreement: f64,
    /// Time that both cover [s].
    pub overlap_s: f64,
    /// How far the motors were apart, in the joint's unit: real less simulated, per joint.
    #[serde(skip)]
    motors: Vec<Vec<f64>>,
}

/// The gap of one channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelGap {
    /// Joint, `tip`, a joint's torque, or a joint's motor.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// RMS of real less simulated, noise included; but for motors at equal motor motion.
    pub rms: f64,
    /// RMS that the noise stated in both logs would leave.
    pub noise_floor: f64,
    /// Observations behind it.
    pub observations: usize,
}

/// The simulations of recordings.
///
/// # Errors
/// If there is not one per recording, or one cannot be read.
pub fn read(robot: &Robot, recordings: &[Recording], simulated: &[PathBuf]) -> Result<Vec<Recording>> {
    let (count, given) = (recordings.len(), simulated.len());
    if count != given {
        return Err(Error::Argument(format!("--against is given {given} times for {count} recordings; give it once per recording.")));
    }
    simulated.iter().map(|path| Recording::of_robot(path, robot)).collect()
}

/// Puts recordings right by what their simulations depart from the model.
///
/// # Errors
/// If a simulation's motors do not follow the recording's, or both have nothing in common.
pub fn compare(
    robot: &Robot,
    cameras: Option<&Cameras>,
    recordings: &[Recording],
    simulated: &[Recording],
) -> Result<(Vec<Recording>, Vec<Simulation>)> {
    let one = |(real, simulated): (&Recording, &Recording)| corrected(robot, cameras, real, simulated);
    Ok(recordings.iter().zip(simulated).map(one).collect::<Result<Vec<_>>>()?.into_iter().unzip())
}

fn corrected(robot: &Robot, cameras: Option<&Cameras>, real: &Recording, simulated: &Recording) -> Result<(Recording, Simulation)> {
    let (motors, own) = (real.require_motor()?, simulated.require_motor()?);
    let recording = real.path.display().to_string();
    let refused = |why: String| Error::file(&simulated.path, format!("cannot be held against {recording}: {why}."));
    let found = shift::shift(robot, motors, own).map_err(refused)?;
    let to_own = |time_s: f64| time_s - found.shift_s;
    let covered = |time_s: f64| own.time_s.first().zip(own.time_s.last()).is_some_and(|(a, b)| (*a..=*b).contains(&to_own(time_s)));
    let signs = match robot.kinematics {
        KinematicsKind::Bench => Signs::of(robot, std::slice::from_ref(real))?,
        KinematicsKind::Raven(_) => Vec::new(),
    };
    let deviation = match robot.kinematics {
        KinematicsKind::Bench => Deviation::of_bench(robot, simulated, &signs)?,
        KinematicsKind::Raven(_) => Deviation::of_arm(robot, cameras, simulated)?,
    };
    let mut put_right = real.clone();
    deviation.take_off(&mut put_right, &to_own, &covered);
    if deviation.joints.is_none() && matches!(robot.kinematics, KinematicsKind::Bench) {
        put_right.joint_encoders = None;
    }
    let anything = put_right.seen_tips().next().is_some()
        || put_right.joint_encoders.as_ref().is_some_and(|_| deviation.joints.is_some())
        || put_right.motor.as_ref().is_some_and(|motor| motor.effort.is_some());
    if !anything {
        let why = "beside the motors' angles they have no channel in common; log /tip, /joint_encoders or the motors' effort";
        return Err(refused(why.to_owned()));
    }
    let simulation = Simulation {
        file: simulated.path.display().to_string(),
        recording: recording.clone(),
        shift_s: real.start.seconds_since(simulated.start) + found.shift_s,
        agreement: found.agreement,
        overlap_s: found.overlap_s,
        motors: apart(robot, motors, own, found.shift_s),
    };
    Ok((put_right, simulation))
}

/// How far the motors were apart, as far as it matters at the joints, in the joints' units.
fn apart(robot: &Robot, real: &JointSeries, simulated: &JointSeries, shift_s: f64) -> Vec<Vec<f64>> {
    let of_joint = |(j, joint): (usize, &raven::robot::Joint)| {
        let scale = joint.display_unit().1 / joint.ratio();
        let positions = real.position.get(j).map_or(&[][..], Vec::as_slice);
        let pairs = real.time_s.iter().zip(positions).filter_map(|(&t, q)| Some((q - simulated.interpolate(j, t - shift_s)?) * scale));
        pairs.filter(|away| away.is_finite()).collect()
    };
    robot.joints.iter().enumerate().take(3).map(of_joint).collect()
}

impl Against {
    /// Of simulations: `gaps` are those of the recordings that were put right against the model, `channels` the same over time.
    #[must_use]
    pub fn new(robot: &Robot, simulations: Vec<Simulation>, gaps: &[Gap], channels: &[Channel]) -> Self {
        let of_model = |gap: &Gap| ChannelGap {
            channel: gap.channel.clone(),
            unit: gap.unit,
            rms: gap.model,
            noise_floor: gap.noise_floor,
            observations: gap.observations,
        };
        let of_torque = |channel: &Channel| {
            let all = |of: fn(&crate::whereabouts::Track) -> &[f64]| channel.tracks.iter().flat_map(of).copied().collect::<Vec<f64>>();
            let error = all(|track| &track.error);
            Some(ChannelGap {
                channel: channel.name.clone(),
                unit: channel.unit,
                rms: rms(&error)? * channel.scale,
                noise_floor: rms(&all(|track| &track.noise))? * channel.scale,
                observations: error.len(),
            })
        };
        let of_motor = |(j, joint): (usize, &raven::robot::Joint)| {
            let away: Vec<f64> = simulations.iter().filter_map(|s| s.motors.get(j)).flatten().copied().collect();
            let (unit, observations) = (joint.display_unit().0, away.len());
            Some(ChannelGap { channel: format!("{} motor", joint.name), unit, rms: rms(&away)?, noise_floor: 0.0, observations })
        };
        let mut gap: Vec<ChannelGap> = gaps.iter().map(of_model).collect();
        gap.extend(channels.iter().filter(|channel| channel.stage == Stage::Motor && channel.horizon_s.is_none()).filter_map(of_torque));
        gap.extend(robot.joints.iter().enumerate().take(3).filter_map(of_motor));
        Self { simulations, gap, effects_of: None }
    }

    /// Clocks and gap as a terminal shows them.
    #[must_use]
    pub fn words(&self) -> String {
        use std::fmt::Write;
        let mut text = String::new();
        for Simulation { file, recording, shift_s, agreement, overlap_s, .. } in &self.simulations {
            let _ = writeln!(
                text,
                "{recording} against {file}: stamps {shift_s:+.4} s, {overlap_s:.1} s in common, motor paths agree to {agreement:.5}."
            );
        }
        let _ = writeln!(text, "\nGap (rms): real less simulated; all but the motors at equal motor motion");
        let _ = writeln!(text, "{:<17} {:>4} {:>10} {:>12} {:>13}", "channel", "unit", "gap", "noise floor", "observations");
        for ChannelGap { channel, unit, rms, noise_floor, observations } in &self.gap {
            let [rms, noise_floor] = [rms, noise_floor].map(|&value| figure(value));
            let _ = writeln!(text, "{channel:<17} {unit:>4} {rms:>10} {noise_floor:>12} {observations:>13}");
        }
        text
    }

    /// What effects that a side has were added to.
    #[must_use]
    pub fn remark(&self, side: Side) -> String {
        let files: Vec<&str> = self.simulations.iter().map(|simulation| simulation.file.as_str()).collect();
        let files = files.join(", ");
        match side {
            Side::Robot => format!("The model here is {files}, with effects added to its output as the robot file's model has them."),
            Side::Simulation => format!(
                "The gap to {files} is turned about here, simulated less real: what is named is added to the robot file's model as the simulation \
                 has it beyond the robot. Added to the simulation, what the robot may have beyond it explains clearly less."
            ),
        }
    }
}
