//! `raven-replay tour DIR`: a virtual lab session from the first frame to the parameter file, with the commands a lab would type.

use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use raven::cli::{self, Outcome};
use raven::robot::{Robot, nominal};
use raven::{Error, Result, files};
use serde::Serialize;
use serde_json::Value;

use crate::chain::{Chain, TRUTH, calibrate, capture, diagnose, identify, read_json, replay, track};

/// Simulates a lab session with hidden errors and runs the whole chain on it.
///
///   raven-replay tour tour/
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Folder for logs, parameter files, tables and plots; made if it is not there.
    folder: PathBuf,
    /// Seed of the session: what is hidden and all noise.
    #[arg(long, default_value_t = 7, allow_negative_numbers = true)]
    seed: u64,
    /// Length of the sinusoid that identification uses [s].
    #[arg(long, default_value_t = 40.0, value_parser = length_s, allow_negative_numbers = true)]
    sinusoid_s: f64,
    /// Length of the task motion that the result is checked on [s].
    #[arg(long, default_value_t = 30.0, value_parser = length_s, allow_negative_numbers = true)]
    fls_s: f64,
    /// Writes what it ends in as JSON; `-` is standard output.
    #[arg(long)]
    json: Option<PathBuf>,
}

/// Of a motion [s], as `raven-capture simulate` takes it.
fn length_s(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.1..=36_000.0).contains(&value) => Ok(value),
        _ => Err("expected 0.1 to 36000 s".to_owned()),
    }
}

/// The machine-readable result.
#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    /// Of the shoulder.
    link_pulley_radius_m: Radius,
    /// Of the task motion, as `raven-diagnose` has it, with the nominal robot and with the identified one.
    gap_before: Value,
    gap_after: Value,
    seconds: f64,
}

/// What identification found beside what the simulation had hidden [m].
#[derive(Debug, PartialEq, Serialize)]
struct Radius {
    hidden: f64,
    identified: f64,
    /// One sigma; `None` if it was not looked for.
    std: Option<f64>,
    nominal: f64,
}

/// What forty seconds of sinusoid through two webcams can tell: the shoulder's ratio, the two softer cables, the cameras' latency.
const PARAMETERS: &str = "--parameters r_l1,k_e2,k_e3,F_c2,hysteresis_3,rounding_3,latency";

/// Robots whose gap is looked at, and the reports on it.
const GAPS: [(&str, &str); 2] = [("robot.yaml", "gap-before.json"), ("identified.yaml", "gap-after.json")];

/// Runs the tour.
///
/// # Errors
/// If the folder cannot be written to, or a step fails.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let started = Instant::now();
    let (folder, json) = (&args.folder, args.json.as_deref());
    // Standard output may be for the machine alone; the tour is to be seen all the same.
    let mut aside = std::io::stderr();
    let shown: &mut dyn Write = if json == Some(Path::new(cli::STANDARD_OUTPUT)) { &mut aside } else { out };
    let mut chain = Chain::begin(folder, shown)?;
    files::apart([folder.join("robot.yaml")], &[("--json", json)])?;
    let lab = format!("--hidden lab --seed {} --truth {{truth.json}}", args.seed);
    for (motion, length) in [
        ("board", String::new()),
        ("hardstop", String::new()),
        ("sinusoid", format!("--duration {}", args.sinusoid_s)),
        ("fls", format!("--duration {}", args.fls_s)),
    ] {
        let what = format!("simulate --robot {{robot.yaml}} --motion {motion} {length} --images {lab} -o {{{motion}.mcap}}");
        chain.step("raven-capture", capture, &what)?;
    }
    chain.step("raven-capture", capture, "check {sinusoid.mcap}")?;
    chain.step("raven-calibrate", calibrate, "cameras {board.mcap} --board 9x6 --square 0.012 -o {cameras.yaml}")?;
    chain.step("raven-calibrate", calibrate, "register {hardstop.mcap} --robot {robot.yaml} --cameras {cameras.yaml} -o {cameras.yaml}")?;
    for motion in ["sinusoid", "fls"] {
        let what = format!("{{{motion}.mcap}} --robot {{robot.yaml}} --cameras {{cameras.yaml}} -o {{{motion}-tracked.mcap}}");
        chain.step("raven-track", track, &what)?;
    }
    chain.step(
        "raven-identify",
        identify,
        &format!("{{sinusoid-tracked.mcap}} --robot {{robot.yaml}} --cameras {{cameras.yaml}} {PARAMETERS} -o {{identified.yaml}}"),
    )?;
    chain.step("raven-identify", identify, "export {identified.yaml} --format defines -o {defines_calibrated.h}")?;
    chain.step("raven-identify", identify, "export {identified.yaml} --format rosparam -o {calibrated.yaml}")?;
    let plots = "--json {replay.json} --plot {replay.svg}";
    chain.step("raven-replay", replay, &format!("{{fls-tracked.mcap}} --robot {{identified.yaml}} --cameras {{cameras.yaml}} {plots}"))?;
    for (robot, report) in GAPS {
        let what = format!("{{fls-tracked.mcap}} --robot {{{robot}}} --cameras {{cameras.yaml}} --gap-only --json {{{report}}}");
        chain.step("raven-diagnose", diagnose, &what)?;
    }
    let gap = |(_, report): (&str, &str)| Ok::<_, Error>(read_json(&folder.join(report))?["model_gap"].take());
    let [gap_before, gap_after] = [gap(GAPS[0])?, gap(GAPS[1])?];
    let seconds = started.elapsed().as_secs_f64();
    let report = Report { seed: args.seed, link_pulley_radius_m: Radius::of(folder)?, gap_before, gap_after, seconds };
    chain.say(&format!(
        "{}\nThe whole session took {seconds:.0} s. Everything is in {}.",
        report.link_pulley_radius_m,
        folder.display()
    ))?;
    let outcome = chain.finish("tour.txt")?;
    cli::results(out, "", json, &report)?;
    Ok(outcome)
}

