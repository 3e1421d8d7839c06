//! Every number in which the robot may depart from the model, in units of its effect's own prior.

use raven::effects::{Channel, Effect, Parameter, Sited};
use raven::robot::Robot;

use super::spread::Spread;
use crate::evidence::recorded::rows::Observed;
use crate::evidence::recorded::settings::Setting;

/// One number of one effect at one place.
#[derive(Debug, Clone, Copy)]
pub struct Coordinate {
    /// Which of [`Coordinates::sited`].
    pub effect: usize,
    /// Which of its parameters.
    pub parameter: usize,
    /// Of what the motion before a recording left, which recording; nothing of what is the same in all.
    pub recording: Option<usize>,
    /// Deviation of the nominal value in `u`; `None` where the nominal model has no such thing.
    pub spike: Option<f64>,
}

impl Coordinate {
    /// Whether the nominal model knows it no better than an effect does: then it says nothing of whether there is one.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        self.spike.is_some_and(|spike| spike >= 1.0)
    }
}

/// All effects that these recordings can show, and their numbers.
pub struct Coordinates {
    /// Effects at their places.
    pub sited: Vec<Sited>,
    /// Effects that cannot show, with the reason.
    pub not_observable: Vec<(&'static Effect, &'static str)>,
    /// Numbers.
    pub all: Vec<Coordinate>,
    /// By what part of their tolerances those of the nominal model are off.
    pub spread: Spread,
}

impl Coordinates {
    /// Of a robot and what was recorded.
    #[must_use]
    pub fn new(robot: &Robot, rows: &dyn Observed) -> Self {
        let mut not_observable: Vec<(&'static Effect, &'static str)> = Vec::new();
        let mut sited = Vec::new();
        for each in Sited::all(robot) {
            let each = Sited { measure: rows.measure(&each), ..each };
            let channels = each.effect.channels;
            let shows = channels.iter().any(|channel| match channel {
                Channel::Torque => rows.torque_rows() > 0,
                Channel::Tip => rows.tip_rows() > 0,
            });
            let because = if let Some(because) = rows.cannot_show(&each) {
                Some(because)
            } else if !shows && channels == [Channel::Torque] {
                Some("the recording has no motor torque")
            } else if !shows {
                Some("the recording has no tip")
            } else {
                None
            };
            match because {
                None => sited.push(each),
                Some(because) if not_observable.iter().all(|(effect, _)| effect.id != each.effect.id) => {
                    not_observable.push((each.effect, because));
                }
                Some(_) => {}
            }
        }
        // What shows at one joint is no news at another.
        not_observable.retain(|(effect, _)| sited.iter().all(|each| each.effect.id != effect.id));
        let numbers = sited.iter().enumerate().flat_map(|(effect, s): (usize, &Sited)| {
            s.effect.parameters.iter().enumerate().map(move |(parameter, p)| Coordinate {
                effect,
                parameter,
                recording: p.scale.is_state().then_some(0),
                spike: p.tolerance_u(robot, s.place, s.measure).filter(|spike| *spike > 0.0),
            })
        });
        let mut all: Vec<Coordinate> = numbers.collect();
        // An effect's parameters come first, one after the other.
        let left: Vec<Coordinate> = all.iter().copied().filter(|coordinate| coordinate.recording.is_some()).collect();
        let later =
            (1..rows.recordings()).flat_map(|recording| left.iter().map(move |of| Coordinate { recording: Some(recording), ..*of }));
        all.extend(later);
        Self { sited, not_observable, all, spread: Spread::default() }
    }

    /// With the nominal model's numbers off by the part of their tolerances that other recordings of the rig show.
    #[must_use]
    pub fn with_spread(mut self, spread: &Spread) -> Self {
        self.spread = spread.clone();
        for coordinate in self.all.iter_mut().filter(|coordinate| !coordinate.is_unknown()) {
            let part = spread.part(self.sited[coordinate.effect].effect.id);
            coordinate.spike = coordinate.spike.map(|spike| part * spike);
        }
        self
    }

