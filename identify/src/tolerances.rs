//! Numbers of the robot file that nobody asked for: each may be off by its tolerance, and moves all sightings alike.
//!
//! A link angle within its tolerance passes for a part of a radius, a clock that drifts for a latency, and neither averages out: taken for
//! exact they would let a number claim several times less than it is off by. Which numbers of a file have a tolerance, and what each
//! changes, says the library of effects.
//!
//! What the motion before a recording left of an effect that remembers is such a number too, and each recording has its own: a cable that has
//! slipped stays where it is, and one that creeps takes its time.

use nalgebra::Vector3;
use raven::effects::{Channel, Home, Parameter, Scale, Sited, Stage, at_place};
use raven::robot::Robot;
use raven::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;

use crate::batch::Estimate;
use crate::prediction::Predictor;
use crate::priors::Unknown;
use crate::problem::Flaw;
use crate::session::Session;

/// Part of a tolerance over which derivatives are taken: enough of one for the chance by which friction grips in rollouts not to count.
const STEP: f64 = 0.1;

/// The numbers of a file that may be off within their tolerances, beside what is estimated.
#[derive(Debug, Clone, Default)]
pub struct Tolerances(Vec<Number>);

/// Where the links are taken to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Links {
    /// Where the cables hold them.
    AtRest,
    /// Where rollouts have them, for numbers on which that depends.
    Rolling,
}

/// A number of the robot file, as an effect at its place changes it, or what the motion before a recording left of that effect.
#[derive(Debug, Clone)]
pub(crate) struct Number {
    sited: Sited,
    /// Which of the effect's parameters.
    parameter: usize,
    /// Its tolerance, as `u` of that parameter.
    tolerance_u: f64,
    joint: Option<String>,
    /// Which recording begins with it, where that is no number of the file.
    recording: Option<usize>,
}

/// What recordings say of a number that nobody asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// The effect that changes it, at its place: `tool-length`, `pulley-radius:elbow`.
    pub effect: String,
    /// Which of the effect's numbers.
    pub parameter: &'static str,
    /// Which recording begins with it, from 0 in their order; of the file where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<usize>,
    /// By how many of its tolerances it seems to be off.
    pub tolerances_off: f64,
    /// Standard deviation of that: 1 where the recordings say nothing of it.
    pub std: f64,
}

impl Tolerances {
    /// Of the numbers of `robot`, less the `unknowns` and what belongs to the cameras.
    ///
    /// # Errors
    /// If a tolerance is one that no such hardware has.
    pub fn beside(robot: &Robot, unknowns: &[Unknown]) -> Result<Self> {
        let mut beside = Vec::new();
        for number in Sited::all(robot).into_iter().flat_map(|sited| Number::all(robot, sited)) {
            let changed = number.off(robot, STEP)?;
            let is_unknown = robot.changes_to(&changed).iter().any(|change| unknowns.iter().any(|unknown| unknown.key == change.key));
            if changed != *robot && !is_unknown {
                beside.push(number);
            }
        }
        Ok(Self(beside))
    }

    /// Of what the motion before each of so many recordings left of the effects that `robot` has, or would have with the `unknowns` off by their
    /// deviation: what is asked about may be an effect that remembers.
    #[must_use]
    pub fn left(robot: &Robot, unknowns: &[Unknown], recordings: usize) -> Self {
        let mut robot = robot.clone();
        for unknown in unknowns {
            if let Some(value) = robot.value_mut(&unknown.key) {
                *value = unknown.value(1.0);
            }
        }
        Self(Sited::all(&robot).into_iter().flat_map(|sited| Number::left(&robot, sited, recordings)).collect())
    }

    /// Together with others.
    pub(crate) fn and(mut self, others: Self) -> Self {
        self.0.extend(others.0);
        self
    }

    /// Of those numbers that move the tips of `sessions`; and how far one tolerance of each moves them, the links at rest.
    ///
    /// # Errors
    /// If the robot is no arm, or a tolerance is one that no such hardware has.
    pub fn of(robot: &Robot, unknowns: &[Unknown], sessions: &[Session]) -> Result<(Self, Vec<Flaw>)> {
        let beside = Self::beside(robot, unknowns)?;
        let flaws = beside.flaws(robot, sessions, Links::AtRest)?;
        let shows = |number: &Number, flaw: &Flaw| number.swings() || flaw.iter().any(|moved| *moved != Vector3::zeros());
        let (numbers, flaws) = beside.0.into_iter().zip(flaws).filter(|(number, flaw)| shows(number, flaw)).unzip();
        Ok((Self(numbers), flaws))
    }

    /// How far one tolerance of each moves the sightings of a robot near that of the file.
    ///
    /// # Errors
    /// If a number cannot be what its tolerance allows.
    pub fn flaws(&self, robot: &Robot, sessions: &[Session], links: Links) -> Result<Vec<Flaw>> {
        self.slopes(robot, |robot, number| {
            let predictor = Predictor::new(robot)?;
            let rolls = links == Links::Rolling && number.swings();
            let lag = |session: &Session| rolls.then(|| predictor.session_lag(session));
            let seen_m = |(s, session): (usize, &Session)| match number.recording {
                Some(recording) if recording != s => vec![Vector3::zeros(); session.sightings.len()],
                _ => predictor.session_m(session, lag(session).as_deref()),
            };
            Ok(sessions.iter().enumerate().flat_map(seen_m).collect())
        })
    }

