//! Ways to sort a motion into parts: phase, speed, load, position, capstan angle, time, image region, frequency.

use raven::stats::quantiles;
use serde::Serialize;

use super::channel::Channel;
use super::permutation::NOWHERE;
use super::spectrum::EDGES_HZ;
use crate::phase::Phase;

/// What a motion is sorted by, and what the values of such a factor mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Index into [`Phase::ALL`].
    Phase,
    /// Magnitude of the velocity, in the position's unit per second: five parts of equal time.
    Speed,
    /// Force of gravity at the joint [N m or N]: three parts of equal time for each direction.
    Load,
    /// Position, in the channel's unit of positions: ten parts of equal time.
    Position,
    /// Angle of the motor's capstan, in turns from 0 to 1: sixteen equal parts.
    Capstan,
    /// Share of the recording that has passed, 0 to 1: ten equal parts.
    Time,
    /// Ninth of the left image, 0 to 8, row by row from the upper left.
    Image,
    /// Frequency band of the residual [Hz].
    Frequency,
}

/// Names of the ninths of an image.
const NINTHS: [&str; 9] =
    ["upper left", "upper middle", "upper right", "middle left", "middle", "middle right", "lower left", "lower middle", "lower right"];

/// One part of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Bin {
    /// For people.
    pub label: String,
    /// From and to, in the factor's unit; `None` for phases and image regions.
    pub range: Option<[f64; 2]>,
}

/// All samples of a channel, sorted.
#[derive(Debug, Clone)]
pub struct Bins {
    /// By what.
    pub kind: Kind,
    /// Parts.
    pub bins: Vec<Bin>,
    /// Part of each sample; 255 where it is in none.
    pub of_sample: Vec<u8>,
}

impl Bins {
    /// Every way in which a channel's samples can be sorted.
    #[must_use]
    pub fn of(channel: &Channel) -> Vec<Self> {
        let Some(first) = channel.tracks.first() else { return Vec::new() };
        let kinds = first.factors.iter().map(|(kind, _)| *kind);
        let mut all: Vec<Self> = kinds.map(|kind| Self::by_factor(channel, kind)).collect();
        let passed = channel.tracks.iter().flat_map(|track| {
            let (start, end) = track.time_s.first().zip(track.time_s.last()).map_or((0.0, 1.0), |(a, b)| (*a, *b));
            track.time_s.iter().map(move |t| (t - start) / (end - start).max(f64::MIN_POSITIVE))
        });
        all.push(Self::sorted(channel, Kind::Time, &passed.collect::<Vec<f64>>()));
        all
    }

    fn by_factor(channel: &Channel, kind: Kind) -> Self {
        let of_track = |track: &super::Track| match track.factors.iter().find(|(k, _)| *k == kind) {
            Some((_, values)) if values.len() == track.error.len() => values.clone(),
            _ => vec![f64::NAN; track.error.len()],
        };
        let values: Vec<f64> = channel.tracks.iter().flat_map(of_track).collect();
        Self::sorted(channel, kind, &values)
    }

    fn sorted(channel: &Channel, kind: Kind, values: &[f64]) -> Self {
        let even = |parts: usize| (0..=parts).map(|k| k as f64 / parts as f64).collect::<Vec<f64>>();
        let edges = match kind {
            Kind::Phase => return Self::numbered(kind, Phase::ALL.iter().map(|phase| phase.name()), values),
            Kind::Image => return Self::numbered(kind, NINTHS.into_iter(), values),
            Kind::Capstan => even(16),
            Kind::Time => even(10),
            Kind::Speed => equal_time::<6>(values),
            Kind::Position => equal_time::<11>(values),
            Kind::Load => {
                let of = |sign: f64| values.iter().copied().filter(|v| v * sign > 0.0).collect::<Vec<f64>>();
                let (down, up) = (equal_time::<4>(&of(-1.0)), equal_time::<4>(&of(1.0)));
                // Both sides meet at zero.
                let inner = |side: &[f64], end: bool| match side {
                    [inner @ .., _] if !end => inner.to_vec(),
                    [_, inner @ ..] if end => inner.to_vec(),
                    _ => Vec::new(),
                };
                match (down.is_empty(), up.is_empty()) {
                    (false, false) => inner(&down, false).into_iter().chain([0.0]).chain(inner(&up, true)).collect(),
                    _ => [down, up].concat(),
                }
            }
            Kind::Frequency => EDGES_HZ.to_vec(),
        };
        let place = |&value: &f64| match edges.last() {
            Some(&last) if value >= edges[0] && value <= last => {
                u8::try_from(edges.partition_point(|&edge| edge <= value).min(edges.len() - 1) - 1).unwrap_or(NOWHERE)
            }
            _ => NOWHERE,
        };
        let bin = |w: &[f64]| Bin { label: label(channel, kind, [w[0], w[1]]), range: Some([w[0], w[1]]) };
        Self { kind, bins: edges.windows(2).map(bin).collect(), of_sample: values.iter().map(place).collect() }
    }

