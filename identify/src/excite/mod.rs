//! Proposes the motion that would identify what is missing, and says what no such motion will.
//!
//! Twelve candidate motions are rolled out with the robot file and scored by what a nominal pair of cameras would then know of the wanted
//! unknowns, beside the file's other numbers, which are known to their tolerances. The proposal takes one after the other: each time the one
//! that lowers the sum of their expected posterior variances most, in units of the prior's. An unknown that no motion shows does not move that
//! sum, so it does not decide.

pub mod candidates;
pub mod motion;
mod report;
pub mod score;
mod table;

use std::fmt::Write as _;
use std::io::Write;

use nalgebra::{DMatrix, Vector3};
use raven::camera::Quality;
use raven::cli::{self, Outcome};
use raven::robot::{KinematicsKind, Robot};
use raven::simulation::CYCLE_S;
use raven::{Error, Result, files};
use rayon::prelude::*;

use crate::args::Excite;
use crate::batch::IDENTIFIED_BELOW;
use crate::parameters::Selection;
use crate::priors::{self, Unknown};
use crate::tolerances::Tolerances;
use candidates::{ALL, Candidate};
use motion::{Plan, motors, speed_max};
use report::{Line, Report};
use score::{Sensor, information, ratios};

/// Rate of the nominal cameras, and of faster ones that might replace them [Hz].
const CAMERA_HZ: f64 = 15.0;
const FAST_CAMERA_HZ: f64 = 120.0;
/// Rate at which joint encoders are read [Hz].
const ENCODER_HZ: f64 = 1000.0;
/// Length of a piece of the proposal [s], and what of it the move to it may take.
const PIECE_S: f64 = 12.0;
const APPROACH_S: f64 = 2.5;
/// Shortest and longest proposal [s].
const DURATION_S: [f64; 2] = [10.0, 3600.0];
/// Most repetitions that are worth naming.
const REPETITIONS_MAX: usize = 64;

/// Proposes a motion, as the arguments ask for it.
///
/// # Errors
/// If an argument or the robot file is wrong, or the motion cannot be written.
pub fn run(args: &Excite, out: &mut dyn Write) -> Result<Outcome> {
    if !(DURATION_S[0]..=DURATION_S[1]).contains(&args.duration) {
        return Err(Error::Argument(format!("--duration is {}, expected {} to {} s.", args.duration, DURATION_S[0], DURATION_S[1])));
    }
    let outputs = [("-o", args.output.as_deref()), ("--json", args.json.as_deref())];
    let has_table = cli::is_left_for_words(&outputs)?;
    files::apart([&args.robot], &outputs)?;
    let robot = Robot::read(&args.robot)?;
    if matches!(robot.kinematics, KinematicsKind::Bench) {
        let message = "it is a bench (kinematics.kind: bench), and exciting motions are for an arm; give an arm's robot file.";
        return Err(Error::file(&args.robot, message));
    }
    let limits = robot.arm()?.limits;
    let names = args.parameters.clone().unwrap_or_else(|| ["r_l", "offset", "k_e", "b_e", "F_c", "latency"].map(str::to_owned).to_vec());
    let unknowns = priors::unknowns(&robot, &Selection::named(&names)?, &Quality::default())?;
    let spinner = cli::spinner("trying motions");
    let beside = Tolerances::beside(&robot, &unknowns)?.and(Tolerances::left(&robot, &unknowns, 1));
    let lab = Lab { robot: &robot, unknowns: &unknowns, beside: &beside, limits, fastest: speed_max(&robot) };
    let found = lab.proposal(args.duration).and_then(|proposal| {
        let report = (args.json.is_some() || has_table && !args.table).then(|| lab.report(&proposal, args.duration)).transpose()?;
        let text = match &report {
            _ if !has_table => String::new(),
            Some(report) if !args.table => report.text(),
            _ => table::table(&lab, &proposal, args.duration)?,
        };
        Ok((proposal, report, text))
    });
    spinner.finish_and_clear();
    let (proposal, report, text) = found?;
    if let Some(path) = &args.output {
        cli::write_text(path, &csv(&robot, &proposal.plan), out)?;
    }
    cli::results(out, &text, args.json.as_deref(), &report)?;
    Ok(Outcome::Done)
}

/// What motions are made for.
struct Lab<'a> {
    robot: &'a Robot,
    unknowns: &'a [Unknown],
    /// The file's other numbers.
    beside: &'a Tolerances,
    limits: raven::simulation::Limits,
    fastest: Vector3<f64>,
}

/// A motion and what it is made of.
struct Proposal {
    plan: Plan,
    pieces: Vec<Candidate>,
}