    /// How far one tolerance of each moves what is `measured` of a robot near that of the file, of which that number is off.
    ///
    /// # Errors
    /// If a number cannot be what its tolerance allows, or what is measured cannot be computed.
    pub(crate) fn slopes(
        &self,
        robot: &Robot,
        measured: impl Fn(&Robot, &Number) -> Result<Vec<Vector3<f64>>> + Sync,
    ) -> Result<Vec<Vec<Vector3<f64>>>> {
        let slope = |number: &Number| {
            let [behind, ahead] = [-STEP, STEP].map(|tolerances| measured(&number.off(robot, tolerances)?, number));
            Ok(ahead?.iter().zip(&behind?).map(|(ahead, behind)| (ahead - behind) / (2.0 * STEP)).collect())
        };
        self.0.par_iter().map(slope).collect()
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Which of them belong to kinematics.
    pub(crate) fn of_kinematics(&self) -> impl Iterator<Item = usize> {
        self.0.iter().enumerate().filter(|(_, number)| number.sited.effect.stage == Stage::Kinematics).map(|(k, _)| k)
    }

    /// What an estimate says of them, of whose unknowns they are those from `first` on.
    #[must_use]
    pub fn found(&self, estimate: &Estimate, first: usize) -> Vec<Found> {
        let found = |(k, number): (usize, &Number)| Found {
            effect: at_place(number.sited.effect.id, number.joint.as_deref()),
            parameter: number.sited.effect.parameters[number.parameter].name,
            recording: number.recording,
            tolerances_off: estimate.z[k],
            std: estimate.std[k],
        };
        (first..).zip(&self.0).map(found).collect()
    }
}

impl Number {
    /// Those of an effect that have a tolerance and move tips as they do. What the file's list of effects has was measured.
    fn all(robot: &Robot, sited: Sited) -> Vec<Self> {
        let effect = sited.effect;
        if effect.stage == Stage::Camera
            || effect.home() == Home::Cameras
            || !effect.channels.contains(&Channel::Tip)
            || sited.is_listed(robot)
        {
            return Vec::new();
        }
        let straight = |parameter: &Parameter| matches!(parameter.scale, Scale::Offset(_) | Scale::Factor { .. });
        Self::of_effect(robot, sited, straight).collect()
    }

    /// What so many recordings begin with of an effect. Where friction held a link is forgotten as soon as that moves.
    fn left(robot: &Robot, sited: Sited, recordings: usize) -> Vec<Self> {
        if sited.effect.element.is_some() {
            return Vec::new();
        }
        let states = Self::of_effect(robot, sited, |parameter| parameter.scale.is_state()).filter(|state| state.tolerance_u > 0.0);
        states.flat_map(|of_any| (0..recordings).map(move |s| Self { recording: Some(s), ..of_any.clone() })).collect()
    }

    /// The parameters of an effect that are wanted and have a tolerance.
    fn of_effect(robot: &Robot, sited: Sited, wanted: impl Fn(&Parameter) -> bool) -> impl Iterator<Item = Self> {
        let parameters = sited.effect.parameters.iter().enumerate().filter(move |(_, parameter)| wanted(parameter));
        parameters.filter_map(move |(parameter, of_effect)| {
            let tolerance_u = of_effect.tolerance_u(robot, sited.place, sited.measure)?;
            Some(Self { sited, parameter, tolerance_u, joint: sited.joint(robot), recording: None })
        })
    }

    /// Whether it changes how the links swing about their rest.
    fn swings(&self) -> bool {
        self.sited.effect.element.is_some()
    }

