//! Effects that the nominal model leaves out: named, physical extensions of it, to be held against recordings.
//!
//! An effect is one file of [`library`]: its identifier, stage, parameters with what is believed of them beforehand, the channels it shows
//! in and what it cannot show without, which element between motor and joint it changes, its ties, and how it changes the [`Model`]. Nobody asks
//! for an effect by name: a new one touches its file and the registry. The equations are those of the fitted model; the virtual lab has its own.

mod added;
mod bench;
mod command;
mod document;
pub mod library;
mod listed;
mod measure;
mod model;
mod parameter;
mod tension;
mod tip;
mod torque;
mod view;

pub use bench::{BenchModel, Driven, LinkMotion, Tension, held};
pub use command::Command;
pub use document::document;
pub use library::{ALL, AMOUNTS};
pub use listed::{Home, clock_drift, within_images};
pub(crate) use listed::{check_listed, motor_laws};
pub use measure::Measure;
pub use model::{Drive, Model};
pub use parameter::{Above, Parameter, Scale, Size};
pub use tip::{Sight, TipModel, WhereKnown};
pub use torque::{Shaft, TorqueModel};
pub use view::View;

use std::collections::BTreeSet;

use crate::robot::{JointType, KinematicsKind, Robot};
use crate::{Error, Result};

/// An effect at its place as commands take it: `pulley-radius:shoulder`, `time-offset`.
#[must_use]
pub fn at_place(id: &str, joint: Option<&str>) -> String {
    joint.map_or_else(|| id.to_owned(), |joint| format!("{id}:{joint}"))
}

/// What an effect belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// A joint.
    Joint,
    /// Two joints, of which the first moves the cable of the second.
    Pair,
    /// One of the two link angles.
    LinkAngle,
    /// The whole robot.
    Robot,
    /// The camera rig.
    Rig,
}

/// Where on the way from torque to image an effect sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Motor encoder.
    Encoder,
    /// Torque to motor motion.
    Motor,
    /// Motor to joint.
    Transmission,
    /// Loads on the links.
    Link,
    /// Joint to tip.
    Kinematics,
    /// Tip to image.
    Camera,
    /// Clocks.
    Timing,
}

impl Stage {
    /// Whether effects there are geometry or time, which are right once their numbers are. Laws of motors, cables and loads are approximate.
    #[must_use]
    pub const fn has_exact_laws(self) -> bool {
        matches!(self, Self::Encoder | Self::Kinematics | Self::Camera | Self::Timing)
    }
}

/// What a recording can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Motor torque.
    Torque,
    /// Tip, or joint encoders on a bench.
    Tip,
}

/// What a file or a recording must have for an effect to show, beside one of its channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// A motor in the file: without one, torque measured at the shaft is what the cable gets.
    Motor,
    /// A motor that turns: one that slides has no turn to count waves in.
    Turns,
    /// A cable in the file that is to be another one.
    Cable,
    /// The load on the cable: an arm's is its links', a bench's is told by torque.
    Load,
    /// What tells where the joint is behind its cable: an arm's tip, a bench's joint encoders.
    JointSide,
    /// What the joint moves.
    Link,
    /// The lenses through which tips were seen.
    Lenses,
}

/// An element between a motor and its joint, as lumped models have them: with it the joint follows its cable in another way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Element {
    /// By which the joint lags under a load.
    Spring,
    /// By which it follows late, and stops swinging.
    Dashpot,
    /// By which it stays until it is pulled free.
    Slider,
    /// In which it floats.
    Gap,
}

/// From an effect's values at a place of a robot, those of the tied effect that changes a recording about equally.
pub type Alike = fn(&Robot, Place, &[f64]) -> Vec<f64>;

/// Another effect that looks alike. One that is exactly tied may be no effect of the library.
#[derive(Debug, Clone, Copy)]
pub struct Tie {
    /// Its identifier.
    pub id: &'static str,
    /// What to measure instead where no recording of motors and tip tells them apart, which is so if their numbers are of one unit.
    pub exact: Option<&'static str>,
    /// Its values that change a recording about as those of this effect do; `None` where they are not known.
    pub values: Option<Alike>,
}

