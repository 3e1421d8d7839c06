//! `raven-capture simulate`: recordings of a virtual lab whose robot hides what you ask it to.

use std::io::Write;
use std::path::{Path, PathBuf};

use raven::cli::{self, Outcome};
use raven::log::Stamp;
use raven::robot::{Robot, nominal};
use raven::simulation::{Effect, Hidden, Lot, Motion, Options, SEALED_FACTOR, Session, Written};
use raven::{Error, Result, files};
use serde::Serialize;

use crate::seal;

/// Arguments of `raven-capture simulate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  raven-capture simulate --motion sinusoid --duration 40 --effect pulley-radius:shoulder=-0.05 -o sinusoid.mcap\n  raven-capture simulate --seal blind --lot single"
)]
pub struct Args {
    /// Robot file, which the virtual controller believes; by default the nominal Raven-II, gold arm.
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// board, hardstop, sinusoid, fls (fls1, fls2, ... are other trials), rich, or bench for a bench.
    #[arg(long, required_unless_present = "seal")]
    pub motion: Option<Motion>,
    /// Length of the recording [s]: 60 if left off, 3 at the hard stop, 32 for the board, which is shown in a new pose every second, in 25 at
    /// least.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub duration: Option<f64>,
    /// Render images of both cameras instead of writing the tip's position.
    #[arg(long)]
    pub images: bool,
    /// Frames per second of each camera: 15 if left off; of a sealed recording by lot.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Standard deviation of a tracked coordinate, without --images [px]: 0.1 if left off; of a sealed recording by lot.
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    pub noise: Option<f64>,
    /// Part of the time during which something hides the marker.
    #[arg(long, default_value_t = 0.03, value_name = "PART", allow_negative_numbers = true)]
    pub occluded: f64,
    /// Hide an effect, as in pulley-radius:shoulder=-0.05; may be repeated. A wrong one lists them all.
    #[arg(long, value_name = "ID[:JOINT]=VALUE")]
    pub effect: Vec<Effect>,
    /// Preset of hidden effects: none, or lab for what a lab finds.
    #[arg(long, default_value = "none")]
    pub hidden: Hidden,
    /// Part of their tolerances by which the robot file's numbers and the rig's are off, as a standard deviation: 0 if left off, 0.7 of
    /// sealed recordings.
    #[arg(long, value_name = "PART", allow_negative_numbers = true)]
    pub off_nominal: Option<f64>,
    /// Add a recording to this folder and seal what it hides in labels.json and labels.sha256; nothing in the recording tells it.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["hidden", "truth", "cameras_out"])]
    pub seal: Option<PathBuf>,
    /// What a sealed recording hides, drawn by lot where no --effect is given: single, pair, none, outside (a cause that is not in the
    /// library) or any.
    #[arg(long, requires = "seal", conflicts_with = "effect")]
    pub lot: Option<Lot>,
    /// Everything follows from it: the same seed gives the same bytes, and all recordings of one seed are of one lab. 7 if left off; of a sealed
    /// recording one that nobody knows.
    #[arg(long, allow_negative_numbers = true)]
    pub seed: Option<u64>,
    /// First stamp [s since 1970].
    #[arg(long, default_value_t = 1_750_000_000.0, value_name = "SECONDS", allow_negative_numbers = true)]
    pub start_time: f64,
    /// Write what is hidden to a file; it is never in the log.
    #[arg(long, value_name = "FILE")]
    pub truth: Option<PathBuf>,
    /// Write the cameras as a perfect calibration would describe them.
    #[arg(long, value_name = "FILE")]
    pub cameras_out: Option<PathBuf>,
    /// Write the result as JSON, without what is hidden; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// The recording; with --seal its name in that folder, r001.mcap and so on if left off.
    #[arg(short, long, value_name = "FILE", required_unless_present = "seal")]
    pub output: Option<PathBuf>,
}

/// What was recorded, for machines; nothing in it tells what is hidden.
#[derive(Debug, Serialize)]
pub(crate) struct Report<'a> {
    /// The recording.
    pub(crate) file: &'a Path,
    /// How the robot, or the board, moved.
    pub(crate) motion: String,
    /// What it holds.
    #[serde(flatten)]
    pub(crate) written: &'a Written,
}

