//! Effects by name, up to the ties that no recording can break: capstan and pulley, tool length and a prismatic joint's hard stop.

use raven::effects::{ALL, Effect, Sited};
use raven::robot::Robot;
use raven::simulation::{Label, LabelEffect};

use super::verdict::{Blamed, Verdict};

/// An effect at its place; of exactly tied ones always the same.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cause {
    /// Identifier.
    pub id: String,
    /// Place.
    pub joint: Option<String>,
}

/// Makes causes of names, for one robot.
#[derive(Debug, Clone)]
pub struct Names {
    /// What the library can name at its places.
    sited: Vec<(Sited, Cause)>,
}

impl Names {
    /// Names on a robot.
    #[must_use]
    pub fn of(robot: &Robot) -> Self {
        let cause = |sited: &Sited| Cause { id: sited.effect.id.to_owned(), joint: sited.joint(robot) };
        Self { sited: Sited::all(robot).into_iter().map(|sited| (sited, cause(&sited))).collect() }
    }

    /// The cause that a name stands for: of those that are exactly tied the first in the library.
    #[must_use]
    pub fn cause(&self, id: &str, joint: Option<&str>) -> Cause {
        let id = tied_to(id).unwrap_or(id);
        let cause = Cause { id: id.to_owned(), joint: joint.map(str::to_owned) };
        let Some((named, _)) = self.sited.iter().find(|(_, known)| *known == cause) else { return cause };
        let first = self.sited.iter().find(|(sited, known)| *known == cause || sited.is_exactly(named));
        first.map_or(cause, |(_, first)| first.clone())
    }

    /// Of a label's effect.
    #[must_use]
    pub fn labelled(&self, effect: &LabelEffect) -> Cause {
        self.cause(&effect.id, effect.joint.as_deref())
    }

    /// Of a blamed effect.
    #[must_use]
    pub fn blamed(&self, effect: &Blamed) -> Cause {
        self.cause(&effect.id, effect.joint.as_deref())
    }

    /// A verdict's answers, best first: what it blames, or that nothing is to blame, then its other candidates. `None` is nothing.
    #[must_use]
    pub fn answers(&self, verdict: &Verdict) -> Vec<Option<Cause>> {
        let mut answers: Vec<Option<Cause>> = verdict.effects.iter().map(|effect| Some(self.blamed(effect))).collect();
        if answers.is_empty() {
            answers.push(None);
        }
        for candidate in &verdict.candidates {
            let answer = (candidate.id != "none").then(|| self.cause(&candidate.id, candidate.joint.as_deref()));
            if !answers.contains(&answer) {
                answers.push(answer);
            }
        }
        answers
    }
}

/// Whether a recording hides something that the library does not hold.
#[must_use]
pub fn is_outside(label: &Label) -> bool {
    label.effects.iter().any(|effect| Effect::named(&effect.id).is_err() && tied_to(&effect.id).is_none())
}

/// The effect of the library that is exactly tied to one which it does not hold.
fn tied_to(id: &str) -> Option<&'static str> {
    ALL.iter().find(|effect| effect.other_names().any(|(other, _)| other == id)).map(|effect| effect.id)
}

#[cfg(test)]
mod tests {
    use raven::robot::nominal;

    use super::super::verdict::Candidate;
    use super::*;
    use crate::attribution::Word;

    #[test]
    fn exact_ties_are_one_cause() {
        let names = Names::of(&nominal::gold());
        assert_eq!(names.cause("tool-length", None), names.cause("joint-offset", Some("insertion")));
        assert_eq!(names.cause("capstan-radius", Some("elbow")), names.cause("pulley-radius", Some("elbow")));
        assert_ne!(names.cause("tool-length", None), names.cause("joint-offset", Some("elbow")));
        assert_ne!(names.cause("pulley-radius", Some("shoulder")), names.cause("pulley-radius", Some("elbow")));
    }

    #[test]
    fn nothing_is_an_answer_and_comes_first_where_nothing_is_blamed() {
        let names = Names::of(&nominal::gold());
        let candidate = |id: &str| Candidate { id: id.to_owned(), joint: None, probability: 0.1 };
        let candidates = vec![candidate("payload"), candidate("none"), candidate("tool-length")];
        let mut verdict = Verdict { verdict: Word::None, effects: Vec::new(), candidates, gap: Vec::new() };
        let payload = Some(names.cause("payload", None));
        let tool = Some(names.cause("tool-length", None));
        assert_eq!(names.answers(&verdict), [None, payload.clone(), tool.clone()]);
        verdict.effects.push(Blamed {
            id: "joint-offset".to_owned(),
            joint: Some("insertion".to_owned()),
            probability: 0.9,
            parameters: Vec::new(),
        });
        assert_eq!(names.answers(&verdict), [tool, payload, None]);
    }
}
