//! The list `effects` of a robot file: which effects belong there, whether an entry makes sense, and what the model makes of it.

use std::sync::LazyLock;

use super::{Effect, Measure, Model, Parameter, Place, Scope, Sited};
use crate::robot::{JointType, KinematicsKind, ListedEffect, MotorLaws, Robot, nominal};
use crate::{Error, Result};

/// Where an effect stands once it is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Home {
    /// Numbers of the robot file.
    Numbers,
    /// Numbers of the camera file.
    Cameras,
    /// The robot file's list of effects.
    List,
}

impl Effect {
    /// Where it stands once it is known: what it changes of the nominal model tells.
    #[must_use]
    pub fn home(&self) -> Home {
        static GOLD: LazyLock<Robot> = LazyLock::new(nominal::gold);
        let robot = &*GOLD;
        let Some(&place) = self.places(robot).first() else { return Home::List };
        // A change of one typical size: no number of the nominal robot is zero that an effect multiplies.
        let values: Vec<f64> = self.parameters.iter().map(|p| p.value(1.0, Measure::raven(JointType::Revolute))).collect();
        let (plain, mut changed) = (Model::bare(robot), Model::bare(robot));
        (self.act)(&mut changed, place, &values);
        let (before, after) = (&plain.view, &changed.view);
        let registration = before.rotation != after.rotation || before.translation_m != after.translation_m;
        if plain.robot != changed.robot || registration || before.latency_s != after.latency_s {
            Home::Numbers
        } else if before.baseline != after.baseline || before.k1 != after.k1 {
            Home::Cameras
        } else {
            Home::List
        }
    }
}

impl Sited {
    /// The effect `id` at a joint, `from->to`, `12` or `23`; at nothing where it belongs to the whole.
    ///
    /// # Errors
    /// If there is no such effect, or not there; the message says where it can be.
    pub fn at(robot: &Robot, id: &str, joint: Option<&str>) -> Result<Self> {
        let effect = Effect::named(id)?;
        let all: Vec<Self> = effect.places(robot).into_iter().map(|place| Self::new(effect, place, robot)).collect();
        all.iter().copied().find(|sited| sited.joint(robot).as_deref() == joint).ok_or_else(|| {
            let places: Vec<String> = all.iter().filter_map(|sited| sited.joint(robot)).collect();
            let given = joint.map_or_else(|| "nothing".to_owned(), |joint| format!("`{joint}`"));
            let expected = match effect.scope {
                Scope::Robot | Scope::Rig => "the whole and to no joint".to_owned(),
                _ => places.join(", "),
            };
            Error::Argument(format!("{id} belongs to {expected}; {given} is given."))
        })
    }

    /// Refuses values beyond what such hardware can have.
    ///
    /// # Errors
    /// With parameter, value and range.
    pub fn check_values(&self, values: &[f64]) -> Result<()> {
        let measure = self.measure;
        for (parameter, &value) in self.effect.parameters.iter().zip(values) {
            let [low, high] = parameter.range(measure);
            if !(low..=high).contains(&value) {
                let (id, name) = (self.effect.id, parameter.name);
                let expected = crate::robot::with_unit(&format!("{low:.3e} to {high:.3e}"), parameter.unit_at(measure));
                return Err(Error::Argument(format!("{id}: `{name}` is {value}, expected {expected}. Is it in SI units?")));
            }
        }
        Ok(())
    }

    /// Whether a robot file lists this effect.
    #[must_use]
    pub fn is_listed(&self, robot: &Robot) -> bool {
        robot.effects.iter().any(|listed| self.is_listed_as(robot, listed))
    }

    /// Whether an entry of the list is this effect.
    fn is_listed_as(&self, robot: &Robot, listed: &ListedEffect) -> bool {
        listed.id == self.effect.id && listed.joint == self.joint(robot)
    }

    /// Where the list of `robot` has this effect, adds what the motion before a recording left of it, as far as there can be such: those of `values`
    /// that are [`Scale::State`](super::Scale::State).
    pub(super) fn begin_listed(&self, robot: &mut Robot, values: &[f64]) {
        let Some(i) = robot.effects.iter().position(|listed| self.is_listed_as(robot, listed)) else { return };
        let states = self.effect.parameters.iter().zip(values).filter(|(parameter, _)| parameter.scale.is_state());
        for (state, value) in states {
            let [least, most] = state.range(self.measure);
            let begins = robot.effects[i].values.entry(state.name.to_owned()).or_default();
            *begins = (*begins + value).clamp(least, most);
        }
    }

