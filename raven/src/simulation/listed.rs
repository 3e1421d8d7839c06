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
            // Slip sets in at once.
            (EffectKind::CableSlip, &[force, fraction, ..]) => vec![force, fraction],
            // What the motion before a recording left follows from the session.
            _ => sited.effect.parameters.iter().zip(values).filter(|(p, _)| !p.scale.is_state()).map(|(_, value)| value).collect(),
        };
        let effect = Effect::new(kind, listed.joint.as_deref(), &values);
        effect.map_err(|error| Error::Data(format!("robot `{}`: effects[{i}] cannot be simulated: {error}", robot.name)))
    };
    robot.effects.iter().enumerate().map(translated).collect()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::effects::{ALL, Home};
    use crate::robot::nominal;
    use crate::simulation::{Options, Session};

    /// A robot that lists an effect is, in the lab, the robot of before that hides it.
    #[test]
    fn what_is_listed_is_what_would_be_hidden() {
        let robot = nominal::gold();
        for effect in ALL.iter().filter(|effect| effect.home() == Home::List) {
            let place = effect.places(&robot)[0];
            let sited = Sited::all(&robot).into_iter().find(|sited| sited.effect.id == effect.id && sited.place == place).unwrap();
            // Without a cosine an eccentricity has no phase.
            let values: Vec<f64> =
                effect.parameters.iter().map(|p| if p.name == "cosine" { 0.0 } else { p.value(0.3, sited.measure) }).collect();
            let listing = sited.added_to(&robot, None, &values).unwrap();
            let kind = EffectKind::all().find(|kind| kind.id() == effect.id).unwrap();
            let own = if matches!(kind, EffectKind::Creep | EffectKind::CableSlip) { &values[..2] } else { &values };
            let hidden = Effect::new(kind, sited.joint(&robot).as_deref(), own);
            let truth = |robot: &Robot, effects: Vec<Effect>| {
                let session = Session::new(robot, Options { effects, ..Options::default() }).unwrap();
                (format!("{:?} {:?}", session.truth().machine, session.truth().delays), session.truth().effects.len())
            };
            let (by_list, by_hiding) = (truth(&listing, Vec::new()), truth(&robot, vec![hidden.unwrap()]));
            assert_eq!(by_list.0, by_hiding.0, "{}", effect.id);
            assert_eq!([by_list.1, by_hiding.1], [0, 1], "{}: what is listed is not hidden", effect.id);
            assert_ne!(by_list.0, truth(&robot, Vec::new()).0, "{}", effect.id);
        }
    }

    #[test]
    fn an_eccentricity_has_a_phase() {
        let robot = nominal::gold();
        let sited = Sited::at(&robot, "pulley-eccentricity", Some("elbow")).unwrap();
        let (size_m, phase): (f64, f64) = (4e-4, 2.3);
        let robot = sited.added_to(&robot, None, &[size_m * phase.cos(), size_m * phase.sin()]).unwrap();
        let effects = listed(&robot).unwrap();
        assert_relative_eq!(effects[0].values[0], size_m, epsilon = 1e-12);
        assert_relative_eq!(effects[0].values[1], phase, epsilon = 1e-12);
    }
}