impl Radius {
    /// From the files that a tour has left in its folder.
    ///
    /// # Errors
    /// If they cannot be read or do not have it.
    fn of(folder: &Path) -> Result<Self> {
        let path = folder.join(TRUTH);
        let hidden = read_json(&path)?.pointer("/link_pulley_radius_m/shoulder").and_then(Value::as_f64);
        let robot = Robot::read(&folder.join("identified.yaml"))?;
        Ok(Self {
            hidden: hidden.ok_or_else(|| Error::file(&path, "has no number at link_pulley_radius_m.shoulder."))?,
            identified: robot.joints.first().map_or(f64::NAN, |joint| joint.link_pulley_radius),
            std: robot.calibration.iter().find(|line| line.parameter == "r_l1").map(|line| line.std),
            nominal: nominal::gold().joints[0].link_pulley_radius,
        })
    }
}

impl fmt::Display for Radius {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            out,
            "The shoulder's pulley: hidden {:.3} mm, identified {:.3} +- {:.3} mm ({:+.2} %), nominal {:.3} mm.",
            self.hidden * 1e3,
            self.identified * 1e3,
            self.std.unwrap_or(f64::NAN) * 1e3,
            100.0 * (self.identified / self.hidden - 1.0),
            self.nominal * 1e3
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_refused_before_anything_is_simulated() {
        #[derive(Debug, clap::Parser)]
        struct Tour {
            #[command(flatten)]
            args: Args,
        }
        let typed = |length: &str| <Tour as clap::Parser>::try_parse_from(["tour", "folder", "--sinusoid-s", length]);
        assert!(typed("0.1").unwrap().args.sinusoid_s == 0.1);
        for length in ["0", "-1", "NaN", "40000"] {
            let said = typed(length).unwrap_err().to_string();
            assert!(said.contains("--sinusoid-s") && said.contains("0.1 to 36000 s"), "{said}");
        }
    }

    #[test]
    fn the_ending_has_what_was_hidden_beside_what_was_found() {
        let folder = tempfile::tempdir().unwrap();
        let mut robot = nominal::gold();
        robot.joints[0].link_pulley_radius = 0.06;
        robot.write(&folder.path().join("identified.yaml")).unwrap();
        std::fs::write(folder.path().join(TRUTH), r#"{"link_pulley_radius_m": {"shoulder": 0.0599}}"#).unwrap();
        let found = Radius::of(folder.path()).unwrap();
        assert_eq!(found, Radius { hidden: 0.0599, identified: 0.06, std: None, nominal: 0.063_095 });
        assert!(found.to_string().contains("hidden 59.900 mm, identified 60.000"), "{found}");
        std::fs::write(folder.path().join(TRUTH), "{}").unwrap();
        assert!(Radius::of(folder.path()).unwrap_err().to_string().contains("link_pulley_radius_m.shoulder"));
    }
}
