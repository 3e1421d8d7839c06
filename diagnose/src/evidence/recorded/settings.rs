//! Effects in the model, as each of several recordings begins.

use std::borrow::Cow;

use raven::effects::Sited;

/// An effect in the model, at `u` of its parameters; and then, for each recording after the first, of those of them that are what the motion before
/// it left ([`raven::effects::Scale::State`]).
pub type Setting = (Sited, Vec<f64>);

/// Settings as one of the recordings begins.
pub(super) fn of_recording(settings: &[Setting], recording: usize) -> Cow<'_, [Setting]> {
    let is_shared = |(sited, u): &Setting| u.len() <= sited.effect.parameters.len();
    let Some(later) = recording.checked_sub(1).filter(|_| !settings.iter().all(is_shared)) else { return Cow::Borrowed(settings) };
    settings.iter().map(|setting| begun(setting, later)).collect()
}

/// A setting as a recording after the first begins.
fn begun((sited, u): &Setting, later: usize) -> Setting {
    let parameters = sited.effect.parameters;
    let (own, of_later) = u.split_at(parameters.len().min(u.len()));
    let states = parameters.iter().filter(|parameter| parameter.scale.is_state()).count();
    let mut left = of_later.iter().skip(later * states);
    let values = parameters.iter().zip(own).map(|(parameter, &own)| match parameter.scale.is_state() {
        true => left.next().copied().unwrap_or(own),
        false => own,
    });
    (*sited, values.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_differ_by_what_the_motion_before_each_left() {
        let all = Sited::all(&raven::robot::nominal::gold());
        let of = |id: &str| *all.iter().find(|sited| sited.effect.id == id).unwrap();
        let (creep, offset) = (of("creep"), of("joint-offset"));
        let is_state: Vec<bool> = creep.effect.parameters.iter().map(|parameter| parameter.scale.is_state()).collect();
        assert_eq!(is_state, [false, false, true]);
        let settings = [(creep, vec![0.5, 0.2, 1.0, -0.3, 0.7]), (offset, vec![0.4])];
        for (recording, left) in [(0, 1.0), (1, -0.3), (2, 0.7)] {
            let begun = of_recording(&settings, recording);
            let values: Vec<Vec<f64>> = begun.iter().map(|(sited, u)| sited.values(u)).collect();
            assert_eq!(values, [creep.values(&[0.5, 0.2, left]), offset.values(&[0.4])]);
        }
        // What says nothing of other recordings is the same in all.
        assert_eq!(of_recording(&settings[1..], 2)[0].1, [0.4]);
    }
}
