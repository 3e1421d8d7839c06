//! How long identification takes on 200 s at 1 kHz, by method, log reading included, and how much memory.
//!
//!     cargo bench -p raven-identify --bench methods
//!
//! The paper's task: a pulley and a latency beside the hard stops and the registration, from the virtual lab's sinusoid.

use std::time::Instant;

use clap::Parser;
use raven::robot::nominal;
use raven::simulation::{Effect, Motion, Options, Session};
use raven_identify::Args;

const DURATION_S: f64 = 200.0;

fn main() -> raven::Result<()> {
    let directory = tempfile::tempdir().map_err(|e| raven::Error::io(std::path::Path::new("."), "create a folder in", e))?;
    let path = |name: &str| directory.path().join(name);
    let robot = nominal::gold();
    let effects: Vec<Effect> =
        ["pulley-radius:shoulder=-0.065", "time-offset=0.06"].iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
    let session = Session::new(&robot, Options { effects, ..Options::default() })?;
    session.record(Motion::Sinusoid, DURATION_S, &path("log.mcap"), |_| {})?;
    robot.write(&path("robot.yaml"))?;
    for method in ["batch", "dual", "joint"] {
        let arguments = ["raven-identify".into(), path("log.mcap"), "--robot".into(), path("robot.yaml"), "--method".into(), method.into()];
        let started = Instant::now();
        raven_identify::run(Args::parse_from(arguments), &mut std::io::sink())?;
        let seconds = started.elapsed().as_secs_f64();
        println!("{method:<6} {seconds:6.2} s   {:5.0} times real time", DURATION_S / seconds);
    }
    if let Some(peak) = peak_memory_mb() {
        println!("peak memory, all methods and the recording of the log: {peak:.0} MB");
    }
    Ok(())
}

/// Largest resident set of this process so far, where the system tells.
fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()? / 1024.0)
}
