//! A lab session: one robot, one pair of cameras, one seed, any number of recordings.

use std::collections::BTreeMap;
use std::path::Path;

use super::controller::CYCLE_S;
use super::effect::Effect;
use super::motion::{Limits, Motion, Trajectory};
use super::rig::Rig;
use super::shutter::{exposures, hidden_times};
use super::state::{raven_state, reference};
use super::tip::Observer;
use super::trace::{Recorder, Trace};
use super::truth::{Hidden, Truth, stream};
use crate::camera::Cameras;
use crate::log::{LogWriter, Side, Stamp, TipObservation, TipStatus, topics};
use crate::robot::{ArmSide, JointType, Kinematics, KinematicsKind, Robot, SourceFormat};
use crate::{Error, Result};

/// What a session is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Everything follows from it.
    pub seed: u64,
    /// Preset of hidden effects.
    pub hidden: Hidden,
    /// More hidden effects.
    pub effects: Vec<Effect>,
    /// Whether recordings hold images, or the tip as a tracker would find it.
    pub images: bool,
    /// Frames per second.
    pub rate_hz: f64,
    /// Standard deviation of a tracked coordinate, where there are no images [px].
    pub noise_px: f64,
    /// Part of the time during which something hides the marker.
    pub hidden_part: f64,
    /// First stamp.
    pub start: Stamp,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 7,
            hidden: Hidden::None,
            effects: Vec::new(),
            images: false,
            rate_hz: 15.0,
            noise_px: 0.1,
            hidden_part: 0.03,
            start: Stamp::from_ros(1_750_000_000, 0),
        }
    }
}

/// What a recording holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Written {
    /// Messages of the motor side.
    pub robot: usize,
    /// Messages of the reference encoders.
    pub joint_encoders: usize,
    /// Tip observations.
    pub tips: usize,
    /// Those among them that are hidden.
    pub tips_hidden: usize,
    /// Images, left and right.
    pub images: [usize; 2],
}

/// A virtual lab, ready to record.
#[derive(Debug)]
pub struct Session {
    robot: Robot,
    options: Options,
    truth: Truth,
}

impl Session {
    /// Sets up the lab of a seed around a robot file.
    ///
    /// # Errors
    /// If the file lacks what a plant needs, an effect does not fit, or a number makes no sense.
    pub fn new(robot: &Robot, options: Options) -> Result<Self> {
        if !(1.0..=240.0).contains(&options.rate_hz) {
            return Err(Error::Argument(format!("--rate is {}, expected 1 to 240 frames per second.", options.rate_hz)));
        }
        if !(0.0..=10.0).contains(&options.noise_px) {
            return Err(Error::Argument(format!("--noise is {}, expected 0 to 10 px.", options.noise_px)));
        }
        if !(0.0..=0.9).contains(&options.hidden_part) {
            return Err(Error::Argument(format!("--occluded is {}, expected 0 to 0.9 of the time.", options.hidden_part)));
        }
        let topic = motor_topic(robot);
        if robot.source.topic != topic {
            let given = &robot.source.topic;
            return Err(Error::Data(format!(
                "robot `{}`: source.topic is `{given}`, but the simulator writes that format to `{topic}`.",
                robot.name
            )));
        }
        let truth = Truth::draw(robot, options.seed, options.hidden, &options.effects)?;
        Ok(Self { robot: robot.clone(), options, truth })
    }

    /// What is true of it.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// The truth as a file tells it.
    #[must_use]
    pub fn truth_json(&self) -> serde_json::Value {
        self.truth.to_json(&self.robot)
    }

    /// The cameras as a perfect calibration would describe them, hidden effects aside; `None` on a bench.
    #[must_use]
    pub fn cameras(&self) -> Option<&Cameras> {
        self.truth.rig.as_ref().map(|rig| &rig.believed)
    }

    /// Moves the robot; `each` hears of every second of it. Empty for a motion without a robot.
    ///
    /// # Errors
    /// If the motion does not fit the robot or the duration makes no sense.
    pub fn run(&self, motion: Motion, duration_s: f64, each: impl FnMut()) -> Result<(Recorder, Trace)> {
        if !(0.1..=36_000.0).contains(&duration_s) {
            return Err(Error::Argument(format!("--duration is {duration_s}, expected 0.1 to 36000 s.")));
        }
        let bench = matches!(self.robot.kinematics, KinematicsKind::Bench);
        if bench != (motion == Motion::Bench) {
            let name = &self.robot.name;
            return Err(Error::Argument(if bench {
                format!("robot `{name}` is a bench: its motion is `bench`, not `{motion}`.")
            } else {
                format!("robot `{name}` is an arm: the motion `bench` is for a drive whose joint is measured.")
            }));
        }
        let mut rng = stream(self.truth.seed, &format!("motion {motion}"));
        let path = Trajectory::of(motion, duration_s, &limits(&self.robot), self.truth.machine.hard_stop, &mut rng);
        let mut recorder = Recorder::at_hard_stop(&self.robot, self.truth.machine.clone(), self.truth.zero_counts)?;
        if motion != Motion::Hardstop {
            recorder.approach(path.start());
        }
        let trace = recorder.record(&path, duration_s, each);
        Ok((recorder, trace))
    }

