//! Benches as hypotheses see them: motor torque, and joint encoders in the place of tips.

mod recorded;
mod signs;
#[cfg(test)]
mod tests;

use nalgebra::Vector3;
use raven::effects::{BenchModel, Channel, Driven, Effect, Measure, Model, Need, Scope, Sited, Stage, Tension};
use raven::log::Recording;
use raven::robot::{Joint, JointType, Robot};
use raven::{Error, Result};

use super::data::{STRIDE_S, WINDOW_S};
use super::rows::{Links, Observed, unlike_several};
use super::settings::{Setting, of_recording};
use super::torques::{CREEP_RAD_S, SLOW, TORQUE_ALIKE_S, TORQUE_MODEL, commanded_per_delivered, surely_moving, with_clipping};
use crate::evidence::weighing::clustered::BLOCK_S;
pub use recorded::Recorded;
pub(crate) use recorded::encoder_noise;
pub use signs::Signs;

/// Part of a joint's dry friction that is not known near rest: these joints are not rolled out.
const NEAR_REST: f64 = 0.5;

/// Errors of one recording's joints and torques, sample by sample, with a 1 where a drive clips; and what turns the torques' into errors of the command.
pub type Errors = (Vec<[Vector3<f64>; 3]>, Vector3<f64>);

/// Recordings of a bench.
#[derive(Clone)]
pub struct Bench<'a> {
    robot: &'a Robot,
    recordings: Vec<Recorded>,
    signs: Vec<Signs>,
    /// What sizes are measured in, per joint.
    measures: Vec<Measure>,
    /// Speeds of the motors below which the direction of their friction is in doubt [rad/s or m/s].
    creep: Vector3<f64>,
    /// Inverse deviations of every sample's joints and torques; 0 where they say nothing.
    weights: Vec<Vec<[Vector3<f64>; 2]>>,
}

impl<'a> Bench<'a> {
    /// Of recordings.
    ///
    /// # Errors
    /// If the robot is no bench of one to three joints, or a recording has no motor side, fewer joints, or too few samples a second.
    pub fn new(robot: &'a Robot, recordings: &[Recording]) -> Result<Self> {
        robot.bench_transmission()?;
        let signs = Signs::of(robot, recordings)?;
        let recorded: Vec<Recorded> = recordings.iter().map(|r| Recorded::new(robot, r, &signs)).collect::<Result<_>>()?;
        for (recording, recorded) in recordings.iter().zip(&recorded) {
            if recorded.driven.is_empty() {
                let message = format!("has no {WINDOW_S} s with five motor samples: the drives' motion cannot be told from it.");
                return Err(Error::file(&recording.path, message));
            }
        }
        let rms = |of: fn(&Driven) -> Vector3<f64>, j: usize| {
            let all = recorded.iter().flat_map(|r| &r.driven).map(|driven| of(driven)[j].powi(2));
            (all.clone().sum::<f64>() / all.count().max(1) as f64).sqrt()
        };
        let measures: Vec<Measure> = (0..robot.joints.len())
            .map(|j| Measure::of(robot, j, rms(|d| d.shaft.commanded.mean(), j), rms(|d| d.shaft.rate, j)))
            .collect();
        let creep = Vector3::from_fn(|j, _| measures.get(j).map_or(1.0, |measure| measure.motor_rate(CREEP_RAD_S)));
        let model = Vector3::from_fn(|j, _| TORQUE_MODEL * rms(|d| d.shaft.commanded.mean(), j) * (TORQUE_ALIKE_S / STRIDE_S).sqrt());
        let weights = recorded.iter().map(|r| weights(robot, r, &model, &creep)).collect();
        Ok(Self { robot, recordings: recorded, signs, measures, creep, weights })
    }

    /// What there is to say about signs and ratios.
    #[must_use]
    pub fn remarks(&self) -> Vec<&str> {
        self.signs.iter().flat_map(|signs| signs.remarks.iter().map(String::as_str)).collect()
    }

    /// Speeds of the motors below which the direction of their friction is in doubt [rad/s or m/s].
    #[must_use]
    pub fn creep(&self) -> Vector3<f64> {
        self.creep
    }

    /// Recordings.
    #[must_use]
    pub fn recordings(&self) -> &[Recorded] {
        &self.recordings
    }

    /// Inverse deviations of a recording's joints and torques, sample by sample; 0 where they say nothing.
    #[must_use]
    pub fn weights(&self, recording: usize) -> &[[Vector3<f64>; 2]] {
        &self.weights[recording]
    }