/// Records a virtual lab.
///
/// # Errors
/// If an argument makes no sense, the robot file cannot be used, or a file cannot be written.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let outputs = [
        ("-o", args.output.as_deref()),
        ("--truth", args.truth.as_deref()),
        ("--cameras-out", args.cameras_out.as_deref()),
        ("--json", args.json.as_deref()),
    ];
    files::apart(&args.robot, &outputs)?;
    // Standard output is for machines alone where either of them is asked for there.
    let has_words = cli::is_left_for_words(&outputs[1..])?;
    for (k, effect) in args.effect.iter().enumerate() {
        if args.effect[..k].iter().any(|other| (other.kind, &other.target) == (effect.kind, &effect.target)) {
            let name = raven::effects::at_place(effect.kind.id(), effect.target.as_deref());
            return Err(Error::Argument(format!("--effect {name} is given twice; give it once, with all of its size.")));
        }
    }
    let robot = args.robot.as_deref().map_or_else(|| Ok(nominal::gold()), Robot::read)?;
    if !(0.0..=4e9).contains(&args.start_time) {
        return Err(Error::Argument(format!("--start-time is {}, expected seconds since 1970.", args.start_time)));
    }
    let usual = Options::default();
    let options = Options {
        seed: args.seed.unwrap_or(usual.seed),
        hidden: args.hidden,
        effects: args.effect.clone(),
        images: args.images,
        rate_hz: args.rate.unwrap_or(usual.rate_hz),
        noise_px: args.noise.unwrap_or(usual.noise_px),
        hidden_part: args.occluded,
        start: Stamp::default().plus_seconds(args.start_time),
        off_nominal: args.off_nominal.unwrap_or(if args.seal.is_some() { SEALED_FACTOR } else { 0.0 }),
        ..usual
    };
    if let Some(folder) = &args.seal {
        return seal::run(args, folder, &robot, &options, out);
    }
    let (Some(motion), Some(output)) = (args.motion, args.output.as_deref()) else {
        return Err(Error::Argument("--motion and -o are missing; without --seal both are needed.".to_owned()));
    };
    let session = Session::new(&robot, options)?;
    if args.cameras_out.is_some() && session.cameras().is_none() {
        return Err(Error::Argument("--cameras-out: a bench has no cameras; leave it away.".to_owned()));
    }
    let duration_s = args.duration.unwrap_or(match motion {
        Motion::Hardstop => 3.0,
        Motion::Board => 32.0,
        _ => 60.0,
    });
    let bar = cli::progress(1000, "simulating");
    let written = session.record(motion, duration_s, output, |done| bar.set_position((1000.0 * done) as u64))?;
    bar.finish_and_clear();
    if let (Some(path), Some(cameras)) = (&args.cameras_out, session.cameras()) {
        cameras.write(path)?;
    }
    let text = format!(
        "{}: {}, {} s, {} robot states, {} tips ({} hidden), {} + {} images\n",
        output.display(),
        motion,
        written.duration_s,
        written.robot,
        written.tips,
        written.tips_hidden,
        written.images[0],
        written.images[1],
    );
    let report = Report { file: output, motion: motion.to_string(), written: &written };
    cli::results(out, "", args.truth.as_deref(), &session.truth_json())?;
    cli::results(out, if has_words { &text } else { "" }, args.json.as_deref(), &report)?;
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use clap::Parser;
    use raven::{Error, Result};

    /// Simulates in a folder; gives what was printed.
    fn simulate(folder: &Path, words: &[&str]) -> Result<String> {
        let files = words.iter().map(|word| {
            if word.contains(".mcap") || word.contains(".yaml") || word.contains(".json") {
                folder.join(word).display().to_string()
            } else {
                (*word).to_owned()
            }
        });
        let args = ["raven-capture", "simulate"].map(str::to_owned).into_iter().chain(files);
        let mut out = Vec::new();
        crate::run(crate::Args::try_parse_from(args).map_err(|e| Error::Argument(e.to_string()))?, &mut out)?;
        Ok(String::from_utf8(out).unwrap())
    }

    #[test]
    fn the_cameras_of_a_bench_are_refused_before_it_is_recorded() {
        const BENCH: &str = "format: raven-robot/1\nname: bench\nkinematics: {kind: bench}\n\
            source: {topic: /motor/joint_states, format: joint_state}\n\
            joints:\n  - {name: carriage, type: prismatic, gear_ratio: 1.0, motor_capstan_radius: 1.0, link_pulley_radius: 1.0,\n     \
            motor: {inertia: 95.0, coulomb_friction: 20.0, viscous_friction: 203.5}}\n";
        let folder = tempfile::tempdir().unwrap();
        let gold = raven::robot::nominal::GOLD_YAML;
        let robot = format!("{BENCH}{}", &gold[gold.find("tolerances:").unwrap()..]);
        std::fs::write(folder.path().join("bench.yaml"), robot).unwrap();
        let words = ["--robot", "bench.yaml", "--motion", "bench", "--duration", "2", "--cameras-out", "cameras.yaml", "-o", "bench.mcap"];
        let said = simulate(folder.path(), &words).unwrap_err();
        assert!(matches!(&said, Error::Argument(what) if what.contains("a bench has no cameras")), "{said}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_was_written_is_said_to_machines_and_what_is_hidden_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let json = || -> serde_json::Value { serde_json::from_slice(&std::fs::read(folder.path().join("said.json")).unwrap()).unwrap() };
        let motion = ["--motion", "sinusoid", "--duration", "1", "--effect", "payload=0.2"];
        let said = simulate(folder.path(), &[&motion[..], &["--json", "said.json", "-o", "one.mcap"]].concat()).unwrap();
        let written = json();
        assert!(written["file"].as_str().unwrap().ends_with("one.mcap") && said.contains("1000 robot states"), "{written} {said}");
        assert_eq!((&written["motion"], &written["robot"], &written["duration_s"]), (&"sinusoid".into(), &1000.into(), &1.0.into()));
        let sealed = folder.path().join("sealed").display().to_string();
        let seal = |json: &str, name: &str| {
            let words = ["raven-capture", "simulate", "--seal", &sealed, "--json", json, "-o", name];
            let mut out = Vec::new();
            crate::run(crate::Args::parse_from(words.iter().chain(&motion)), &mut out).map(|_| ())
        };
        seal(folder.path().join("said.json").to_str().unwrap(), "two.mcap").unwrap();
        let written = json();
        assert!(written["file"].as_str().unwrap().ends_with("two.mcap") && !written.to_string().contains("payload"), "{written}");
        for name in ["labels.json", "labels.sha256", "cameras.yaml", "three.mcap"] {
            let said = seal(&format!("{sealed}/{name}"), "three.mcap").unwrap_err().to_string();
            assert!(said.contains("--json both name"), "{said}");
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let of = |words: &[&str]| {
            let words = [&["--motion", "sinusoid", "--duration", "1", "-o", "one.mcap"], words].concat();
            simulate(folder.path(), &words).unwrap_err().to_string()
        };
        let twice = ["--effect", "pulley-radius:elbow=0.01", "--effect", "pulley-radius:elbow=0.02"];
        assert!(of(&twice).contains("--effect pulley-radius:elbow is given twice"), "{}", of(&twice));
        assert!(of(&["--truth", "-", "--json", "-"]).contains("both `-`"));
        assert!(of(&["--noise", "-1"]).contains("--noise is -1"), "{}", of(&["--noise", "-1"]));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let elsewhere = ["--effect", "pulley-radius:elbow=0.01", "--effect", "pulley-radius:shoulder=0.02"];
        simulate(folder.path(), &[&["--motion", "sinusoid", "--duration", "1", "-o", "one.mcap"], &elsewhere[..]].concat()).unwrap();
    }

    #[test]
    fn the_length_of_a_board_is_that_of_its_poses() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("board.mcap").display().to_string();
        let args = ["raven-capture", "simulate", "--motion", "board", "--duration", "1", "--rate", "1", "--images", "-o", &path];
        let mut said = Vec::new();
        crate::run(crate::Args::try_parse_from(args).unwrap(), &mut said).unwrap();
        let said = String::from_utf8(said).unwrap();
        assert!(said.contains("board, 25 s, 0 robot states, 0 tips (0 hidden), 25 + 25 images"), "{said}");
    }
}