    /// Writes one recording to `path`; `each` hears of every second of the robot's motion.
    ///
    /// # Errors
    /// Those of [`Session::run`], or if the file cannot be written.
    pub fn record(&self, motion: Motion, duration_s: f64, path: &Path, each: impl FnMut()) -> Result<Written> {
        if motion == Motion::Board && !self.options.images {
            return Err(Error::Argument("--motion board shows a checkerboard to the cameras; it needs --images.".to_owned()));
        }
        let (recorder, trace) = self.run(motion, duration_s, each)?;
        let mut log = LogWriter::create(path)?;
        log.metadata("session", &self.metadata(motion))?;
        let tips = match (&self.truth.rig, self.truth.machine.kinematics()) {
            (Some(rig), Some(kinematics)) => self.tips(motion, duration_s, rig, kinematics, &trace),
            _ => Vec::new(),
        };
        let written = self.write_robot(&mut log, &recorder, &trace, &tips)?;
        log.attachment("robot.yaml", "application/yaml", self.robot.to_yaml().as_bytes())?;
        if let Some(cameras) = self.cameras() {
            log.attachment("cameras.yaml", "application/yaml", cameras.to_yaml().as_bytes())?;
        }
        log.finish()?;
        Ok(written)
    }

    /// Messages of the robot, with the tip's observations among them.
    fn write_robot(&self, log: &mut LogWriter, recorder: &Recorder, trace: &Trace, tips: &[TipObservation]) -> Result<Written> {
        let mut written = Written::default();
        let names: Vec<&str> = self.robot.joints.iter().take(3).map(|joint| joint.name.as_str()).collect();
        let mut waiting = tips.iter().peekable();
        for (k, sample) in trace.samples().iter().enumerate() {
            let stamp = self.options.start.plus_seconds(k as f64 * CYCLE_S);
            while let Some(tip) = waiting.next_if(|tip| tip.stamp <= stamp) {
                log.tip(tip)?;
            }
            match (&self.robot.kinematics, self.robot.source.format) {
                (KinematicsKind::Raven(kinematics), SourceFormat::RavenState) => {
                    log.robot_state(stamp, &raven_state(kinematics, recorder.controller(), sample))?;
                }
                _ => {
                    let (motor, torque) = (sample.cycle.motor, sample.cycle.torque_asked);
                    let used = ..names.len();
                    log.joint_states(topics::MOTOR_JOINT_STATES, stamp, &names, &motor.as_slice()[used], Some(&torque.as_slice()[used]))?;
                }
            }
            log.joint_states(topics::JOINT_ENCODERS, stamp, &names, &reference(&self.robot, &sample.joint), None)?;
            written.robot += 1;
            written.joint_encoders += 1;
        }
        for tip in waiting {
            log.tip(tip)?;
        }
        written.tips = tips.len();
        written.tips_hidden = tips.iter().filter(|tip| tip.status != TipStatus::Seen).count();
        Ok(written)
    }

    /// The tip as a tracker would find it in the images of both cameras.
    fn tips(&self, motion: Motion, duration_s: f64, rig: &Rig, kinematics: &Kinematics, trace: &Trace) -> Vec<TipObservation> {
        let mut rng = stream(self.truth.seed, &format!("tip {motion}"));
        let hidden = hidden_times(duration_s, self.options.hidden_part, &mut rng);
        let frame_id = match kinematics.arm {
            ArmSide::Gold => "frame0_gold",
            ArmSide::Green => "frame0_green",
        };
        let observer = Observer { rig, delays: &self.truth.delays, noise_px: self.options.noise_px, frame_id };
        let tip_at = |time_s: f64| kinematics.forward(&trace.joint_at(time_s));
        exposures(Side::Left, duration_s, self.options.rate_hz, &self.truth.delays, &hidden, &mut rng)
            .iter()
            .map(|exposure| {
                // A tracker that has both images knows the stamp without jitter: it fits the frames' regular pace.
                let stamp = self.options.start.plus_seconds(exposure.time_s + self.truth.delays.of_image(Side::Left, exposure.time_s));
                observer.observe(exposure.time_s, stamp, exposure.hidden, tip_at, &mut rng)
            })
            .collect()
    }

    fn metadata(&self, motion: Motion) -> BTreeMap<String, String> {
        let mut pairs = BTreeMap::new();
        let mut put = |key: &str, value: String| pairs.insert(key.to_owned(), value);
        put("motion", motion.to_string());
        put("robot", self.robot.name.clone());
        put("tool", concat!("raven-capture simulate ", env!("CARGO_PKG_VERSION")).to_owned());
        if let KinematicsKind::Raven(kinematics) = &self.robot.kinematics {
            put("arm", format!("{:?}", kinematics.arm).to_lowercase());
        }
        pairs
    }
}

/// Where the motor side goes.
fn motor_topic(robot: &Robot) -> &'static str {
    match robot.source.format {
        SourceFormat::RavenState => topics::RAVEN_STATE,
        SourceFormat::JointState => topics::MOTOR_JOINT_STATES,
    }
}

/// Ranges of the joints; a bench whose file has none moves by a radian or a decimetre about its hard stop.
fn limits(robot: &Robot) -> Limits {
    std::array::from_fn(|j| {
        let Some(joint) = robot.joints.get(j) else { return [0.0; 2] };
        let reach = match joint.kind {
            JointType::Revolute => 1.0,
            JointType::Prismatic => 0.1,
        };
        joint.limits.unwrap_or([joint.hard_stop - reach, joint.hard_stop + reach])
    })
}
