//! A lab session: one robot, one pair of cameras, one seed, any number of recordings.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use nalgebra::{Point3, Vector3};

use super::controller::CYCLE_S;
use super::film::{Scene, Shot, Studio, board_poses, shots, stills};
use super::motion::{Limits, Motion, Trajectory};
use super::options::Options;
use super::render::{Board, Tool};
use super::rig::Rig;
use super::shutter::{Exposure, Hiding, exposures, hidings};
use super::state::{raven_state, reference};
use super::tip::Observer;
use super::trace::{Recorder, Trace};
use super::truth::{Truth, stream};
use crate::camera::Cameras;
use crate::log::{LogWriter, Side, Times, TipObservation, TipStatus, topics};
use crate::robot::{JointType, Kinematics, KinematicsKind, Robot, SourceFormat};
use crate::{Error, Result};

/// What a recording holds.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Written {
    /// Its length [s]: a board takes whole seconds.
    pub duration_s: f64,
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

/// The board of the motion `board`.
pub const BOARD: Board = Board { corners: [9, 6], square_m: 0.012 };
/// The fewest poses of it.
const POSES_MIN: f64 = 25.0;

/// A virtual lab, ready to record.
#[derive(Debug)]
pub struct Session {
    robot: Robot,
    options: Options,
    truth: Truth,
    studio: OnceLock<Studio>,
}

