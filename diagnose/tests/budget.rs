//! What a diagnosis may cost: for 75 s of recording 60 s of two processors, and 2 GB.

use raven::camera::Cameras;
use raven::robot::nominal;
use raven::simulation::{Motion, Options, SealedFolder, Session};
use raven_diagnose::{Nominal, diagnose_recording};

const PROCESSOR_S: f64 = 120.0;
const MEMORY_KB: f64 = 2e6;

/// Processor time of this process so far [s] and the most memory it had [kB]; `None` where the system does not say.
fn spent() -> Option<(f64, f64)> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // After the name, which may hold spaces: user and system time are the 12th and 13th, in hundredths of a second.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let hundredths: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some((0.01 * hundredths, peak.split_whitespace().next()?.parse().ok()?))
}

#[test]
fn a_long_recording_with_two_effects_stays_within_its_budget() {
    let folder = tempfile::tempdir().unwrap();
    let robot = nominal::gold();
    let effects = ["hysteresis:elbow=0.012", "motor-coulomb-friction:shoulder=2"].map(|text| text.parse().unwrap());
    let options = Options { seed: 75, effects: effects.to_vec(), rate_hz: 30.0, noise_px: 0.2, ..SealedFolder::options() };
    let session = Session::new(&robot, options).unwrap();
    let (log, cameras) = (folder.path().join("long.mcap"), folder.path().join("cameras.yaml"));
    session.record(Motion::Rich, 75.0, &log, |_| {}).unwrap();
    session.cameras().unwrap().write(&cameras).unwrap();
    let Some((before, _)) = spent() else {
        eprintln!("skipped: this system does not say what a process spends");
        return;
    };
    let start = std::time::Instant::now();
    let verdict = diagnose_recording(&log, &Nominal::new(&robot, Some(&Cameras::read(&cameras).unwrap()))).unwrap().verdict;
    let (after, peak_kb) = spent().unwrap();
    eprintln!("{:.1} s, {:.1} s of processor, {:.0} MB", start.elapsed().as_secs_f64(), after - before, 1e-3 * peak_kb);
    let named: Vec<&str> = verdict.effects.iter().map(|effect| effect.id.as_str()).collect();
    assert_eq!(named.len(), 2, "{named:?}");
    assert!(after - before < PROCESSOR_S, "{} s of processor", after - before);
    assert!(peak_kb < MEMORY_KB, "{peak_kb} kB");
}
