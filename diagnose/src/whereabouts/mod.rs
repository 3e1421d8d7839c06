//! Where the gap lies: which part of the motion has more of the squared error than of the time.
//!
//! ```text
//! share of excess = sum over the part of max(0, e^2 - n^2) / sum over all parts,   e = r(t) - r(t - h)
//! ```
//!
//! Each part is summed before it is cut at zero. Whether a part stands out is decided on squares over what noise and an evenly spread
//! excess would leave, `z^2 = e^2 / (n^2 + s^2)`, as they are and prewhitened by an autoregression, by circular block shifts with the
//! largest statistic over all parts, horizons and channels: in a recording whose error is spread evenly any part at all is named with
//! a probability of at most 5 %.

mod bins;
mod channel;
mod permutation;
mod recorded;
mod sentences;
mod spectrum;
#[cfg(test)]
mod tests;
mod whiten;

pub use bins::{Bin, Bins, Kind};
pub use channel::{Channel, HORIZONS_S, Track};
pub use recorded::recorded;

use raven::effects::Stage;
use serde::Serialize;

use channel::Anchored;
use permutation::{Chance, NOWHERE, SAMPLES_MIN, Scores, family_wise};

/// Chance that anything is named where the error is spread evenly.
pub const LEVEL: f64 = 0.05;
/// A part stands out if its excess per time is at least this many times that of the rest,
const MARKED: f64 = 2.0;
/// and its error this many times the noise floor: that of torques is an estimate from the residuals themselves.
const ABOVE_FLOOR: f64 = 1.2;
/// Blocks are this many integrated autocorrelation times long.
const BLOCK_TIMES: f64 = 3.0;
/// Largest order of the autoregression that prewhitens, in time and for the spectrum: a higher one would take a line out of the latter.
const ORDER_MAX: [usize; 2] = [8, 1];
/// Samples of one periodogram, at most and at least; longer recordings are cut.
const SPECTRUM_MAX: usize = 2048;
const SPECTRUM_MIN: usize = 64;
/// Permutations where the recordings are of usual length, and fewest.
const PERMUTATIONS: [usize; 2] = [1999, 299];
/// Values sorted into bins in all permutations together, at most.
const WORK_MAX: usize = 1_500_000_000;
const SEED: u64 = 20_170_924;

/// One part of the motion of one channel.
#[derive(Debug, Clone, Serialize)]
pub struct Place {
    /// The part of the way from torque to image that the channel closes.
    pub stage: Stage,
    /// Joint; `null` for the tip.
    pub joint: Option<String>,
    /// Phase of the motion, where it is sorted by phase.
    pub phase: Option<String>,
    /// Channel.
    pub channel: String,
    /// The model was right so long before [s]; `null`: never.
    pub horizon_s: Option<f64>,
    /// What the motion is sorted by.
    pub kind: Kind,
    /// The part in words.
    pub label: String,
    /// From and to, where it is a range.
    pub range: Option<[f64; 2]>,
    /// Share of the squared error above the noise floor.
    pub share_of_excess: f64,
    /// Share of the observations; of the bandwidth for a frequency band.
    pub share_of_time: f64,
    /// Family-wise probability of so much in a part of an evenly spread error.
    pub p: f64,
    /// RMS of the error there, in `unit`.
    pub rms: f64,
    /// RMS that the noise alone would leave there, in `unit`.
    pub noise_floor: f64,
    /// Unit of `rms` and `noise_floor`.
    pub unit: &'static str,
}

impl Place {
    /// Whether its error is markedly larger than elsewhere, beyond chance.
    #[must_use]
    pub fn stands_out(&self) -> bool {
        let (excess, time) = (self.share_of_excess, self.share_of_time);
        self.p <= LEVEL && excess * (1.0 - time) >= MARKED * time * (1.0 - excess) && self.rms >= ABOVE_FLOOR * self.noise_floor
    }

    /// Whether it is a phase of a joint's residual over the whole recording.
    #[must_use]
    pub fn is_phase_of_joint(&self) -> bool {
        self.phase.is_some() && self.horizon_s.is_none() && self.joint.as_ref() == Some(&self.channel)
    }
}

/// All parts that were looked at.
#[derive(Debug, Clone, Default)]
pub struct Whereabouts {
    /// Channel by channel, horizon by horizon.
    pub places: Vec<Place>,
    /// What stands out, in words; says so if nothing does.
    pub sentences: Vec<String>,
}

impl Whereabouts {
    /// What a report lists: every part that stands out, the most telling first, then the phases of the joints over the whole recording,
    /// whatever they hold.
    #[must_use]
    pub fn listed(&self) -> Vec<Place> {
        let mut out: Vec<&Place> = self.places.iter().filter(|place| place.stands_out()).collect();
        out.sort_by(|a, b| sentences::telling(b).total_cmp(&sentences::telling(a)));
        let phases = self.places.iter().filter(|place| place.is_phase_of_joint() && !place.stands_out());
        out.into_iter().chain(phases).cloned().collect()
    }
}