impl Session {
    /// Sets up the lab of a seed around a robot file.
    ///
    /// # Errors
    /// If the file lacks what a plant needs, an effect does not fit, or a number makes no sense.
    pub fn new(robot: &Robot, options: Options) -> Result<Self> {
        options.check()?;
        let topic = motor_topic(robot);
        if robot.source.topic != topic {
            let given = &robot.source.topic;
            return Err(Error::Data(format!(
                "robot `{}`: source.topic is `{given}`, but the simulator writes that format to `{topic}`.",
                robot.name
            )));
        }
        let truth = Truth::draw(robot, &options)?;
        Ok(Self { robot: robot.clone(), options, truth, studio: OnceLock::new() })
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

    /// Moves the robot; `each` hears of every second of it.
    ///
    /// # Errors
    /// If the motion does not fit the robot or the duration makes no sense.
    pub fn run(&self, motion: Motion, duration_s: f64, each: impl FnMut()) -> Result<(Recorder, Trace)> {
        self.check_motion(motion, duration_s)?;
        let mut rng = stream(self.truth.seed, &format!("motion {motion}"));
        let path = Trajectory::of(motion, duration_s, &limits(&self.robot), self.truth.machine.hard_stop, &mut rng);
        let mut recorder = Recorder::at_hard_stop(&self.robot, self.truth.machine.clone(), self.truth.zero_counts)?;
        if !matches!(motion, Motion::Hardstop | Motion::Board) {
            recorder.approach(path.start());
        }
        let trace = recorder.record(&path, duration_s, each);
        Ok((recorder, trace))
    }

    /// Writes one recording to `path`. `progress` hears how much of the work is done, from 0 to 1.
    ///
    /// A board takes a second per pose and has at least 25.
    ///
    /// # Errors
    /// Those of [`Session::run`], or if the file cannot be written.
    pub fn record(&self, motion: Motion, duration_s: f64, path: &Path, mut progress: impl FnMut(f64)) -> Result<Written> {
        self.check_motion(motion, duration_s)?;
        if motion == Motion::Board {
            return self.record_board(duration_s, path, progress);
        }
        let images = self.options.images && self.truth.rig.is_some();
        // Rendering takes most of the time.
        let moving = if images { 0.03 } else { 0.9 };
        let mut second = 0.0;
        let (recorder, trace) = self.run(motion, duration_s, || {
            second += 1.0;
            progress((moving * second / duration_s).min(moving));
        })?;
        let mut log = self.create(motion, path)?;
        let mut robot = RobotMessages { session: self, recorder: &recorder, trace: &trace, next: 0 };
        let mut written = Written { duration_s, ..Written::default() };
        if let (Some(rig), Some(kinematics)) = (&self.truth.rig, self.truth.machine.kinematics()) {
            if images {
                let registration = rig.actual.base_from_left.unwrap_or_default();
                let tool_at = |time_s: f64| {
                    let joint = trace.joint_at(time_s);
                    let tip_m = kinematics.forward(&joint) + self.base_shift_m(time_s);
                    Tool {
                        tip: registration.inverse_transform_point(&Point3::from(tip_m)).coords,
                        axis: registration.inverse_transform_vector(&kinematics.axes(&joint).0[2]),
                    }
                };
                let [left, right] = self.frames(motion, duration_s);
                let shots = shots(&left, &right);
                self.film(&mut log, motion, &Scene::Tool(&tool_at), &shots, &mut written, |log, shot, done| {
                    progress(moving + (1.0 - moving) * done);
                    robot.write_until(log, shot.arrived_s())
                })?;
            } else {
                for tip in self.tips(motion, duration_s, rig, kinematics, &trace) {
                    robot.write_until(&mut log, tip.stamp.seconds_since(self.options.start))?;
                    log.tip(&tip)?;
                    written.tips += 1;
                    written.tips_hidden += usize::from(tip.status != TipStatus::Seen);
                }
            }
        }
        robot.write_until(&mut log, f64::INFINITY)?;
        written.robot = trace.samples().len();
        written.joint_encoders = if self.options.joint_encoders { written.robot } else { 0 };
        let cameras = self.cameras().filter(|_| !images).map(|cameras| cameras.to_yaml());
        log.made_with(&self.robot.to_yaml(), cameras.as_deref().map(str::as_bytes))?;
        log.finish()?;
        Ok(written)
    }

    fn record_board(&self, duration_s: f64, path: &Path, mut progress: impl FnMut(f64)) -> Result<Written> {
        if !self.options.images {
            return Err(Error::Argument("--motion board shows a checkerboard to the cameras; it needs --images.".to_owned()));
        }
        let poses = duration_s.round().max(POSES_MIN);
        let [left, right] = self.frames(Motion::Board, poses);
        let rig = self.rig()?;
        let poses = board_poses(&BOARD, &rig.actual, poses as usize, &mut stream(self.truth.seed, "board"))?;
        let shots = stills(&left, &right, poses.len());
        let mut log = self.create(Motion::Board, path)?;
        let mut written = Written { duration_s: poses.len() as f64, ..Written::default() };
        self.film(&mut log, Motion::Board, &Scene::Board(BOARD, &poses), &shots, &mut written, |_, _, done| {
            progress(done);
            Ok(())
        })?;
        log.finish()?;
        Ok(written)
    }

    /// Renders and writes images; `before` may write what comes before each.
    fn film(
        &self,
        log: &mut LogWriter,
        motion: Motion,
        scene: &Scene<'_>,
        shots: &[Shot],
        written: &mut Written,
        mut before: impl FnMut(&mut LogWriter, &Shot, f64) -> Result<()>,
    ) -> Result<()> {
        let rig = self.rig()?;
        let studio = self.studio.get_or_init(|| Studio::new(self.truth.seed, rig, self.truth.delays));
        let mut done = 0.0;
        studio.shoot(&motion.to_string(), scene, shots, |shot, jpeg| {
            done += 1.0 / shots.len() as f64;
            before(log, shot, done)?;
            let stamp = |time_s| self.options.start.plus_seconds(time_s);
            let times = Times { measured: stamp(shot.exposure.stamp_s), arrived: stamp(shot.arrived_s()) };
            written.images[usize::from(shot.side == Side::Right)] += 1;
            log.compressed_image(shot.side, times, shot.exposure.sequence, &jpeg)
        })
    }

    /// Frames of the left and the right camera.
    fn frames(&self, motion: Motion, duration_s: f64) -> [Vec<Exposure>; 2] {
        let hidden = self.hidings(motion, duration_s);
        Side::BOTH.map(|side| {
            let mut rng = stream(self.truth.seed, &format!("frames {motion} {}", side.name()));
            exposures(side, duration_s, self.options.rate_hz, &self.truth.delays, &hidden, &mut rng)
        })
    }

    fn hidings(&self, motion: Motion, duration_s: f64) -> Vec<Hiding> {
        hidings(duration_s, self.options.hidden_part, &mut stream(self.truth.seed, &format!("hidden {motion}")))
    }

    /// The tip as a tracker would find it in the images of both cameras.
    fn tips(&self, motion: Motion, duration_s: f64, rig: &Rig, kinematics: &Kinematics, trace: &Trace) -> Vec<TipObservation> {
        let hidden = self.hidings(motion, duration_s);
        let observer = Observer { rig, delays: &self.truth.delays, noise_px: self.options.noise_px, frame_id: kinematics.arm.frame0() };
        let tip_at = |time_s: f64| kinematics.forward(&trace.joint_at(time_s)) + self.base_shift_m(time_s);
        let mut rng = stream(self.truth.seed, &format!("tip {motion}"));
        let [left, _] = self.frames(motion, duration_s);
        left.iter()
            .map(|exposure| {
                let time_s = exposure.time_s;
                // A tracker that has all frames knows the stamps without jitter: they follow a regular pace.
                let stamp = self.options.start.plus_seconds(time_s + self.truth.delays.of_image(Side::Left, time_s));
                let hidden = hidden.iter().any(|h| Side::BOTH.iter().any(|&side| h.hides(side, time_s)));
                observer.observe(time_s, stamp, hidden, tip_at, &mut rng)
            })
            .collect()
    }

    /// How far the robot's base is from its place at a time [m, frame 0].
    fn base_shift_m(&self, time_s: f64) -> Vector3<f64> {
        self.truth.outside.as_ref().map_or_else(Vector3::zeros, |outside| outside.base_shift_m(time_s))
    }

    fn check_motion(&self, motion: Motion, duration_s: f64) -> Result<()> {
        if !(0.1..=36_000.0).contains(&duration_s) {
            return Err(Error::Argument(format!("--duration is {duration_s}, expected 0.1 to 36000 s.")));
        }
        let name = &self.robot.name;
        match (&self.robot.kinematics, motion) {
            (KinematicsKind::Bench, Motion::Bench) => Ok(()),
            (KinematicsKind::Bench, _) => {
                Err(Error::Argument(format!("robot `{name}` is a bench: its motion is `bench`, not `{motion}`.")))
            }
            (KinematicsKind::Raven(_), Motion::Bench) => {
                Err(Error::Argument(format!("robot `{name}` is an arm: the motion `bench` is for a drive whose joint is measured.")))
            }
            (KinematicsKind::Raven(_), _) => Ok(()),
        }
    }

    fn rig(&self) -> Result<&Rig> {
        self.truth.rig.as_ref().ok_or_else(|| Error::Argument(format!("robot `{}` is a bench: no camera sees it.", self.robot.name)))
    }

    fn create(&self, motion: Motion, path: &Path) -> Result<LogWriter> {
        let mut log = LogWriter::computed(path)?;
        log.metadata("session", &self.metadata(motion))?;
        Ok(log)
    }

    fn metadata(&self, motion: Motion) -> BTreeMap<String, String> {
        let mut pairs = BTreeMap::new();
        let mut put = |key: &str, value: String| pairs.insert(key.to_owned(), value);
        put("motion", motion.to_string());
        put("robot", self.robot.name.clone());
        put("tool", concat!("raven-capture simulate ", env!("CARGO_PKG_VERSION")).to_owned());
        if motion == Motion::Board {
            let [columns, rows] = BOARD.corners;
            put("board_inner_corners", format!("{columns}x{rows}"));
            put("board_square_m", BOARD.square_m.to_string());
        }
        if let KinematicsKind::Raven(kinematics) = &self.robot.kinematics {
            put("arm", format!("{:?}", kinematics.arm).to_lowercase());
        }
        pairs
    }
}

/// The robot's messages of a recording, written as far as they are due.
struct RobotMessages<'a> {
    session: &'a Session,
    recorder: &'a Recorder,
    trace: &'a Trace,
    next: usize,
}

