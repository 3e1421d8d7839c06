//! What a recursive estimation believed after every sighting: the paper's figures 6 and 7.

use raven::Result;
use raven::plot::{self, Mark, Panel, Series};
use raven::robot::Robot;

use crate::priors::Unknown;

/// Belief after one sighting.
#[derive(Debug, Clone, PartialEq)]
pub struct TracePoint {
    /// Time on the sightings' clock, the logs one after the other [s].
    pub time_s: f64,
    /// Mean, in prior deviations.
    pub z: Vec<f64>,
    /// Standard deviation, in prior deviations.
    pub std: Vec<f64>,
}

/// Beliefs in the order of the sightings.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    /// One per sighting.
    pub points: Vec<TracePoint>,
    /// Length of the logs that are done [s].
    before_s: f64,
}

impl Trace {
    /// After the sighting at `time_s` of the log at hand.
    pub(super) fn push(&mut self, time_s: f64, z: &[f64], std: impl Iterator<Item = f64>) {
        self.points.push(TracePoint { time_s: self.before_s + time_s, z: z.to_vec(), std: std.collect() });
    }

    /// How many sightings were taken in, those of logs before included.
    pub(super) fn sightings(&self) -> usize {
        self.points.len()
    }

    /// Starts the next log.
    pub(super) fn next_log(&mut self) {
        self.before_s = self.points.last().map_or(0.0, |point| point.time_s);
    }

    /// With deviations for information that was counted `tempering` times too often; never wider than the prior.
    pub(super) fn widened(&self, tempering: f64) -> Self {
        let mut widened = self.clone();
        for std in widened.points.iter_mut().flat_map(|point| &mut point.std) {
            *std = (*std * tempering.sqrt()).min(1.0);
        }
        widened
    }

    /// Time from the first sighting until unknown `k` stays within `tolerance` prior deviations of its last value [s].
    #[must_use]
    pub fn settled_after_s(&self, k: usize, tolerance: f64) -> Option<f64> {
        let (first, last) = (self.points.first()?, self.points.last()?);
        let outside = self.points.iter().rposition(|point| (point.z[k] - last.z[k]).abs() > tolerance);
        let settled = outside.map_or(Some(first), |at| self.points.get(at + 1))?;
        Some(settled.time_s - first.time_s)
    }

    /// Panels of value over time with a band of two deviations, for the unknowns that `wanted` chooses, as SVG.
    ///
    /// # Errors
    /// If there is nothing to draw.
    pub fn plot(&self, robot: &Robot, unknowns: &[Unknown], wanted: impl Fn(usize) -> bool) -> Result<String> {
        let panel = |(k, unknown): (usize, &Unknown)| {
            let (unit, factor) = unknown.quantity.shown(robot);
            let line = |label: &str, deviations: f64| Series {
                label: label.to_owned(),
                samples: self.points.iter().map(|p| (p.time_s, factor * unknown.value(p.z[k] + deviations * p.std[k]))).collect(),
                mark: Mark::Line,
            };
            Panel {
                title: unknown.quantity.name(),
                x_label: "time [s]".to_owned(),
                y_label: format!("{} [{unit}]", unknown.quantity.name()),
                series: vec![line("- 2 std", -2.0), line("+ 2 std", 2.0), line("estimate", 0.0)],
            }
        };
        let panels: Vec<Panel> = unknowns.iter().enumerate().filter(|(k, _)| wanted(*k)).map(panel).collect();
        plot::panels(&panels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_to_settle_is_the_last_time_outside() {
        let mut trace = Trace::default();
        for (t, z) in [(1.0, 1.0), (2.0, 0.52), (3.0, 0.7), (4.0, 0.51), (5.0, 0.5)] {
            trace.push(t, &[z], std::iter::once(0.1));
        }
        assert_eq!(trace.settled_after_s(0, 0.05), Some(3.0));
        assert_eq!(trace.settled_after_s(0, 1.0), Some(0.0));
        trace.next_log();
        trace.push(1.0, &[0.5], std::iter::once(0.1));
        assert_eq!(trace.points[5].time_s, 6.0);
    }
}