/// Looks for parts of the motion that stand out.
#[must_use]
pub fn find(channels: &[Channel]) -> Whereabouts {
    let looks = looks(channels);
    let work: usize = looks.iter().flat_map(|look| &look.scores).map(|s| s.values.len() * s.bins.len()).sum();
    let permutations = (WORK_MAX / work.max(1)).clamp(PERMUTATIONS[1], PERMUTATIONS[0]);
    find_with(channels, looks, permutations, SEED)
}

/// A channel at a horizon, ready to be permuted.
struct Look {
    horizon_s: Option<f64>,
    /// Places without their P values, way by way.
    places: Vec<Vec<Place>>,
    scores: Vec<Scores>,
    /// For each of the scores, the ways of `places` that its bins stand for.
    ways: Vec<Vec<usize>>,
}

/// No error is smaller but for rounding [rad, m, N m, N or px].
const ROUNDING: f64 = 1e-9;

fn looks(channels: &[Channel]) -> Vec<Look> {
    let mut looks = Vec::new();
    for channel in channels {
        let bins = Bins::of(channel);
        let whole = [channel.horizon_s];
        let horizons = if channel.horizon_s.is_some() { &whole[..] } else { &HORIZONS_S };
        for &horizon_s in horizons {
            // What has its own horizon is there already.
            let anchored = channel.anchored(horizon_s.filter(|_| channel.horizon_s.is_none()));
            let is_error = |a: &Anchored| a.error.iter().any(|e| e.abs() > ROUNDING);
            if let Some(anchored) = anchored.filter(|a| a.error.len() >= 2 * SAMPLES_MIN && is_error(a)) {
                looks.push(Look::new(channel, &bins, horizon_s, &anchored));
            }
        }
    }
    looks
}

fn find_with(channels: &[Channel], looks: Vec<Look>, permutations: usize, seed: u64) -> Whereabouts {
    let scores: Vec<Scores> = looks.iter().flat_map(|look| look.scores.iter().cloned()).collect();
    let mut p = family_wise(&scores, permutations, seed).into_iter();
    let mut places = Vec::new();
    for mut look in looks {
        for ways in &look.ways {
            for (&way, p) in ways.iter().zip(p.next().unwrap_or_default()) {
                look.places[way].iter_mut().zip(p).for_each(|(place, p)| place.p = place.p.min(p));
            }
        }
        places.extend(look.places.into_iter().flatten());
    }
    let sentences = sentences::sentences(channels, &places);
    places.retain(|place| place.share_of_time > 0.0);
    Whereabouts { places, sentences }
}

impl Look {
    fn new(channel: &Channel, bins: &[Bins], horizon_s: Option<f64>, anchored: &Anchored) -> Self {
        let squares: Vec<(f64, f64)> = anchored.error.iter().zip(&anchored.noise).map(|(e, n)| (e * e, n * n)).collect();
        let excess = (squares.iter().map(|(e, n)| e - n).sum::<f64>() / squares.len() as f64).max(0.0);
        let even: Vec<f64> =
            anchored.error.iter().zip(&squares).map(|(e, (_, n))| e / (n + excess).sqrt().max(f64::MIN_POSITIVE)).collect();
        let white = whiten::whitened(&even, &anchored.fresh, ORDER_MAX[0]);
        let horizon = horizon_s.map_or(1.0, |h| h / anchored.interval_s);

        let mut look = Self { horizon_s, places: Vec::new(), scores: Vec::new(), ways: Vec::new() };
        let sorted: Vec<Vec<u8>> = bins.iter().map(|b| anchored.sample.iter().map(|&k| b.of_sample[k]).collect()).collect();
        for (bins, of_sample) in bins.iter().zip(&sorted) {
            look.places.push(look.shares(channel, bins, of_sample, &squares));
        }
        for series in [&even, &white] {
            let power: Vec<f64> = series.iter().map(|v| v * v).collect();
            let (signal, energy) = (whiten::integrated_time(series), whiten::integrated_time(&power));
            // Parts of the time are clusters themselves: blocks as long as the clusters in the squares would hide every one.
            for (time, times) in [(false, signal.max(energy)), (true, signal)] {
                let ways: Vec<usize> = (0..bins.len()).filter(|&b| (bins[b].kind == Kind::Time) == time).collect();
                let longest = BLOCK_TIMES * times.max(horizon);
                look.scores.push(Scores {
                    bins: ways.iter().map(|&b| (sorted[b].clone(), bins[b].bins.len())).collect(),
                    chance: Chance::Blocks((longest.ceil() as usize).min(power.len() / 4).max(1)),
                    values: power.clone(),
                });
                look.ways.push(ways);
            }
        }
        if horizon_s.is_none() {
            look.frequencies(channel, anchored, &whiten::whitened(&even, &anchored.fresh, ORDER_MAX[1]));
        }
        look
    }

