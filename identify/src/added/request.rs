//! `ID[:JOINT][=VALUE,...]`, as it is typed.

use raven::effects::{Effect, Sited};
use raven::robot::Robot;
use raven::{Error, Result};

use super::Sized;
use super::diagnosis::Diagnosis;

/// What is asked for.
#[derive(Debug, PartialEq)]
pub struct Request {
    id: String,
    joint: Option<String>,
    values: Option<Vec<f64>>,
}

impl Request {
    /// From what was typed.
    ///
    /// # Errors
    /// If there is no such effect, or a value is no number.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, values) = text.split_once('=').map_or((text, None), |(name, values)| (name, Some(values)));
        let (id, joint) = name.split_once(':').map_or((name, None), |(id, joint)| (id, Some(joint.to_owned())));
        let id = Effect::named(id).map_err(|error| Error::Argument(format!("--add-effect: {error}")))?.id;
        let number = |value: &str| {
            let parsed = value.trim().parse::<f64>().ok().filter(|v| v.is_finite());
            parsed.ok_or_else(|| Error::Argument(format!("--add-effect {text}: `{value}` is no number.")))
        };
        let values = values.map(|values| values.split(',').map(number).collect::<Result<Vec<f64>>>()).transpose()?;
        Ok(Self { id: id.to_owned(), joint, values })
    }

    /// With values and place: those typed, or else those of the diagnosis.
    ///
    /// # Errors
    /// If they are in neither, too few or too many, or the robot has no such place.
    pub fn sized(&self, robot: &Robot, diagnosis: Option<&Diagnosis>) -> Result<Sized> {
        let Some(typed) = &self.values else {
            let diagnosis = diagnosis.ok_or_else(|| {
                let id = &self.id;
                Error::Argument(format!("--add-effect {id}: no values; write them after `=`, or give the report with --diagnosis."))
            })?;
            let blamed = diagnosis.find(&self.id, self.joint.as_deref())?;
            let sited = Sited::at(robot, &self.id, blamed.joint.as_deref())?;
            let (values, stds) = diagnosis.values(blamed, &sited)?;
            let doubt = diagnosis.doubt(blamed);
            return Ok(Sized { sited, values, stds, doubt, logs: diagnosis.logs(), sha256: diagnosis.sha256_of_logs() });
        };
        let sited = Sited::at(robot, &self.id, self.joint.as_deref()).map_err(|e| Error::Argument(format!("--add-effect: {e}")))?;
        let parameters = sited.effect.parameters;
        let mut values = typed.clone();
        // Shapes and second factors may be left off.
        values.extend(parameters.iter().skip(typed.len().max(1)).map_while(|p| p.usual(sited.measure)));
        if values.len() != parameters.len() {
            let measure = sited.measure;
            let names: Vec<String> = parameters.iter().map(|p| format!("{} [{}]", p.name, p.unit_at(measure))).collect();
            return Err(Error::Argument(format!("--add-effect {}: it takes {}; {} given.", self.id, names.join(","), typed.len())));
        }
        Ok(Sized { sited, stds: vec![0.0; values.len()], values, doubt: None, logs: Vec::new(), sha256: Vec::new() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raven::robot::nominal;

    fn sized(text: &str) -> Result<Sized> {
        Request::parse(text)?.sized(&nominal::gold(), None)
    }

    #[test]
    fn values_as_typed_and_shapes_as_usual() {
        let radius = sized("pulley-radius:shoulder=-0.05").unwrap();
        assert_eq!((radius.sited.effect.id, radius.sited.place.first, &radius.values[..]), ("pulley-radius", 0, &[-0.05][..]));
        let coupling = sized("cable-coupling:shoulder->elbow=0.02").unwrap();
        assert_eq!(coupling.sited.joint(&nominal::gold()).as_deref(), Some("shoulder->elbow"));
        assert_eq!(sized("creep:elbow=2").unwrap().values, [2.0, 30.0, 0.0]);
        assert_eq!(sized("link-coulomb-friction:elbow=3").unwrap().values, [3.0, 1.0, 0.0, 0.0]);
    }

    #[test]
    fn what_makes_no_sense_is_a_sentence() {
        for (text, about) in [
            ("pulley-radius:shoulder", "no values"),
            ("pulley-radius=0.1", "shoulder, elbow, insertion"),
            ("pulley-radius:wrist=0.1", "`wrist`"),
            ("payload:elbow=0.1", "the whole"),
            ("pulley-radius:elbow=big", "`big` is no number"),
            ("pulley-radius:elbow=0.1,0.2", "2 given"),
            ("camera-rotation=0.1", "x [rad],y [rad],z [rad]; 1 given"),
            ("pulley=0.1", "`pulley` is no effect"),
        ] {
            let error = sized(text).err().unwrap().to_string();
            assert!(error.contains(about), "{text}: {error}");
        }
    }
}