impl Tie {
    const fn near(id: &'static str) -> Self {
        Self { id, exact: None, values: None }
    }

    const fn exact(id: &'static str, told_by: &'static str) -> Self {
        Self { exact: Some(told_by), ..Self::near(id) }
    }

    const fn with(self, values: Alike) -> Self {
        Self { values: Some(values), ..self }
    }
}

/// One kind of effect.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    /// Identifier.
    pub id: &'static str,
    /// What it belongs to.
    pub scope: Scope,
    /// Where it sits.
    pub stage: Stage,
    /// Its model in a sentence.
    pub summary: &'static str,
    /// Its numbers.
    pub parameters: &'static [Parameter],
    /// Where it shows.
    pub channels: &'static [Channel],
    /// What it cannot show without.
    pub needs: &'static [Need],
    /// What it changes between motor and joint, if it is one element of what moves the joint.
    pub element: Option<Element>,
    /// What looks alike.
    pub ties: &'static [Tie],
    /// The motion that tells it from its ties.
    pub separated_by: &'static str,
    /// Builds it into the model, with values in the units of its parameters.
    pub act: fn(&mut Model, Place, &[f64]),
}

/// The place of an effect: a joint, a pair, a link angle (0: 12, 1: 23), or the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Place {
    /// The joint, the moving joint of a pair, or the link angle.
    pub first: usize,
    /// The moved joint of a pair.
    pub second: usize,
}

/// What stands for an effect where the nominal model has nothing that a factor could multiply.
#[derive(Debug, Clone, Copy)]
pub struct Amount {
    /// The number that the factor would be on; 0 where it is not given.
    pub nominal: fn(&Robot, Place) -> f64,
    /// The effect with an amount for its number.
    pub effect: Effect,
}

/// An effect at a place.
#[derive(Debug, Clone, Copy)]
pub struct Sited {
    /// Kind.
    pub effect: &'static Effect,
    /// Place.
    pub place: Place,
    /// What its sizes are measured in.
    pub measure: Measure,
}

impl Effect {
    /// The effect with an identifier.
    ///
    /// # Errors
    /// With the identifiers there are.
    pub fn named(id: &str) -> Result<&'static Self> {
        ALL.iter().copied().find(|effect| effect.id == id).ok_or_else(|| {
            let known: Vec<&str> = ALL.iter().map(|effect| effect.id).collect();
            Error::Argument(format!("`{id}` is no effect; there are {}.", known.join(", ")))
        })
    }

    /// Identifiers of what the library does not hold as it is the same as this one, each with what tells them apart.
    pub fn other_names(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        self.ties.iter().filter(|tie| Self::named(tie.id).is_err()).filter_map(|tie| Some((tie.id, tie.exact?)))
    }

    /// Every place of the robot that it can be at.
    #[must_use]
    pub fn places(&self, robot: &Robot) -> Vec<Place> {
        let joints = 0..robot.joints.len().min(3);
        match self.scope {
            Scope::Joint => joints.map(|first| Place { first, second: 0 }).collect(),
            Scope::Pair => {
                let named = robot.cable_coupling.iter();
                let named = named.filter_map(|c| Some((robot.joint_index(&c.from).ok()?, robot.joint_index(&c.to).ok()?)));
                // The cables of an arm run over the joints before theirs, whether the file has a number for it or not.
                let arm = matches!(robot.kinematics, KinematicsKind::Raven(_)) && robot.joints.len() >= 3;
                let passing: &[(usize, usize)] = if arm { &[(0, 1), (0, 2), (1, 2)] } else { &[] };
                let pairs: BTreeSet<(usize, usize)> = named.chain(passing.iter().copied()).collect();
                pairs.into_iter().map(|(first, second)| Place { first, second }).collect()
            }
            Scope::LinkAngle => (0..2).map(|first| Place { first, second: 0 }).collect(),
            Scope::Robot | Scope::Rig => vec![Place::default()],
        }
    }
}