    /// Shares of the excess by parts, P values still to come.
    fn shares(&self, channel: &Channel, bins: &Bins, of_sample: &[u8], squares: &[(f64, f64)]) -> Vec<Place> {
        let mut sums = vec![(0.0, 0.0, 0_usize); bins.bins.len()];
        for (&bin, (error, noise)) in of_sample.iter().zip(squares).filter(|(bin, _)| **bin != NOWHERE) {
            if let Some(sum) = sums.get_mut(usize::from(bin)) {
                *sum = (sum.0 + error, sum.1 + noise, sum.2 + 1);
            }
        }
        let total: f64 = sums.iter().map(|(error, noise, _)| (error - noise).max(0.0)).sum();
        let inside: usize = sums.iter().map(|(_, _, count)| count).sum();
        let place = |(bin, &(error, noise, count)): (&Bin, &(f64, f64, usize))| Place {
            stage: channel.stage,
            joint: channel.joint.clone(),
            phase: (bins.kind == Kind::Phase).then(|| bin.label.clone()),
            channel: channel.name.clone(),
            horizon_s: self.horizon_s,
            kind: bins.kind,
            label: bin.label.clone(),
            range: bin.range,
            // Where noise alone explains the error there is no excess to share out.
            share_of_excess: if total > 0.0 { (error - noise).max(0.0) / total } else { 0.0 },
            share_of_time: count as f64 / inside.max(1) as f64,
            p: 1.0,
            rms: (error / count.max(1) as f64).sqrt() * channel.scale,
            noise_floor: (noise / count.max(1) as f64).sqrt() * channel.scale,
            unit: channel.unit,
        };
        bins.bins.iter().zip(&sums).map(place).collect()
    }

    /// Frequency bands: the same with ordinates of the periodogram in place of samples.
    fn frequencies(&mut self, channel: &Channel, anchored: &Anchored, white: &[f64]) {
        let ends = anchored.starts.iter().skip(1).copied().chain([anchored.error.len()]);
        let stretches = anchored.starts.iter().copied().zip(ends).flat_map(|(start, end)| {
            (start..end)
                .step_by(SPECTRUM_MAX)
                .map(move |from| (from, end.min(from + SPECTRUM_MAX)))
                .filter(|(from, to)| to - from >= SPECTRUM_MIN)
        });
        let mut lines = Vec::new();
        for (start, end) in stretches {
            let noise = anchored.noise[start..end].iter().map(|n| n * n).sum::<f64>() / (end - start).max(1) as f64;
            let of_white = spectrum::periodogram(&white[start..end], anchored.interval_s);
            let of_error = spectrum::periodogram(&anchored.error[start..end], anchored.interval_s);
            for ((frequency, power), (_, error)) in of_white.into_iter().zip(of_error) {
                lines.push((frequency, power, (error, noise)));
            }
        }
        lines.sort_by(|a, b| a.0.total_cmp(&b.0));
        let bands: Vec<u8> = lines.iter().map(|(frequency, _, _)| spectrum::band(*frequency) as u8).collect();
        let squares: Vec<(f64, f64)> = lines.iter().map(|(_, _, squares)| *squares).collect();
        let mut ordinates: Vec<f64> = lines.iter().map(|(_, power, _)| *power).collect();
        spectrum::over_continuum(&mut ordinates);
        // The lowest have no surroundings below them, and with a smooth error the continuum is steep there.
        let tried = bands.iter().enumerate().map(|(k, &band)| if k < spectrum::CONTINUUM_MIN { NOWHERE } else { band }).collect();
        let half = 0.5 / anchored.interval_s;
        let lower = [0.0].into_iter().chain(spectrum::EDGES_HZ).take_while(|&edge| edge < half);
        let bin = |from: f64| {
            let to = spectrum::EDGES_HZ.into_iter().find(|&edge| edge > from).unwrap_or(half).min(half);
            Bin { label: bins::label(channel, Kind::Frequency, [from, to]), range: Some([from, to]) }
        };
        let bins = Bins { kind: Kind::Frequency, bins: lower.map(bin).collect(), of_sample: Vec::new() };
        self.places.push(self.shares(channel, &bins, &bands, &squares));
        self.scores.push(Scores { values: ordinates, bins: vec![(tried, bins.bins.len())], chance: Chance::Spectrum });
        self.ways.push(vec![self.places.len() - 1]);
    }
}