    /// The same with part of the samples counting less: `counts` says of a recording and time [s] what the weights are multiplied by.
    #[must_use]
    pub fn weighted(mut self, counts: impl Fn(usize, f64) -> f64) -> Self {
        for (r, weights) in self.weights.iter_mut().enumerate() {
            for (driven, weights) in self.recordings[r].driven.iter().zip(weights) {
                weights.iter_mut().for_each(|weight| *weight *= counts(r, driven.shaft.time_s));
            }
        }
        self
    }

    fn count(&self) -> usize {
        self.recordings.iter().map(|r| r.driven.len()).sum()
    }

    fn has_joints(&self) -> bool {
        self.recordings.iter().any(|r| r.joint_noise != Vector3::zeros())
    }

    fn has_torque(&self) -> bool {
        self.recordings.iter().any(|r| r.has[0])
    }

    fn slides(&self, j: usize) -> bool {
        self.measures.get(j).is_some_and(|measure| measure.motor == JointType::Prismatic)
    }

    /// What to say where a bench lacks what an effect at a joint needs.
    fn lacks(&self, need: Need, j: usize) -> Option<&'static str> {
        let joint = self.robot.joints.get(j)?;
        let (lacks, because) = match need {
            Need::Motor => (joint.motor.is_none(), "the file has no motor: what is measured at its shaft is what the cable gets"),
            Need::Turns => (self.slides(j), "its motor slides: it has no turns in which a wave would come again"),
            Need::Cable => (joint.cable.is_none(), "the nominal transmission is rigid"),
            Need::Load => (self.recordings.iter().all(|r| r.has == [false; 2]), "no torque was recorded that tells the load"),
            Need::JointSide => (!self.has_joints(), "nothing measures the joint side: what rubs there counts as the motor's"),
            Need::Link => (self.robot.links.get(j).is_none(), "the file gives nothing that the joint moves"),
            Need::Lenses => (true, "a bench has no cameras"),
        };
        lacks.then_some(because)
    }

    /// The nominal model with effects built in, as a recording begins.
    ///
    /// # Errors
    /// If the robot is no bench.
    pub fn model(&self, settings: &[Setting], recording: usize) -> Result<Model> {
        Model::with_effects(self.robot, None, &of_recording(settings, recording))
    }

    /// Measured less predicted joints [rad or m] and torques [N m or N] of every recording, sample by sample; and what turns the torques'
    /// into errors of the command.
    ///
    /// # Errors
    /// If the robot is no bench.
    pub fn errors(&self, settings: &[Setting], channels: &[Channel]) -> Result<Vec<Errors>> {
        let recordings = self.recordings.iter().zip(&self.weights).enumerate();
        recordings.map(|(k, (recorded, weights))| self.errors_of(recorded, weights, &self.model(settings, k)?, channels)).collect()
    }

    fn errors_of(&self, recorded: &Recorded, weights: &[[Vector3<f64>; 2]], model: &Model, channels: &[Channel]) -> Result<Errors> {
        let bench = BenchModel::new(model, self.creep)?;
        let [with_joints, with_torque] = [Channel::Tip, Channel::Torque].map(|channel| channels.contains(&channel));
        let times_s: Vec<f64> = recorded.driven.iter().map(|driven| driven.shaft.time_s).collect();
        let shown = if with_joints {
            let pull = |driven: &Driven| if recorded.has[0] { bench.passed_on_n(driven) } else { bench.pulled_n(driven) };
            let tension = Tension { time_s: times_s.clone(), value: recorded.driven.iter().map(pull).collect() };
            bench.shown(&recorded.motors, &tension, &times_s)
        } else {
            vec![None; times_s.len()]
        };
        let errors = recorded.driven.iter().zip(&recorded.joints).zip(shown).map(|((driven, joint), shown)| {
            let position = shown.map_or_else(Vector3::zeros, |shown| joint - shown);
            let torque = if with_torque { bench.delivered(driven) - bench.needed(driven) } else { Vector3::zeros() };
            [position, torque, bench.clipped(driven)]
        });
        let samples = recorded.driven.iter().map(|driven| (driven.shaft.commanded.mean(), bench.delivered(driven)));
        let weights: Vec<Vector3<f64>> = weights.iter().map(|[_, torque]| *torque).collect();
        Ok((errors.collect(), commanded_per_delivered(samples, &weights)))
    }
}