impl Sited {
    /// Every effect of the library at every place of a robot, in sizes of a Raven. One on a number that the nominal model lacks or has as
    /// zero is an [`Amount`].
    #[must_use]
    pub fn all(robot: &Robot) -> Vec<Self> {
        ALL.iter().flat_map(|effect| effect.places(robot).into_iter().map(move |place| Self::new(effect, place, robot))).collect()
    }

    fn new(effect: &'static Effect, place: Place, robot: &Robot) -> Self {
        let amount = AMOUNTS.iter().find(|amount| amount.effect.id == effect.id && (amount.nominal)(robot, place) == 0.0);
        let sited = Self { effect: amount.map_or(effect, |amount| &amount.effect), place, measure: Measure::raven(JointType::Revolute) };
        Self { measure: Measure::of_arm(robot, sited.joint_measured(), sited.joint_type(robot)), ..sited }
    }

    /// What tells it from another one, if no recording of motors and tip can: the library ties them exactly, and their numbers are of one unit. A tool's
    /// length is the offset of a joint that slides, and of no other.
    #[must_use]
    pub fn exact_tie(&self, other: &Self) -> Option<&'static str> {
        let tied = |one: &Self, another: &Self| one.effect.ties.iter().find(|tie| tie.id == another.effect.id).and_then(|tie| tie.exact);
        let unit = |sited: &Self| sited.effect.parameters[0].unit_at(sited.measure);
        tied(self, other).or_else(|| tied(other, self)).filter(|_| unit(self) == unit(other))
    }

    /// Whether that is so.
    #[must_use]
    pub fn is_exactly(&self, other: &Self) -> bool {
        self.exact_tie(other).is_some()
    }

    /// Values of its numbers at `u` of each (see [`Parameter`]), in the units of its parameters.
    #[must_use]
    pub fn values(&self, u: &[f64]) -> Vec<f64> {
        self.effect.parameters.iter().zip(u).map(|(parameter, &u)| parameter.value(u, self.measure)).collect()
    }

    /// The joint whose sizes it has; the first for the whole.
    #[must_use]
    pub fn joint_measured(&self) -> usize {
        match self.effect.scope {
            Scope::Pair => self.place.second,
            Scope::Joint => self.place.first,
            Scope::LinkAngle | Scope::Robot | Scope::Rig => 0,
        }
    }

    /// Whether both show in one joint, or either in the whole robot or its cameras: only such effects can stand in for one another.
    #[must_use]
    pub fn shows_where(&self, other: &Self) -> bool {
        let joint = |sited: &Self| matches!(sited.effect.scope, Scope::Joint | Scope::Pair).then(|| sited.joint_measured());
        match (joint(self), joint(other)) {
            (Some(one), Some(other)) => one == other,
            _ => true,
        }
    }

    /// `joint` of a report: a joint's name, `from->to`, `12` or `23`, nothing for the whole.
    #[must_use]
    pub fn joint(&self, robot: &Robot) -> Option<String> {
        let name = |j: usize| robot.joints.get(j).map(|joint| joint.name.clone());
        match self.effect.scope {
            Scope::Joint => name(self.place.first),
            Scope::Pair => Some(format!("{}->{}", name(self.place.first)?, name(self.place.second)?)),
            Scope::LinkAngle => Some(["12", "23"][self.place.first.min(1)].to_owned()),
            Scope::Robot | Scope::Rig => None,
        }
    }

    /// Kind of the joint whose units the parameters have; revolute for the whole.
    #[must_use]
    pub fn joint_type(&self, robot: &Robot) -> JointType {
        let joint = match self.effect.scope {
            Scope::Pair => self.place.second,
            Scope::Joint => self.place.first,
            _ => return JointType::Revolute,
        };
        robot.joints.get(joint).map_or(JointType::Revolute, |joint| joint.kind)
    }
}

#[cfg(test)]
mod added_tests;
#[cfg(test)]
mod tests;
