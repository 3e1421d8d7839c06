//! The page of a gap that nothing was fitted to: how large, and where.

use raven::plot::svg::figure;
use raven::robot::Robot;

use super::{GapBar, Page, PhaseBar, PhaseBars, Trace};
use crate::against::{Against, Simulation};
use crate::gap::Gap;
use crate::residual::{Channels, Residuals};
use crate::whereabouts::Whereabouts;

/// The page of recordings against the model as it stands, or against the simulations by which they were put right.
#[must_use]
pub fn gap_page(
    robot: &Robot,
    recordings: &[String],
    residuals: &[Channels],
    gaps: &[Gap],
    whereabouts: &Whereabouts,
    against: Option<&Against>,
) -> Page {
    let bar = |gap: &Gap| GapBar {
        channel: gap.channel.clone(),
        unit: gap.unit.to_owned(),
        noise_floor: gap.noise_floor,
        before: gap.model,
        ..GapBar::default()
    };
    let joint_trace = |(j, joint): (usize, &raven::robot::Joint)| {
        let (unit, scale) = joint.display_unit();
        trace(&joint.name, unit, scale, residuals.iter().filter_map(|r| r.joints.get(j)))
    };
    let phases = robot.joints.iter().map(|joint| phase_bars(&joint.name, whereabouts)).filter(|bars| !bars.phases.is_empty());
    Page {
        title: robot.name.clone(),
        verdict_sentence: sentence(gaps, if against.is_some() { "simulation" } else { "model" }),
        recordings: recordings
            .iter()
            .cloned()
            .chain(against.iter().flat_map(|against| against.simulations.iter().map(simulated)))
            .collect(),
        gaps: gaps.iter().map(bar).collect(),
        places: whereabouts.sentences.clone(),
        traces: robot.joints.iter().enumerate().map(joint_trace).filter(|trace| !trace.time_s.is_empty()).collect(),
        phases: phases.collect(),
        ..Page::default()
    }
}

fn simulated(simulation: &Simulation) -> String {
    let Simulation { file, recording, shift_s, .. } = simulation;
    format!("{file}: simulation of {recording}, its stamps shifted by {shift_s:+.4} s; the gap is real less simulated")
}

/// The channel whose error is the largest multiple of its noise floor.
fn sentence(gaps: &[Gap], to: &str) -> String {
    let times = |gap: &&Gap| gap.model / gap.noise_floor.max(f64::MIN_POSITIVE);
    match gaps.iter().max_by(|a, b| times(a).total_cmp(&times(b))) {
        None => "These recordings do not show the gap at the joints.".to_owned(),
        Some(Gap { channel, unit, noise_floor, model, .. }) => {
            let noise = if *noise_floor > 0.0 {
                format!(", where the noise alone would leave {} {unit}", figure(*noise_floor))
            } else {
                String::new()
            };
            format!("The largest gap to the {to} is at the {channel}: {} {unit} rms{noise}.", figure(*model))
        }
    }
}

fn trace<'a>(channel: &str, unit: &str, scale: f64, recordings: impl Iterator<Item = &'a Residuals>) -> Trace {
    let mut trace = Trace { channel: channel.to_owned(), unit: unit.to_owned(), ..Trace::default() };
    let mut noise = Vec::new();
    for residuals in recordings {
        trace.follow(&residuals.time_s);
        trace.before.extend(residuals.error.iter().map(|e| e * scale));
        noise.extend(residuals.noise.iter().map(|n| n * scale));
    }
    trace.noise_floor = raven::stats::rms(&noise).unwrap_or(0.0);
    trace
}

fn phase_bars(joint: &str, whereabouts: &Whereabouts) -> PhaseBars {
    let of_joint: Vec<_> = whereabouts.places.iter().filter(|place| place.is_phase_of_joint() && place.channel == joint).collect();
    let phases: Vec<PhaseBar> = of_joint
        .iter()
        .map(|place| PhaseBar {
            phase: place.label.clone(),
            share_of_time: place.share_of_time,
            noise_floor: place.noise_floor,
            before: place.rms,
            after: None,
        })
        .collect();
    PhaseBars { channel: joint.to_owned(), unit: of_joint.first().map_or_else(String::new, |place| place.unit.to_owned()), phases }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_follow_each_other_and_the_largest_gap_is_named() {
        let residuals = Residuals {
            time_s: vec![0.0, 1.0],
            error: vec![0.002, -0.001],
            rigid_error: vec![0.0; 2],
            noise: vec![1e-4; 2],
            rate: vec![0.0; 2],
        };
        let robot = raven::robot::nominal::gold();
        let channels = Channels { joints: vec![Residuals::default(), Residuals::default(), residuals.clone()], ..Channels::default() };
        let gaps = [Gap::new("insertion", "mm", 1e3, &residuals).unwrap()];
        let files = ["a.mcap".to_owned(), "b.mcap".to_owned()];
        let page = gap_page(&robot, &files, &[channels.clone(), channels], &gaps, &Whereabouts::default(), None);
        assert_eq!(page.traces.len(), 1);
        assert_eq!(page.traces[0].time_s, [0.0, 1.0, 6.0, 7.0]);
        assert_eq!(page.traces[0].before, [2.0, -1.0, 2.0, -1.0]);
        assert!(page.verdict_sentence.contains("at the insertion: 1.58 mm rms"), "{}", page.verdict_sentence);
        assert!(sentence(&[], "model").contains("do not show"));
    }
}