    /// A robot with it off by so many tolerances.
    fn off(&self, robot: &Robot, tolerances: f64) -> Result<Robot> {
        let mut u = vec![0.0; self.sited.effect.parameters.len()];
        u[self.parameter] = tolerances * self.tolerance_u;
        self.sited.begun(robot, &self.sited.values(&u)).map_err(|error| {
            let effect = at_place(self.sited.effect.id, self.joint.as_deref());
            Error::Data(format!("the robot file's `tolerances` allow of {effect} what cannot be, in {tolerances:+} of one: {error}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use raven::camera::Quality;
    use raven::robot::{MotorTrack, nominal};

    use super::*;
    use crate::motion::Motion;
    use crate::parameters::Selection;
    use crate::priors;
    use crate::session::Sighting;

    fn moving() -> Session {
        let transmission = nominal::gold().arm().unwrap().transmission;
        let time_s: Vec<f64> = (0..2000).map(|i| f64::from(i) * 5e-3).collect();
        let joint = |t: f64| Vector3::new(0.8 + 0.4 * t.sin(), 1.6 + 0.4 * (0.7 * t).sin(), 0.33 + 0.05 * (0.5 * t).sin());
        let angle = time_s.iter().map(|&t| transmission.motor_from_joint(&joint(t))).collect();
        let sighting = |i: u32| Sighting::new(0.5 + 0.1 * f64::from(i), Vector3::zeros(), &(Matrix3::identity() * 1e-8)).unwrap();
        let motion = Motion::new(MotorTrack { time_s, angle }, 0.02).unwrap();
        Session { name: String::new(), sha256: String::new(), motion, sightings: (0..90).map(sighting).collect() }
    }

    fn beside(names: &[&str]) -> Vec<String> {
        let robot = nominal::gold();
        let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
        let unknowns = priors::unknowns(&robot, &Selection::named(&names).unwrap(), &Quality::default()).unwrap();
        let (tolerances, _) = Tolerances::of(&robot, &unknowns, &[moving()]).unwrap();
        tolerances.0.iter().map(|number| at_place(number.sited.effect.id, number.joint.as_deref())).collect()
    }

    #[test]
    fn what_is_not_asked_for_and_moves_the_tip_is_beside() {
        let all = beside(&["straight_part_1"]);
        let kinds = [
            ("pulley-radius", 3),
            ("joint-offset", 3),
            ("cable-coupling", 3),
            ("cable-stretch", 3),
            ("cable-damping", 3),
            // Its amount, and how it fades towards rest.
            ("link-coulomb-friction", 6),
            ("tool-length", 1),
            ("link-angle", 2),
            ("time-offset", 1),
            ("clock-drift", 1),
        ];
        for (kind, count) in kinds {
            assert_eq!(all.iter().filter(|name| name.split(':').next() == Some(kind)).count(), count, "{kind} of {all:?}");
        }
        assert_eq!(all.len(), kinds.iter().map(|(_, count)| count).sum::<usize>(), "{all:?}");
        let asked = ["r_l2", "offset_1", "coupling_12", "k_e3", "b_e1", "F_c2", "latency"];
        assert_eq!(beside(&asked).len(), all.len() - asked.len());
    }

    /// Of effects that the file has, and of those that are asked about; not of a nominal robot.
    #[test]
    fn each_recording_begins_anew() {
        let nominal = nominal::gold();
        let creep = Sited::at(&nominal, "creep", Some("elbow")).unwrap();
        let creeping = creep.added_to(&nominal, None, &creep.values(&[1.0, 0.0, 0.0])).unwrap();
        let asked = |name: &str| priors::unknowns(&nominal, &Selection::named(&[name.to_owned()]).unwrap(), &Quality::default()).unwrap();
        let count = |robot: &Robot, name: &str| Tolerances::left(robot, &asked(name), 2).len();
        assert_eq!([count(&nominal, "r_l1"), count(&creeping, "r_l1")], [0, 2]);
        assert_eq!([count(&nominal, "hysteresis_3"), count(&creeping, "hysteresis_3")], [2, 4]);

        let sessions = [moving(), moving()];
        let flaws = Tolerances::left(&creeping, &[], 2).flaws(&creeping, &sessions, Links::AtRest).unwrap();
        let sightings = sessions[0].sightings.len();
        for (s, flaw) in flaws.iter().enumerate() {
            let (first, second) = flaw.split_at(sightings);
            let [own, other] = if s == 0 { [first, second] } else { [second, first] };
            assert!(other.iter().all(|moved| *moved == Vector3::zeros()));
            // What is left creeps back with the law's own time.
            let predictor = Predictor::new(&creeping).unwrap();
            let of_joints = |k: usize| {
                let (session, time_s) = (&sessions[s], sessions[s].sightings[k].time_s);
                let from_joints = predictor.seen_from_joints(&predictor.driving(&session.motion), time_s);
                (from_joints.try_inverse().unwrap() * own[k], time_s)
            };
            let [(early, early_s), (late, late_s)] = [0, sightings - 1].map(of_joints);
            assert!(early[1].abs() > 1e-5, "{early}");
            approx::assert_relative_eq!(late[1] / early[1], ((early_s - late_s) / 30.0).exp(), max_relative = 0.02);
        }
    }

    #[test]
    fn a_flaw_is_how_far_a_tolerance_moves_the_tip() {
        let (robot, sessions) = (nominal::gold(), [moving()]);
        let (tolerances, flaws) = Tolerances::of(&robot, &[], &sessions).unwrap();
        let mut longer = robot.clone();
        *longer.value_mut("kinematics.wrist_offset").unwrap() += robot.tolerances.tool_length_m;
        longer.keep_encoders_of(&robot).unwrap();
        let [before, after] = [&robot, &longer].map(|robot| Predictor::new(robot).unwrap().session_m(&sessions[0], None));
        let k = tolerances.0.iter().position(|number| number.sited.effect.id == "tool-length").unwrap();
        for ((before, after), moved) in before.iter().zip(&after).zip(&flaws[k]) {
            assert!((after - before - moved).norm() < 1e-9, "{moved}");
            assert!((moved.norm() - robot.tolerances.tool_length_m).abs() < 1e-9, "{moved}");
        }
    }
}