    /// Whether a number is one of the file's, which it knows and none of some effects is about.
    #[must_use]
    pub fn is_of_file(&self, c: usize, effects: &[usize]) -> bool {
        let coordinate = self.all[c];
        coordinate.spike.is_some() && !coordinate.is_unknown() && !effects.contains(&coordinate.effect)
    }

    /// The file's own tolerance of a number of the nominal model, in `u`.
    #[must_use]
    pub fn tolerance(&self, c: usize) -> Option<f64> {
        let coordinate = self.all[c];
        let part = if coordinate.is_unknown() { 1.0 } else { self.spread.part(self.sited[coordinate.effect].effect.id) };
        coordinate.spike.map(|spike| spike / part)
    }

    /// The coordinates of an effect: those of its parameters in their order, and then those of what the motion before each later recording left.
    pub fn of(&self, effect: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.all.len()).filter(move |&c| self.all[c].effect == effect)
    }

    /// Whether an effect can be told from the nominal model: not where the file's tolerances bear any size that is usual of it.
    #[must_use]
    pub fn can_be_named(&self, effect: usize) -> bool {
        self.of(effect).any(|c| !self.all[c].is_unknown())
    }

    /// An effect's own numbers at a point.
    #[must_use]
    pub fn own(&self, effect: usize, u: &[f64]) -> Vec<f64> {
        self.of(effect).map(|c| u[c]).collect()
    }

    /// The same as values, in the units of its parameters.
    #[must_use]
    pub fn values(&self, effect: usize, u: &[f64]) -> Vec<f64> {
        self.sited[effect].values(&self.own(effect, u))
    }

    /// The number that a coordinate stands for.
    #[must_use]
    pub fn parameter(&self, c: usize) -> &'static Parameter {
        let Coordinate { effect, parameter, .. } = self.all[c];
        &self.sited[effect].effect.parameters[parameter]
    }

    /// The coordinates of an effect's sizes, by which it is there or not.
    pub fn sizes(&self, effect: usize) -> impl Iterator<Item = usize> + '_ {
        self.of(effect).filter(|&c| self.parameter(c).scale.is_size() && !self.all[c].is_unknown())
    }

    /// The model's settings at a point; effects that do not change anything are left out. An effect that the file has changes how it
    /// begins, if by nothing else.
    #[must_use]
    pub fn settings(&self, u: &[f64]) -> Vec<Setting> {
        let mut own = vec![Vec::new(); self.sited.len()];
        let mut begins = vec![false; self.sited.len()];
        for (c, (coordinate, &u)) in self.all.iter().zip(u).enumerate() {
            own[coordinate.effect].push(u);
            begins[coordinate.effect] |= u != 0.0 && self.is_left(c);
        }
        let all = self.sited.iter().zip(own).zip(begins);
        all.filter(|((sited, own), begins)| *begins || acts(sited.effect, own)).map(|((sited, own), _)| (*sited, own)).collect()
    }

    /// The numbers of what the motion before left of effects that the model has and that remember: where friction held a link is forgotten as soon as
    /// that moves.
    pub fn left(&self) -> impl Iterator<Item = usize> + '_ {
        let remembers = |c: &usize| self.sited[self.all[*c].effect].effect.element.is_none();
        (0..self.all.len()).filter(|&c| self.is_left(c)).filter(remembers)
    }

    /// Whether a number is what the motion before left of an effect that the model has.
    fn is_left(&self, c: usize) -> bool {
        self.all[c].spike.is_some_and(|spike| spike > 0.0) && self.parameter(c).scale.is_state()
    }
}

/// Whether an effect is there at all: one whose size is zero is not, whatever its shape.
fn acts(effect: &Effect, u: &[f64]) -> bool {
    let alone = effect.parameters.len() == 1;
    effect.parameters.iter().zip(u).any(|(p, &u)| p.scale.is_size() && u != 0.0 || alone && p.scale.is_shape() && u != ABSENT)
}

/// `u` of a shape that stands for no effect, of effects that have nothing but a shape.
pub const ABSENT: f64 = f64::INFINITY;

/// The largest `u` of a shape that is there: of effects that have nothing else the mildest.
pub const MILDEST: f64 = 4.0;