impl Observed for Bench<'_> {
    fn robot(&self) -> &Robot {
        self.robot
    }

    fn recordings(&self) -> usize {
        self.recordings.len()
    }

    fn tip_rows(&self) -> usize {
        if self.has_joints() { 3 * self.count() } else { 0 }
    }

    fn torque_rows(&self) -> usize {
        if self.has_torque() { 3 * self.count() } else { 0 }
    }

    fn tip_block(&self) -> usize {
        3 * (BLOCK_S / STRIDE_S).round() as usize
    }

    fn measure(&self, sited: &Sited) -> Measure {
        self.measures.get(sited.joint_measured()).copied().unwrap_or(sited.measure)
    }

    fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
        let Effect { scope, stage, needs, channels, .. } = sited.effect;
        let belongs_to_an_arm = match (scope, stage) {
            (Scope::LinkAngle, _) => Some("a bench has no links"),
            (Scope::Robot, _) => Some("a bench has no tool"),
            (Scope::Rig, Stage::Camera) => Some("a bench has no cameras"),
            (Scope::Pair, _) => Some("a bench's cables run over no other joint's pulleys"),
            (Scope::Rig | Scope::Joint, _) => None,
        };
        let lacks = || needs.iter().find_map(|need| self.lacks(*need, sited.place.first));
        let is_unseen = *scope == Scope::Joint && !self.has_joints() && !channels.contains(&Channel::Torque);
        let is_unseen = is_unseen.then_some("the recording has no joint encoders");
        belongs_to_an_arm.or_else(lacks).or(is_unseen).or_else(|| unlike_several(sited, self.recordings.len()))
    }

    fn residuals(&self, settings: &[Setting], _links: Links, channels: &[Channel]) -> Result<Vec<f64>> {
        let (mut joints, mut torques) = (Vec::with_capacity(self.tip_rows() + self.torque_rows()), Vec::with_capacity(self.torque_rows()));
        for (errors, weights) in self.errors(settings, channels)?.iter().zip(&self.weights) {
            let (errors, per_delivered) = errors;
            for ([joint, torque, clipped], [joint_weight, torque_weight]) in errors.iter().zip(weights) {
                let weighted = |error: f64, weight: f64| if weight > 0.0 && error.is_finite() { error * weight } else { 0.0 };
                joints.extend(joint.zip_map(joint_weight, weighted).iter());
                let torque = torque.component_mul(per_delivered).zip_map(torque_weight, weighted);
                torques.extend(torque.zip_map(clipped, with_clipping).iter());
            }
        }
        joints.truncate(self.tip_rows());
        torques.truncate(self.torque_rows());
        joints.append(&mut torques);
        Ok(joints)
    }
}

/// Inverse deviations of a recording's samples; `model` is that of torques [N m or N]. Near rest nobody knows what friction holds: motors
/// that hardly move say nothing of torque, nor of the stretch of cables whose force follows from such friction.
fn weights(robot: &Robot, recorded: &Recorded, model: &Vector3<f64>, creep: &Vector3<f64>) -> Vec<[Vector3<f64>; 2]> {
    let inverse = |v: f64| if v > 0.0 { 1.0 / v } else { 0.0 };
    let of_joint = |j: usize| robot.joints.get(j).and_then(|joint| joint.link_friction).map_or(0.0, |friction| friction.coulomb);
    let weight = |driven: &Driven| {
        let surely_moving = |j: usize| surely_moving(&driven.shaft, j, creep[j]);
        let position = |j: usize, _| {
            let joint = robot.joints.get(j);
            let in_doubt = if recorded.has[0] { joint.is_some_and(|joint| joint.motor.is_some()) } else { of_joint(j) > 0.0 };
            if !in_doubt || surely_moving(j) { inverse(recorded.joint_noise[j]) } else { 0.0 }
        };
        let torque = |j: usize, _| {
            let Some(joint) = robot.joints.get(j).filter(|_| recorded.has[0] && surely_moving(j)) else { return 0.0 };
            let slow = 1.0 / (1.0 + (driven.shaft.rate[j] / joint.ratio() / (SLOW * joint.stiction_speed())).powi(2));
            let friction = of_joint(j) * joint.motor_capstan_radius / joint.link_pulley_radius;
            let alike = (TORQUE_ALIKE_S / STRIDE_S).sqrt();
            if model[j] > 0.0 { 1.0 / model[j].hypot(NEAR_REST * friction * slow * alike) } else { 0.0 }
        };
        [Vector3::from_fn(position), Vector3::from_fn(torque)]
    };
    recorded.driven.iter().map(weight).collect()
}

/// One joint's numbers of a series.
pub(crate) fn by_joint<'s>(series: &'s [Vec<f64>], recording: &Recording, what: &str, joint: &Joint, j: usize) -> Result<&'s [f64]> {
    series.get(j).map(Vec::as_slice).ok_or_else(|| {
        let message =
            format!("has {} joints on the {what} side, but the robot file names joint {} (`{}`).", series.len(), j + 1, joint.name);
        Error::file(&recording.path, message)
    })
}
