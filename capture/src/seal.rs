//! `raven-capture simulate --seal DIR`: a recording whose hidden effects stand in a label that its SHA-256 keeps from being changed.

use std::hash::{BuildHasher, RandomState};
use std::io::Write;
use std::path::Path;

use raven::cli::{self, Outcome};
use raven::robot::Robot;
use raven::simulation::{CAMERAS, Case, LABELS, LABELS_SUM, Lot, Options, SealedFolder};
use raven::{Error, Result, files};

use crate::simulate::{Args, Report};

/// Adds a recording to the sealed folder. `options` says how cameras look and how far the robot is off nominal.
///
/// # Errors
/// If the folder's labels were changed, the name is taken, or a file cannot be written.
pub fn run(args: &Args, folder: &Path, robot: &Robot, options: &Options, out: &mut dyn Write) -> Result<Outcome> {
    let mut sealed = SealedFolder::open(folder)?;
    let name = args.output.as_deref().map_or_else(|| Ok(sealed.free_name()), name)?;
    let recording = sealed.recording(&name);
    let own = [LABELS, LABELS_SUM, CAMERAS].map(|file| folder.join(file));
    let outputs = own.iter().chain([&recording]).map(|file| ("--seal", Some(file.as_path()))).chain([("--json", args.json.as_deref())]);
    files::apart(None::<&Path>, &outputs.collect::<Vec<_>>())?;
    // Without one of its own, whoever tries all small seeds would find the label.
    let seed = args.seed.unwrap_or_else(|| RandomState::new().hash_one(&name));
    let lot = if args.effect.is_empty() { args.lot.unwrap_or(Lot::Any) } else { Lot::None };
    let drawn = Case::draw(robot, &name, lot, seed)?;
    let case = Case {
        motion: args.motion.unwrap_or(drawn.motion),
        duration_s: args.duration.unwrap_or(drawn.duration_s),
        rate_hz: args.rate.unwrap_or(drawn.rate_hz),
        noise_px: args.noise.unwrap_or(drawn.noise_px),
        effects: if args.effect.is_empty() { drawn.effects } else { args.effect.clone() },
        ..drawn
    };
    let bar = cli::progress(1000, "simulating");
    let written = sealed.add(robot, &case, options, |done| bar.set_position((1000.0 * done) as u64))?;
    bar.finish_and_clear();
    let text = format!(
        "{}: {}, {} s, {} robot states, {} tips ({} hidden); its label is sealed by {}\n",
        recording.display(),
        case.motion,
        case.duration_s,
        written.robot,
        written.tips,
        written.tips_hidden,
        folder.join(LABELS_SUM).display(),
    );
    let report = Report { file: &recording, motion: case.motion.to_string(), written: &written };
    cli::results(out, &text, args.json.as_deref(), &report)?;
    Ok(Outcome::Done)
}

/// The recording's name of `-o NAME.mcap`.
fn name(output: &Path) -> Result<String> {
    let bare = output.components().count() == 1 && output.extension().is_some_and(|extension| extension == "mcap");
    let stem = output.file_stem().and_then(|stem| stem.to_str()).filter(|_| bare);
    stem.map(str::to_owned).ok_or_else(|| {
        Error::Argument(format!("-o is `{}`: with --seal it is the recording's name in that folder, as in r001.mcap.", output.display()))
    })
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use raven::simulation::Magnitude;

    use super::*;

    fn simulate(folder: &Path, more: &[&str]) -> Result<String> {
        let folder = folder.to_str().unwrap();
        let words = ["raven-capture", "simulate", "--seal", folder, "--duration", "1"].into_iter().chain(more.iter().copied());
        let args = crate::Args::try_parse_from(words).map_err(|e| Error::Argument(e.to_string()))?;
        let mut out = Vec::new();
        crate::run(args, &mut out)?;
        Ok(String::from_utf8(out).unwrap())
    }

    #[test]
    fn recordings_of_a_sealed_folder_share_its_cameras_and_hide_what_is_asked() {
        let folder = tempfile::tempdir().unwrap();
        let labels = || SealedFolder::labels(folder.path()).unwrap();
        let said = simulate(folder.path(), &["--effect", "hysteresis:elbow=0.012", "-o", "h.mcap"]).unwrap();
        assert!(said.contains("h.mcap: ") && !said.contains("hysteresis"), "{said}");
        let cameras = std::fs::read(folder.path().join("cameras.yaml")).unwrap();
        for lot in ["none", "single", "pair", "outside"] {
            simulate(folder.path(), &["--lot", lot]).unwrap();
        }
        assert_eq!(cameras, std::fs::read(folder.path().join("cameras.yaml")).unwrap());
        let labels = labels();
        assert_eq!(labels["h"].effects[0].magnitude, Magnitude::One(0.012));
        let counts: Vec<usize> = ["r001", "r002", "r003", "r004"].iter().map(|name| labels[*name].effects.len()).collect();
        assert_eq!(counts, [0, 1, 2, 1]);
        let seeds: std::collections::BTreeSet<_> = labels.values().map(|label| label.seed.clone()).collect();
        assert_eq!(seeds.len(), 5, "every recording has a seed of its own");
    }

    #[test]
    fn a_seed_gives_the_same_recording_and_label() {
        let made = |seed: &str| {
            let folder = tempfile::tempdir().unwrap();
            simulate(folder.path(), &["--seed", seed, "-o", "a.mcap"]).unwrap();
            ["a.mcap", "cameras.yaml", LABELS].map(|file| std::fs::read(folder.path().join(file)).unwrap())
        };
        assert_eq!(made("11"), made("11"));
        assert_ne!(made("11"), made("12"));
    }

    #[test]
    fn what_would_tell_or_not_be_labelled_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for wrong in
            [&["--hidden", "lab"][..], &["--lot", "some"], &["-o", "elsewhere/a.mcap"], &["--lot", "none", "--effect", "payload=0.2"]]
        {
            assert!(simulate(folder.path(), wrong).is_err(), "{wrong:?}");
        }
    }
}
