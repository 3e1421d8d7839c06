//! The effects that a robot file lists, as the virtual lab has them: what is known of the robot is in its simulation too.

use super::effect::{Effect, EffectKind};
use crate::effects::Sited;
use crate::robot::Robot;
use crate::{Error, Result};

/// The list of a robot file; nothing of it is hidden.
///
/// # Errors
/// If a value is beyond what the lab can simulate.
pub fn listed(robot: &Robot) -> Result<Vec<Effect>> {
    let translated = |(i, listed)| {
        let (sited, values) = Sited::from_listed(robot, listed)?;
        let id = sited.effect.id;
        let no_such = || Error::Data(format!("robot `{}`: effects[{i}]: the simulator has no {id}.", robot.name));
        let kind = EffectKind::all().find(|kind| kind.id() == id).ok_or_else(no_such)?;
        let values = match (kind, values.as_slice()) {
            // `a sin(q) + b cos(q) = e sin(q + p)`.
            (EffectKind::PulleyEccentricity, &[sine, cosine]) => vec![f64::hypot(sine, cosine), f64::atan2(cosine, sine)],
            _ => values,
        };
        let effect = Effect::new(kind, listed.joint.as_deref(), &values);
        effect.map_err(|error| Error::Data(format!("robot `{}`: effects[{i}] cannot be simulated: {error}", robot.name)))
    };
    robot.effects.iter().enumerate().map(translated).collect()
}