    fn numbered<'a>(kind: Kind, names: impl ExactSizeIterator<Item = &'a str>, values: &[f64]) -> Self {
        let count = names.len();
        let place = |&value: &f64| if value >= 0.0 && value < count as f64 { value as u8 } else { NOWHERE };
        let bins = names.map(|name| Bin { label: name.to_owned(), range: None }).collect();
        Self { kind, bins, of_sample: values.iter().map(place).collect() }
    }
}

/// Edges between which as much time is spent, without those that fall together.
fn equal_time<const N: usize>(values: &[f64]) -> Vec<f64> {
    let parts: [f64; N] = std::array::from_fn(|k| k as f64 / (N - 1) as f64);
    let mut edges = quantiles(values, parts).map_or_else(Vec::new, |edges| edges.to_vec());
    edges.dedup();
    if edges.len() < 2 { Vec::new() } else { edges }
}

/// A part in words: `31 to 38 deg`.
#[must_use]
pub fn label(channel: &Channel, kind: Kind, [from, to]: [f64; 2]) -> String {
    let unit = channel.position_unit;
    match kind {
        Kind::Speed => format!("{} {unit}/s", between(from, to)),
        Kind::Position => format!("{} {unit}", between(from, to)),
        Kind::Load if unit == "mm" => format!("{} N", between(from, to)),
        Kind::Load => format!("{} N m", between(from, to)),
        Kind::Capstan => format!("{:.0} to {:.0} deg", 360.0 * from, 360.0 * to),
        Kind::Time => format!("{:.0} to {:.0} %", 100.0 * from, 100.0 * to),
        Kind::Frequency => format!("{} Hz", between(from, to)),
        Kind::Phase | Kind::Image => String::new(),
    }
}

/// Two numbers with as many digits as tell them apart.
fn between(from: f64, to: f64) -> String {
    let width = (to - from).abs().max(1e-9);
    let digits = (1.0 - width.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{from:.digits$} to {to:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::super::Track;
    use super::*;
    use raven::effects::Stage;

    fn channel(kind: Kind, values: Vec<f64>) -> Channel {
        let count = values.len();
        let time_s = (0..count).map(|k| k as f64).collect();
        let track = Track { time_s, error: vec![0.0; count], noise: vec![0.0; count], factors: vec![(kind, values)] };
        Channel {
            stage: Stage::Transmission,
            joint: None,
            name: String::new(),
            unit: "deg",
            scale: 1.0,
            horizon_s: None,
            position_unit: "deg",
            tracks: vec![track],
        }
    }

    #[test]
    fn parts_of_equal_time_and_of_equal_angle() {
        let values: Vec<f64> = (0..100).map(|k| f64::from(k * k)).collect();
        let position = &Bins::of(&channel(Kind::Position, values))[0];
        for bin in 0..10 {
            assert_eq!(position.of_sample.iter().filter(|&&b| b == bin).count(), 10);
        }
        let turns = &Bins::of(&channel(Kind::Capstan, (0..32).map(|k| f64::from(k) / 32.0).collect()))[0];
        assert_eq!(turns.of_sample[..5], [0, 0, 1, 1, 2]);
        assert_eq!(turns.bins[4].label, "90 to 112 deg");
    }

    #[test]
    fn loads_part_at_zero_and_unknown_values_are_nowhere() {
        let mut values: Vec<f64> = (-30..31).map(f64::from).collect();
        values.push(f64::NAN);
        let bins = Bins::of(&channel(Kind::Load, values));
        assert_eq!(bins[0].bins.len(), 6);
        assert_eq!(bins[0].bins[2].range.unwrap()[1], 0.0);
        assert_eq!((bins[0].of_sample[0], bins[0].of_sample[60], bins[0].of_sample[61]), (0, 5, NOWHERE));
        let time = &bins[1];
        assert_eq!((time.kind, time.of_sample[0], time.of_sample[61]), (Kind::Time, 0, 9));
        // A joint that never moves has one position and so no parts.
        assert!(Bins::of(&channel(Kind::Position, vec![1.0; 40]))[0].bins.is_empty());
    }
}
