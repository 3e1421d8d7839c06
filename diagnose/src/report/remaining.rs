//! Residuals over time and by phase, before and after the effects that are named.

use raven::stats::rms;

use super::{PhaseBar, PhaseBars, Trace};
use crate::attribution::{Remaining, Run};
use crate::phase::Phase;

/// Residuals of one channel over time, recordings one after the other.
pub(super) fn trace(remaining: &Remaining) -> Trace {
    let mut trace = Trace { channel: remaining.channel.clone(), unit: remaining.unit.to_owned(), ..Trace::default() };
    for run in &remaining.runs {
        trace.follow(&run.time_s);
        trace.before.extend(&run.before);
        trace.after.extend(&run.after);
    }
    trace.noise_floor = rms(&column(remaining, |run| &run.noise)).unwrap_or(0.0);
    trace
}

/// RMS of one channel by phase.
pub(super) fn phases(remaining: &Remaining) -> PhaseBars {
    let all: Vec<Phase> = remaining.runs.iter().flat_map(|run| &run.phase).copied().collect();
    let (before, after) = (column(remaining, |run| &run.before), column(remaining, |run| &run.after));
    let noise = column(remaining, |run| &run.noise);
    let bar = |phase: Phase| {
        let of = |values: &[f64]| rms(&all.iter().zip(values).filter(|(p, _)| **p == phase).map(|(_, v)| *v).collect::<Vec<_>>());
        let count = all.iter().filter(|p| **p == phase).count();
        Some(PhaseBar {
            phase: phase.name().to_owned(),
            share_of_time: count as f64 / all.len() as f64,
            noise_floor: of(&noise)?,
            before: of(&before)?,
            after: of(&after),
        })
    };
    PhaseBars {
        channel: remaining.channel.clone(),
        unit: remaining.unit.to_owned(),
        phases: Phase::ALL.into_iter().filter_map(bar).collect(),
    }
}

fn column(remaining: &Remaining, of: fn(&Run) -> &[f64]) -> Vec<f64> {
    remaining.runs.iter().flat_map(of).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_phase_has_its_bars() {
        let run = Run {
            time_s: vec![1.0, 2.0, 3.0, 4.0],
            before: vec![3.0, 4.0, 1.0, 1.0],
            after: vec![0.3, 0.4, 0.1, 0.1],
            noise: vec![0.2; 4],
            phase: vec![Phase::Reversal, Phase::Reversal, Phase::Hold, Phase::Hold],
        };
        let later = Run { time_s: vec![0.5], before: vec![2.0], after: vec![0.2], noise: vec![0.2], phase: vec![Phase::Hold] };
        let remaining = Remaining { channel: "elbow".to_owned(), unit: "deg", of_drive: false, runs: vec![run, later] };
        let bars = phases(&remaining);
        assert_eq!(bars.phases.len(), 2);
        assert!((bars.phases[0].before - 12.5_f64.sqrt()).abs() < 1e-12 && (bars.phases[0].share_of_time - 0.4).abs() < 1e-12);
        assert!((bars.phases[1].after.unwrap() - 0.02_f64.sqrt()).abs() < 1e-12);
        let trace = trace(&remaining);
        assert_eq!((trace.time_s.as_slice(), trace.after[4]), (&[1.0, 2.0, 3.0, 4.0, 9.0][..], 0.2));
    }
}
