//! The page with what the recordings say of causes.

use std::borrow::Cow;
use std::path::Path;

use raven::effects::{Effect, Home, Sited, at_place};
use raven::robot::Robot;

use super::{Candidate, Detectable, GapBar, Page, remaining};
use crate::attribution::{Attribution, Blamed, FileNumber, Remaining, Side, Word, at, off, sentence, size, tied, together};

/// Files of a diagnosis, as they were typed.
#[derive(Debug, Clone, Copy)]
pub struct Files<'a> {
    /// The robot file.
    pub robot: &'a Path,
    /// The camera file.
    pub cameras: Option<&'a Path>,
    /// Where the report went as JSON; `None` where it went into no file.
    pub json: Option<&'a Path>,
}

/// A torque is drawn where the effects close at least this part of its gap: it is there in any case, and mostly tells nothing.
const TORQUE_CLOSED: f64 = 0.05;

/// Adds verdict, candidates, closure, ties and sizes to the page of a robot's gap.
pub fn add_causes(page: &mut Page, attribution: &Attribution, robot: &Robot, files: Files) {
    page.verdict = attribution.verdict.name().to_owned();
    page.verdict_sentence = sentence(attribution);
    page.remarks.extend(attribution.remarks.iter().cloned());
    page.gaps = attribution.gap.iter().map(bar).collect();
    if !attribution.effects.is_empty() {
        let shown = |remaining: &&Remaining| !remaining.of_drive || closes(attribution, &remaining.channel);
        let shown: Vec<&Remaining> = attribution.remaining.iter().filter(shown).collect();
        page.traces = shown.iter().map(|of_channel| remaining::trace(of_channel)).collect();
        page.phases = shown.iter().map(|of_channel| remaining::phases(of_channel)).collect();
    }
    let blamed = |candidate: &crate::attribution::Candidate| {
        attribution.effects.iter().find(|effect| effect.id == candidate.id && effect.joint == candidate.joint)
    };
    let shown = |candidate: &crate::attribution::Candidate| Candidate {
        effect: candidate.id.to_owned(),
        joint: candidate.joint.clone(),
        probability: candidate.probability,
        together: blamed(candidate).and_then(|effect| together(effect, attribution)),
        evidence_nats: candidate.evidence_nats,
        parameters: blamed(candidate).map_or_else(Vec::new, |effect| effect.numbers()),
        chosen: blamed(candidate).is_some(),
        set_aside: candidate.set_aside,
    };
    page.candidates = attribution.candidates.iter().map(shown).collect();
    for effect in &attribution.effects {
        for tie in &effect.ties {
            let (this, other) = (at(effect.id, effect.joint.as_deref()), at(tie.id, tie.joint.as_deref()));
            page.ties.push(format!("Beside {this}: {}.", tied(tie)));
            page.next_steps.push(format!("To tell {this} from {other}: {}.", tie.separate_by));
        }
    }
    page.next_steps.extend(match attribution.side {
        None if attribution.effects.is_empty() => nothing_named(attribution.verdict).map(str::to_owned).into_iter().collect(),
        None => put_in(&attribution.effects, robot, files),
        Some(side) => change_simulation(side, &attribution.effects),
    });
    let file_number = |of: &FileNumber| format!("{}, {:.1} of its tolerances off.", off(of), of.tolerances.abs());
    page.file_numbers = attribution.file_numbers.iter().map(file_number).collect();
    page.tolerance_parts = attribution.tolerance_parts.parts().map(|(kind, part)| (kind.to_owned(), part)).collect();
    let detectable = attribution.minimum_detectable.iter();
    page.detectable =
        detectable.map(|least| Detectable { effect: least.id.to_owned(), joint: least.joint.clone(), size: size(least) }).collect();
    page.not_observable = attribution.not_observable.iter().map(|none| (none.id.to_owned(), none.because.clone())).collect();
}

/// What helps where nothing is named.
fn nothing_named(verdict: Word) -> Option<&'static str> {
    match verdict {
        Word::None => Some(
            "Nothing has to be added to the robot file. Where a simulation with it goes astray all the same, record the motion in which it does: what \
             a motion does not turn or load cannot show in it, and what could have been seen in these recordings is listed below.",
        ),
        Word::Unexplained => Some(
            "Record the same motion again and look where the gap lies then: what is there in the same places is the robot's, and what is not came \
             with that day's cables, cameras or hands.",
        ),
        Word::Explained | Word::PartlyExplained => None,
    }
}

/// What brings a simulation closer to the robot.
fn change_simulation(side: Side, effects: &[Blamed]) -> Vec<String> {
    let names: Vec<String> = effects.iter().map(|effect| at(effect.id, effect.joint.as_deref())).collect();
    let names = names.join(" and ");
    let step = match side {
        Side::Robot => format!("Add {names} to the simulation"),
        Side::Simulation => format!("Take {names} out of the simulation"),
    };
    if effects.is_empty() {
        Vec::new()
    } else {
        vec![format!("{step}, with the numbers above; then simulate the recording again and look again.")]
    }
}

