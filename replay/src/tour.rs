//! `raven-replay tour DIR`: a virtual lab session from the first frame to the parameter file, with the commands a lab would type.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use raven::cli::Outcome;
use raven::robot::{Robot, nominal};
use raven::{Error, Result};

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
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Length of the sinusoid that identification uses [s].
    #[arg(long, default_value_t = 40.0)]
    sinusoid_s: f64,
    /// Length of the task motion that the result is checked on [s].
    #[arg(long, default_value_t = 30.0)]
    fls_s: f64,
}

/// What forty seconds of sinusoid through two webcams can tell: the shoulder's ratio, the two softer cables, the cameras' latency.
const PARAMETERS: &str = "--parameters r_l1,k_e2,k_e3,F_c2,hysteresis_3,rounding_3,latency";

/// Runs the tour.
///
/// # Errors
/// If the folder cannot be written to, or a step fails.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let started = Instant::now();
    let folder = &args.folder;
    let mut chain = Chain::begin(folder, out)?;
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
    for (robot, report) in [("robot.yaml", "gap-before.json"), ("identified.yaml", "gap-after.json")] {
        let what = format!("{{fls-tracked.mcap}} --robot {{{robot}}} --cameras {{cameras.yaml}} --gap-only --json {{{report}}}");
        chain.step("raven-diagnose", diagnose, &what)?;
    }
    let verdict = against_truth(folder)?;
    chain.say(&format!(
        "{verdict}\nThe whole session took {:.0} s. Everything is in {}.",
        started.elapsed().as_secs_f64(),
        folder.display()
    ))?;
    chain.finish("tour.txt")
}

/// What identification found beside what the simulation had hidden.
fn against_truth(folder: &Path) -> Result<String> {
    let path = folder.join(TRUTH);
    let truth = read_json(&path)?;
    let identified = Robot::read(&folder.join("identified.yaml"))?;
    let radius = identified.joints.first().map_or(f64::NAN, |j| j.link_pulley_radius);
    let hidden = truth.pointer("/link_pulley_radius_m/shoulder").and_then(serde_json::Value::as_f64);
    let hidden = hidden.ok_or_else(|| Error::file(&path, "has no number at link_pulley_radius_m.shoulder."))?;
    let std = identified.calibration.iter().find(|c| c.parameter == "r_l1").map_or(f64::NAN, |c| c.std);
    Ok(format!(
        "The shoulder's pulley: hidden {:.3} mm, identified {:.3} +- {:.3} mm ({:+.2} %), nominal {:.3} mm.",
        hidden * 1e3,
        radius * 1e3,
        std * 1e3,
        100.0 * (radius / hidden - 1.0),
        nominal::gold().joints[0].link_pulley_radius * 1e3
    ))
}
