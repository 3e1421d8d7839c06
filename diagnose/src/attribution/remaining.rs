//! Residuals over time, before and after effects are in the model: those after are of effects that were fitted on other blocks.

use raven::effects::Channel;

use super::channels::{Measured, Sample};
use crate::phase::{Phase, phases};

/// Residuals of one channel.
#[derive(Debug, Clone, Default)]
pub struct Remaining {
    /// Joint, or a joint's torque or force.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// Whether it is a torque or a force.
    pub of_drive: bool,
    /// One per recording.
    pub runs: Vec<Run>,
}

/// Residuals of one recording; all columns have the same length.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// [s], increasing.
    pub time_s: Vec<f64>,
    /// With the file in hand.
    pub before: Vec<f64>,
    /// With the effects.
    pub after: Vec<f64>,
    /// Standard deviation of the measurement's noise.
    pub noise: Vec<f64>,
    /// What the joint was doing.
    pub phase: Vec<Phase>,
}

impl Remaining {
    /// Of samples before, each with its error after.
    pub(super) fn of(measured: &[Measured], mut pairs: Vec<(Sample, f64)>) -> Vec<Self> {
        pairs.sort_by(|(a, _), (b, _)| (a.channel, a.recording).cmp(&(b.channel, b.recording)).then(a.time_s.total_cmp(&b.time_s)));
        let of_channel = |(channel, m): (usize, &Measured)| {
            let from = pairs.partition_point(|(sample, _)| sample.channel < channel);
            let to = pairs.partition_point(|(sample, _)| sample.channel <= channel);
            let runs = pairs[from..to].chunk_by(|(a, _), (b, _)| a.recording == b.recording).map(|pairs| Run::of(pairs, m.scale));
            let all = Self { channel: m.name.clone(), unit: m.unit, of_drive: m.side == Channel::Torque, runs: runs.collect() };
            (m.signed && !all.runs.is_empty()).then_some(all)
        };
        measured.iter().enumerate().filter_map(of_channel).collect()
    }
}

impl Run {
    fn of(pairs: &[(Sample, f64)], scale: f64) -> Self {
        let column = |of: &dyn Fn(&(Sample, f64)) -> f64| pairs.iter().map(of).collect::<Vec<f64>>();
        let time_s = column(&|(sample, _)| sample.time_s);
        let phase = phases(&time_s, &column(&|(sample, _)| sample.rate));
        Self {
            time_s,
            before: column(&|(sample, _)| sample.error * scale),
            after: column(&|(_, after)| after * scale),
            noise: column(&|(sample, _)| sample.variance.sqrt() * scale),
            phase,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_of_two_folds_are_put_in_order() {
        let joint = Measured { name: "elbow".to_owned(), unit: "deg", scale: 10.0, side: Channel::Tip, signed: true };
        let tip = Measured { name: "tip".to_owned(), signed: false, ..joint.clone() };
        let sample = |channel, recording, time_s: f64| {
            (Sample { channel, recording, time_s, error: time_s, variance: 4.0, rate: 1.0 }, 0.5 * time_s)
        };
        let pairs = vec![sample(0, 0, 3.0), sample(1, 0, 1.0), sample(0, 1, 0.0), sample(0, 0, 1.0), sample(0, 0, 2.0)];
        let remaining = Remaining::of(&[joint, tip], pairs);
        assert_eq!(remaining.len(), 1);
        let [first, second] = remaining[0].runs.as_slice() else { panic!("{remaining:?}") };
        assert_eq!((first.time_s.as_slice(), second.time_s.as_slice()), (&[1.0, 2.0, 3.0][..], &[0.0][..]));
        assert_eq!((first.before[2], first.after[2], first.noise[2]), (30.0, 15.0, 20.0));
        assert_eq!(first.phase, [Phase::Cruise; 3]);
    }
}