impl Lab<'_> {
    /// Greedy choice of pieces.
    fn proposal(&self, duration_s: f64) -> Result<Proposal> {
        let count = (duration_s / PIECE_S).round().max(1.0);
        let length_s = duration_s / count - APPROACH_S;
        let alone = |c: &Candidate| {
            let segment = c.segment(length_s, &self.limits, &self.fastest);
            self.information(length_s, Sensor::Camera(CAMERA_HZ), |t| segment.at(t))
        };
        let told: Vec<DMatrix<f64>> = ALL.par_iter().map(alone).collect::<Result<_>>()?;
        let n = self.unknowns.len() + self.beside.len();
        let mut sum = DMatrix::zeros(n, n);
        let mut pieces = Vec::new();
        for _ in 0..count as usize {
            let left = |i: &usize| self.unknown_variance(&(&sum + &told[*i]));
            let Some(best) = (0..ALL.len()).min_by(|a, b| left(a).total_cmp(&left(b))) else { break };
            sum += &told[best];
            pieces.push(ALL[best]);
        }
        let plan = |length_s: f64| {
            let append = |plan: Plan, piece: &Candidate| plan.then(piece.segment(length_s, &self.limits, &self.fastest), &self.fastest);
            pieces.iter().fold(Plan::default(), append)
        };
        // The moves between the pieces take less than was left for them.
        let spare_s = duration_s - plan(length_s).duration_s();
        Ok(Proposal { plan: plan(length_s + spare_s / count), pieces })
    }

    /// What is left to know of the wanted unknowns: expected posterior variances over the prior's.
    fn unknown_variance(&self, information: &DMatrix<f64>) -> f64 {
        ratios(information).iter().zip(self.unknowns).filter(|(_, u)| u.named).map(|(ratio, _)| ratio * ratio).sum()
    }

    fn information(&self, duration_s: f64, sensor: Sensor, set_point: impl Fn(f64) -> Vector3<f64>) -> Result<DMatrix<f64>> {
        let track = motors(&self.robot.arm()?.transmission, duration_s, set_point);
        information(self.robot, self.unknowns, self.beside, &track, sensor)
    }

    fn report(&self, proposal: &Proposal, duration_s: f64) -> Result<Report> {
        let plan = &proposal.plan;
        let sinusoid = Candidate::Sinusoid.segment(duration_s, &self.limits, &self.fastest);
        let before = self.information(duration_s, Sensor::Camera(CAMERA_HZ), |t| sinusoid.at(t))?;
        let by = |sensor| self.information(plan.duration_s(), sensor, |t| plan.at(t));
        let after = by(Sensor::Camera(CAMERA_HZ))?;
        let faster = by(Sensor::Camera(FAST_CAMERA_HZ))?;
        let encoders = &after + by(Sensor::JointEncoders(ENCODER_HZ))?;
        let [before, proposed, faster, encoders] = [&before, &after, &faster, &encoders].map(ratios);
        let line = |(k, unknown): (usize, &Unknown)| Line {
            name: unknown.quantity.name(),
            joint: unknown.quantity.joint(self.robot),
            sinusoid: before[k],
            proposal: proposed[k],
            fast_cameras: faster[k],
            joint_encoders: encoders[k],
            identified: proposed[k] <= IDENTIFIED_BELOW,
            repetitions: (proposed[k] > IDENTIFIED_BELOW).then(|| repetitions(&after, k)).flatten(),
            named: unknown.named,
        };
        Ok(Report {
            parameters: self.unknowns.iter().enumerate().map(line).collect(),
            pieces: proposal.pieces.iter().map(|piece| piece.name()).collect(),
            sinusoid_s: duration_s,
            duration_s: plan.duration_s(),
            camera_hz: CAMERA_HZ,
            fast_camera_hz: FAST_CAMERA_HZ,
            encoder_hz: ENCODER_HZ,
        })
    }
}

/// How often a motion must be repeated until it identifies an unknown.
fn repetitions(information: &DMatrix<f64>, k: usize) -> Option<usize> {
    (2..=REPETITIONS_MAX).find(|&count| ratios(&(information * count as f64))[k] <= IDENTIFIED_BELOW)
}

/// Set points over time, one per control cycle.
fn csv(robot: &Robot, plan: &Plan) -> String {
    let mut text = String::from("time_s");
    for joint in robot.joints.iter().take(3) {
        let unit = if joint.kind == raven::robot::JointType::Prismatic { "m" } else { "rad" };
        let _ = write!(text, ",{}_{unit}", joint.name);
    }
    text.push('\n');
    for i in 0..=(plan.duration_s() / CYCLE_S).round() as usize {
        let time_s = i as f64 * CYCLE_S;
        let [a, b, c] = plan.at(time_s).into();
        let _ = writeln!(text, "{time_s:.3},{a:.7},{b:.7},{c:.7}");
    }
    text
}