impl RobotMessages<'_> {
    /// Writes what the robot has said before `time_s` after the start.
    fn write_until(&mut self, log: &mut LogWriter, time_s: f64) -> Result<()> {
        let robot = &self.session.robot;
        let names: Vec<&str> = robot.joints.iter().take(3).map(|joint| joint.name.as_str()).collect();
        while let Some(sample) = self.trace.samples().get(self.next).filter(|_| self.next as f64 * CYCLE_S < time_s) {
            let stamp = self.session.options.start.plus_seconds(self.next as f64 * CYCLE_S);
            match (&robot.kinematics, robot.source.format) {
                (KinematicsKind::Raven(kinematics), SourceFormat::RavenState) => {
                    log.robot_state(stamp, &raven_state(kinematics, self.recorder.controller(), sample))?;
                }
                _ => {
                    let (motor, torque) = (sample.cycle.motor, sample.cycle.torque_asked);
                    let used = ..names.len();
                    log.joint_states(topics::MOTOR_JOINT_STATES, stamp, &names, &motor.as_slice()[used], Some(&torque.as_slice()[used]))?;
                }
            }
            if self.session.options.joint_encoders {
                log.joint_states(topics::JOINT_ENCODERS, stamp, &names, &reference(robot, &sample.joint), None)?;
            }
            self.next += 1;
        }
        Ok(())
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