/// How what is named gets into the files: into the robot file by one command, into the camera file by a calibration.
fn put_in(effects: &[Blamed], robot: &Robot, files: Files) -> Vec<String> {
    // Effects are written into files of arms only.
    if robot.arm().is_err() {
        return Vec::new();
    }
    let of_cameras = |effect: &&Blamed| Effect::named(effect.id).is_ok_and(|effect| effect.home() == Home::Cameras);
    let (cameras, robots): (Vec<&Blamed>, Vec<&Blamed>) = effects.iter().partition(of_cameras);
    let name = |effect: &&Blamed| at(effect.id, effect.joint.as_deref());
    let calibrated = cameras.iter().map(|effect| {
        format!("{} belongs to the cameras: calibrate them anew with `raven-calibrate cameras`, then register them.", name(effect))
    });
    let mut steps: Vec<String> = calibrated.collect();
    let is_listed = |effect: &&Blamed| Sited::at(robot, effect.id, effect.joint.as_deref()).is_ok_and(|sited| sited.is_listed(robot));
    let (listed, robots): (Vec<&Blamed>, Vec<&Blamed>) = robots.into_iter().partition(is_listed);
    steps.extend(listed.iter().map(|effect| {
        format!("The robot file lists {} already, and what is named is beside that: change its values in the list.", name(effect))
    }));
    if !robots.is_empty() {
        let names: Vec<String> = robots.iter().map(name).collect();
        let (report, told) =
            files.json.map_or((Path::new("report.json"), " (the report that `--json report.json` writes)"), |json| (json, ""));
        // Another name than the robot file's, which is read.
        let new = format!("{}-new.yaml", files.robot.file_stem().unwrap_or_default().to_string_lossy());
        let mut command = "raven-identify".to_owned();
        for effect in robots {
            command += &format!(" --add-effect {}", quoted(&at_place(effect.id, effect.joint.as_deref())));
        }
        let option = |name: &str, file: &Path| format!(" {name} {}", quoted(&file.to_string_lossy()));
        command += &option("--diagnosis", report);
        command += &option("--robot", files.robot);
        command += &files.cameras.map_or_else(String::new, |cameras| option("--cameras", cameras));
        command += &option("-o", Path::new(&new));
        steps.push(format!("Put {} into the robot file with `{command}`{told}, and look again with `--robot {new}`.", names.join(" and ")));
    }
    steps
}

/// A word as a shell takes it: `'shoulder->elbow'`.
fn quoted(word: &str) -> Cow<'_, str> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")).into() }
}

/// Whether the effects close part of a channel's gap, beyond chance.
fn closes(attribution: &Attribution, channel: &str) -> bool {
    let of_channel = attribution.gap.iter().find(|gap| gap.channel == channel);
    of_channel.and_then(|gap| gap.closed.zip(gap.closed_ci95)).is_some_and(|(closed, [low, _])| closed >= TORQUE_CLOSED && low > 0.0)
}

fn bar(gap: &crate::attribution::Closure) -> GapBar {
    GapBar {
        channel: gap.channel.clone(),
        unit: gap.unit.to_owned(),
        noise_floor: gap.noise_floor,
        before: gap.before,
        after: gap.held_out.then_some(gap.after),
        closed: gap.closed.zip(gap.closed_ci95),
        retuned: Some(gap.retuned.after),
    }
}

#[cfg(test)]
mod tests {
    use raven::robot::{ListedEffect, nominal};

    use super::*;

    fn blamed(id: &'static str, joint: Option<&str>) -> Blamed {
        let joint = joint.map(str::to_owned);
        Blamed { id, joint, probability: 0.9, evidence_nats: 40.0, parameters: Vec::new(), ties: Vec::new() }
    }

    #[test]
    fn what_is_named_is_put_where_it_belongs_by_commands_that_are_complete() {
        let files =
            Files { robot: Path::new("my robots/gold.yaml"), cameras: Some(Path::new("cameras.yaml")), json: Some(Path::new("p.json")) };
        let named = [blamed("stereo-scale", None), blamed("cable-coupling", Some("shoulder->elbow")), blamed("creep", Some("elbow"))];
        let steps = put_in(&named, &nominal::gold(), files);
        let [cameras, robot] = steps.as_slice() else { panic!("{steps:?}") };
        assert!(cameras.starts_with("stereo-scale belongs to the cameras: ") && !cameras.contains("--add-effect"), "{cameras}");
        let command = "`raven-identify --add-effect 'cable-coupling:shoulder->elbow' --add-effect creep:elbow --diagnosis p.json \
                       --robot 'my robots/gold.yaml' --cameras cameras.yaml -o gold-new.yaml`";
        assert!(robot.contains(command), "{robot}");
        let unwritten = put_in(&named[1..2], &nominal::gold(), Files { json: None, ..files });
        assert!(
            unwritten[0].contains("--diagnosis report.json") && unwritten[0].contains("that `--json report.json` writes"),
            "{unwritten:?}"
        );
        assert_eq!(quoted("it's"), "'it'\\''s'");
        // What the file has is not added to it.
        let mut with_creep = nominal::gold();
        let values = [("ratio".to_owned(), 2.0), ("time".to_owned(), 20.0)].into();
        with_creep.effects.push(ListedEffect { id: "creep".to_owned(), joint: Some("elbow".to_owned()), values });
        let steps = put_in(&named[1..], &with_creep, files);
        let [listed, command] = steps.as_slice() else { panic!("{steps:?}") };
        assert!(listed.contains("lists creep at the elbow already") && !command.contains("creep"), "{steps:?}");
    }
}