    /// The entry of the list with these values.
    #[must_use]
    pub fn listed(&self, robot: &Robot, values: &[f64]) -> ListedEffect {
        let named = self.effect.parameters.iter().zip(values).map(|(parameter, &value)| (parameter.name.to_owned(), value));
        ListedEffect { id: self.effect.id.to_owned(), joint: self.joint(robot), values: named.collect() }
    }

    /// The effect of an entry and its values, in the order of its parameters.
    ///
    /// # Errors
    /// If the entry makes no sense for this robot.
    pub fn from_listed(robot: &Robot, listed: &ListedEffect) -> Result<(Self, Vec<f64>)> {
        let sited = Self::at(robot, &listed.id, listed.joint.as_deref())?;
        let id = sited.effect.id;
        let parameters = sited.effect.parameters;
        let names: Vec<&str> = parameters.iter().map(|parameter| parameter.name).collect();
        match sited.effect.home() {
            Home::List => {}
            Home::Numbers => {
                let message = format!("{id} is a number of this file and belongs there: raven-identify --add-effect writes it.");
                return Err(Error::Argument(message));
            }
            Home::Cameras => return Err(Error::Argument(format!("{id} belongs to the camera file: calibrate the cameras anew."))),
        }
        if let Some(name) = listed.values.keys().find(|name| !names.contains(&name.as_str())) {
            return Err(Error::Argument(format!("{id} has no value `{name}`; it has {}.", names.join(", "))));
        }
        let value = |(k, parameter): (usize, &Parameter)| {
            // What the motion before one recording left is no number of the robot, and a second shape hardly one.
            let is_second_shape = parameter.scale.is_shape() && parameters[..k].iter().any(|before| before.scale.is_shape());
            let may_lack = parameter.scale.is_state() || is_second_shape;
            let otherwise = parameter.usual(sited.measure).filter(|_| may_lack);
            let missing = || Error::Argument(format!("{id} lacks the value `{}`; it has {}.", parameter.name, names.join(", ")));
            listed.values.get(parameter.name).copied().or(otherwise).ok_or_else(missing)
        };
        let values = parameters.iter().enumerate().map(value).collect::<Result<Vec<f64>>>()?;
        sited.check_values(&values)?;
        Ok((sited, values))
    }
}

/// Refuses a list that makes no sense; the sentence names the entry.
///
/// # Errors
/// If an effect is unknown, at no joint of this robot, without its values, beyond their ranges, or there twice.
pub(crate) fn check_listed(robot: &Robot) -> Result<(), String> {
    if !robot.effects.is_empty() && !matches!(robot.kinematics, KinematicsKind::Raven(_)) {
        return Err("effects is a list for arms, and this is a bench; take it out.".to_owned());
    }
    for (i, listed) in robot.effects.iter().enumerate() {
        Sited::from_listed(robot, listed).map_err(|error| format!("effects[{i}]: {error}"))?;
        if robot.effects[..i].iter().any(|before| before.id == listed.id && before.joint == listed.joint) {
            return Err(format!("effects[{i}]: {} stands there twice; keep one.", listed.id));
        }
    }
    Ok(())
}

/// The deviation of what the motion before a recording left of an effect, where a robot file lists that at a joint: every recording begins anew.
pub(super) fn left(robot: &Robot, id: &str, place: Place, deviation: f64) -> f64 {
    let is_listed = Effect::named(id).is_ok_and(|effect| Sited::new(effect, place, robot).is_listed(robot));
    if is_listed { deviation } else { 0.0 }
}

/// What the listed effects of a robot make of recorded motors.
///
/// # Errors
/// If the list makes no sense.
pub(crate) fn motor_laws(robot: &Robot) -> Result<MotorLaws> {
    if robot.effects.is_empty() {
        return Ok(MotorLaws::default());
    }
    Ok(MotorLaws::from(Model::bare(robot).with_listed(robot)?.motors))
}

/// By how much per second the cameras' clock drifts from the robot's: an image stamped `t` shows the robot at `t - latency - drift t`.
///
/// # Errors
/// If the list makes no sense.
pub fn clock_drift(robot: &Robot) -> Result<f64> {
    Ok(Model::bare(robot).with_listed(robot)?.view.drift)
}

/// Listed effects that move what the two images show apart. Whoever takes the tip for one point at one time has to leave them out.
#[must_use]
pub fn within_images(robot: &Robot) -> Vec<&ListedEffect> {
    let apart = |listed: &&ListedEffect| {
        let Ok((sited, values)) = Sited::from_listed(robot, listed) else { return false };
        let mut model = Model::bare(robot);
        (sited.effect.act)(&mut model, sited.place, &values);
        model.view.right_minus_left_s != 0.0 || model.view.readout_s != 0.0
    };
    robot.effects.iter().filter(apart).collect()
}
