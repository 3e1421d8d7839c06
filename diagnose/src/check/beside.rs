//! Every recording of a folder, diagnosed beside the others: they are of one rig, whatever is behind each.
//!
//! Each is diagnosed alone first. How far the others then take the robot file's numbers to be off is what it is diagnosed with a second time.

use std::path::{Path, PathBuf};
use std::time::Instant;

use raven::{Result, cli};

use super::{Diagnose, Diagnosed};
use crate::evidence::numbers::spread::Spread;

/// A diagnosis, or why there is none.
pub(super) struct Diagnosis {
    pub(super) diagnosed: Result<Diagnosed>,
    /// By what part of their tolerances the file's numbers were taken to be off.
    pub(super) spread: Spread,
    /// What it took [s]; that of the others is theirs.
    pub(super) seconds: f64,
}

/// Diagnoses of all recordings, in their order.
pub(super) fn diagnose_all(recordings: &[PathBuf], diagnose: &Diagnose<'_>) -> Vec<Diagnosis> {
    let timed = |log: &Path, spread: Spread| {
        let start = Instant::now();
        let diagnosed = diagnose(log, &spread);
        Diagnosis { diagnosed, spread, seconds: start.elapsed().as_secs_f64() }
    };
    let bar = cli::progress(recordings.len() as u64, "diagnosing blind");
    let mut all = Vec::new();
    for log in recordings {
        all.push(timed(log, Spread::default()));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let departures: Vec<_> = all.iter().map(|alone| alone.diagnosed.as_ref().ok()?.departures.clone()).collect();
    let spreads = Spread::of_others(&departures);
    let bar = cli::progress(recordings.len() as u64, "beside the others");
    for ((diagnosis, log), spread) in all.iter_mut().zip(recordings).zip(spreads) {
        if diagnosis.diagnosed.is_ok() && spread != diagnosis.spread {
            *diagnosis = timed(log, spread);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    all
}
