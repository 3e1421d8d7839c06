//! How far the gap closes once effects are in the model: fitted on half of the recordings' blocks, looked at on the other half.
//!
//! ```text
//! closed = 1 - (after^2 - floor^2) / (before^2 - floor^2)
//! ```
//!
//! `before` is the model with the file in hand, `after` the same with the effects and nothing else; retuned, the file's own numbers are as they
//! come out beside the effects, held by their tolerances: what makes up for an effect has to give way when it is added. What the motion before the
//! recordings left of effects that the file has is no gap of the file, and is in all of them as it comes out. Intervals are those of a
//! bootstrap over blocks; shares of several effects are Shapley's (1953): the mean over all orders of what each adds.

use rand::{RngExt, SeedableRng};
use raven::Result;
use rayon::prelude::*;
use serde::Serialize;

use super::channels::{Sample, Sampled};
use super::remaining::Remaining;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::left::left;
use crate::evidence::numbers::coordinates::Coordinates;
use crate::evidence::recorded::settings::Setting;

/// The gap of one channel, before and after.
#[derive(Debug, Clone, Serialize)]
pub struct Closure {
    /// Joint, `tip`, or a joint's torque.
    pub channel: String,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// RMS that the measurement's noise would leave.
    pub noise_floor: f64,
    /// RMS against the model with the file in hand, which begins as the motion before the recordings left it.
    pub before: f64,
    /// RMS against the model with the effects.
    pub after: f64,
    /// Part of the squared gap above the floor that is gone; `null` without effects, and where that gap is too near the floor to take a part of.
    pub closed: Option<f64>,
    /// Its interval.
    pub closed_ci95: Option<[f64; 2]>,
    /// The effects were fitted on other blocks than these numbers are of.
    pub held_out: bool,
    /// With the file's own numbers moved against their tolerances as well, fitted on other blocks.
    pub retuned: Retuned,
    /// Shares of several effects, in their order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shares: Vec<Share>,
}

/// The gap of one channel with the effects, if there are any, and the file's own numbers as they come out beside them.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Retuned {
    /// RMS.
    pub after: f64,
    /// As [`Closure::closed`].
    pub closed: Option<f64>,
}

/// What one of several effects closes.
#[derive(Debug, Clone, Serialize)]
pub struct Share {
    /// Identifier.
    pub id: &'static str,
    /// As of a cause.
    pub joint: Option<String>,
    /// Part of the squared gap.
    pub closed: f64,
}

/// Length of a block [s].
const BLOCK_S: f64 = 3.0;
/// Resamples of the bootstrap.
const RESAMPLES: usize = 1000;
const SEED: u64 = 20_170_925;
/// A gap is there if its squared error is this much above the floor.
const GAP_MIN: f64 = 1.05;

/// Squared errors of one channel: block, after a subset of the effects, floor.
#[derive(Debug, Clone, Default)]
struct Squares {
    block: Vec<usize>,
    /// Per subset of the effects.
    of_subset: Vec<Vec<f64>>,
    /// With all of them and the file's own numbers.
    retuned: Vec<f64>,
    floor: Vec<f64>,
}

/// Shares of all effects where subsets of them (as bits) close so much.
type SharesOf<'a> = dyn Fn(&dyn Fn(usize) -> f64) -> Vec<Share> + 'a;

/// The gap of every channel that was recorded, and its residuals where there are effects.
///
/// # Errors
/// If the robot does not fit the recordings.
pub(super) fn closures(rows: &dyn Sampled, coordinates: &Coordinates, named: &Hypothesis) -> Result<(Vec<Closure>, Vec<Remaining>)> {
    let measured = rows.measured();
    let count = named.effects.len();
    let mut squares = vec![Squares { of_subset: vec![Vec::new(); 1 << count], ..Squares::default() }; measured.len()];
    let mut pairs: Vec<(Sample, f64)> = Vec::new();
    let predicted: Result<Vec<Option<Predicted>>> = (0..2).into_par_iter().map(|fold| predicted(rows, coordinates, named, fold)).collect();
    for (fold, predicted) in predicted?.into_iter().enumerate() {
        // Blocks that nothing was fitted for elsewhere are left out: with numbers that they are part of they would look better than they are.
        let Some(Predicted { of_subset, retuned }) = predicted else { continue };
        // All have to count the same samples.
        let counts = |k: &usize| of_subset.iter().chain([&retuned]).all(|samples| samples[*k].error.is_finite());
        let here = |k: &usize| block(of_subset[0][*k].time_s) % 2 == fold;
        for k in (0..of_subset[0].len()).filter(here).filter(counts) {
            let sample = of_subset[0][k];
            let of_channel = &mut squares[sample.channel];
            of_channel.block.push((sample.recording << 32) + block(sample.time_s));
            // Where noise is told from what is left, a model that leaves less tells it better.
            let variances = of_subset.iter().chain([&retuned]).map(|samples| samples[k].variance);
            of_channel.floor.push(variances.fold(f64::INFINITY, f64::min));
            of_channel.retuned.push(retuned[k].error.powi(2));
            of_subset.iter().zip(&mut of_channel.of_subset).for_each(|(samples, squares)| squares.push(samples[k].error.powi(2)));
            pairs.extend(of_subset.last().map(|last| (sample, last[k].error)));
        }
    }
    let shares_of = |closed: &dyn Fn(usize) -> f64| -> Vec<Share> {
        if count < 2 {
            return Vec::new();
        }
        let share = |(k, &effect): (usize, &usize)| {
            let sited = coordinates.sited[effect];
            Share { id: sited.effect.id, joint: sited.joint(rows.robot()), closed: shapley(count, k, closed) }
        };
        named.effects.iter().enumerate().map(share).collect()
    };
    let closures =
        measured.iter().zip(&squares).filter_map(|(m, squares)| closure(&m.name, m.unit, m.scale, squares, &shares_of)).collect();
    Ok((closures, if count == 0 { Vec::new() } else { Remaining::of(&measured, pairs) }))
}

/// Errors of every sample as the other half of a fold's blocks gives the numbers.
struct Predicted {
    /// Per subset of the effects (as bits).
    of_subset: Vec<Vec<Sample>>,
    /// With all of them and the file's own numbers.
    retuned: Vec<Sample>,
}

/// `None` where the other half of the blocks cannot be fitted.
fn predicted(rows: &dyn Sampled, coordinates: &Coordinates, named: &Hypothesis, fold: usize) -> Result<Option<Predicted>> {
    let others = rows.only(&|time_s| block(time_s) % 2 != fold);
    let Some(Hypothesis { u, .. }) = Fitter::new(others.as_ref(), coordinates).fit(&named.effects, &named.u, None)? else {
        return Ok(None);
    };
    let with = |subset: usize| {
        let added = named.effects.iter().enumerate().filter(|(k, _)| subset >> k & 1 == 1).map(|(_, &effect)| effect);
        let added: Vec<usize> = added.collect();
        let settings: Vec<Setting> = added.iter().map(|&effect| setting(coordinates, effect, &u)).collect();
        rows.samples(&[settings.clone(), left(others.as_ref(), coordinates, &added, &settings)?].concat())
    };
    let of_subset: Vec<Vec<Sample>> = (0..1 << named.effects.len()).into_par_iter().map(with).collect::<Result<_>>()?;
    Ok(Some(Predicted { of_subset, retuned: rows.samples(&coordinates.settings(&u))? }))
}

fn setting(coordinates: &Coordinates, effect: usize, u: &[f64]) -> Setting {
    (coordinates.sited[effect], coordinates.own(effect, u))
}

fn block(time_s: f64) -> usize {
    (time_s / BLOCK_S).max(0.0) as usize
}

fn closure(channel: &str, unit: &'static str, scale: f64, squares: &Squares, shares_of: &SharesOf) -> Option<Closure> {
    let (first, last) = (squares.of_subset.first()?, squares.of_subset.last()?);
    if first.is_empty() {
        return None;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (before, after, floor) = (mean(first), mean(last), mean(&squares.floor));
    let gap = before > GAP_MIN * floor && before > 0.0;
    let closed = |after: f64| 1.0 - (after - floor) / (before - floor);
    let closed_by = |subset: usize| closed(mean(&squares.of_subset[subset]));
    let retuned = mean(&squares.retuned);
    let any = squares.of_subset.len() > 1;
    Some(Closure {
        channel: channel.to_owned(),
        unit,
        noise_floor: floor.sqrt() * scale,
        before: before.sqrt() * scale,
        after: after.sqrt() * scale,
        closed: (gap && any).then(|| closed_by(squares.of_subset.len() - 1)),
        closed_ci95: if gap && any { interval(squares) } else { None },
        held_out: any,
        retuned: Retuned { after: retuned.sqrt() * scale, closed: gap.then(|| closed(retuned)) },
        shares: if gap { shares_of(&closed_by) } else { Vec::new() },
    })
}

/// Percentiles of the closed part over resampled blocks.
fn interval(squares: &Squares) -> Option<[f64; 2]> {
    let mut sums: std::collections::BTreeMap<usize, [f64; 3]> = std::collections::BTreeMap::new();
    let (before, after) = (squares.of_subset.first()?, squares.of_subset.last()?);
    for (((&block, &before), &after), &floor) in squares.block.iter().zip(before).zip(after).zip(&squares.floor) {
        let sum = sums.entry(block).or_default();
        *sum = [sum[0] + before, sum[1] + after, sum[2] + floor];
    }
    let sums: Vec<[f64; 3]> = sums.into_values().collect();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(SEED);
    let mut closed: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn = (0..sums.len()).map(|_| sums[rng.random_range(0..sums.len())]);
            let [before, after, floor] = drawn.fold([0.0; 3], |s, d| [s[0] + d[0], s[1] + d[1], s[2] + d[2]]);
            1.0 - (after - floor) / (before - floor)
        })
        .filter(|closed| closed.is_finite())
        .collect();
    closed.sort_by(f64::total_cmp);
    let at = |p: f64| closed.get((p * closed.len() as f64) as usize).copied();
    at(0.025).zip(at(0.975)).map(|(low, high)| [low, high])
}

/// Shapley's value of player `k` of `count` in a game whose value of a coalition (as bits) is `value`.
fn shapley(count: usize, k: usize, value: &dyn Fn(usize) -> f64) -> f64 {
    let factorial = |n: usize| (1..=n).product::<usize>() as f64;
    (0..1_usize << count)
        .filter(|coalition| coalition >> k & 1 == 0)
        .map(|coalition| {
            let size = coalition.count_ones() as usize;
            let weight = factorial(size) * factorial(count - size - 1) / factorial(count);
            weight * (value(coalition | 1 << k) - value(coalition))
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::super::channels::Measured;
    use super::*;
    use crate::evidence::recorded::rows::{Links, Observed};
    use crate::evidence::tests::{Seen, tips};
    use approx::assert_relative_eq;
    use raven::effects::{Channel, Sited};
    use raven::robot::Robot;

    type Row = fn(&[Option<&[f64]>], Links) -> Vec<f64>;

    /// A tip that an offset moves by 2 mm in blocks with even numbers and by 3 mm in others, of which nothing can be fitted.
    struct Half {
        seen: Seen<Row>,
        unfit: Seen<Row>,
    }

    impl Observed for Half {
        fn robot(&self) -> &Robot {
            self.seen.robot()
        }
        fn recordings(&self) -> usize {
            self.seen.recordings()
        }
        fn tip_rows(&self) -> usize {
            self.seen.tip_rows()
        }
        fn torque_rows(&self) -> usize {
            self.seen.torque_rows()
        }
        fn tip_block(&self) -> usize {
            self.seen.tip_block()
        }
        fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
            self.seen.cannot_show(sited)
        }
        fn residuals(&self, settings: &[Setting], links: Links, channels: &[Channel]) -> Result<Vec<f64>> {
            self.seen.residuals(settings, links, channels)
        }
    }

    impl Sampled for Half {
        fn measured(&self) -> Vec<Measured> {
            vec![Measured { name: "tip".to_owned(), unit: "mm", scale: 1e3, side: Channel::Tip, signed: false }]
        }
        fn samples(&self, settings: &[Setting]) -> Result<Vec<Sample>> {
            let left = if settings.is_empty() { 1.0 } else { 0.1 };
            let sample = |k: usize| {
                let time_s = 0.1 * k as f64;
                let error = left * if block(time_s).is_multiple_of(2) { 2e-3 } else { 3e-3 };
                Sample { channel: 0, recording: 0, time_s, error, variance: 0.0, rate: 0.0 }
            };
            Ok((0..600).map(sample).collect())
        }
        fn only(&self, keep: &dyn Fn(f64) -> bool) -> Box<dyn Observed + '_> {
            let Self { seen, unfit } = self;
            Box::new(if keep(0.0) { seen.clone() } else { unfit.clone() })
        }
    }

    #[test]
    fn blocks_that_nothing_is_fitted_for_elsewhere_do_not_count() {
        let of = |row: Row| Seen::new(&[("joint-offset", [0, 0])], row);
        let finite: Row = |numbers, _| tips(|k| k.sin() * (1.0 - numbers[0].map_or(0.0, |u| u[0])));
        let half = Half { seen: of(finite), unfit: of(|_, _| tips(|_| f64::NAN)) };
        let coordinates = Coordinates::new(&half.seen.robot, &half);
        let fitter = Fitter::new(&half, &coordinates);
        let named = fitter.fit(&[0], &fitter.nowhere(), None).unwrap().unwrap();
        let (gaps, _) = closures(&half, &coordinates, &named).unwrap();
        // What is fitted in blocks with even numbers is looked at in the others alone.
        assert_relative_eq!(gaps[0].before, 3.0, max_relative = 1e-9);
        assert_relative_eq!(gaps[0].closed.unwrap(), 0.99, max_relative = 1e-9);
        assert!(gaps[0].held_out);
        let neither = Half { seen: half.unfit.clone(), ..half };
        assert!(closures(&neither, &coordinates, &named).unwrap().0.is_empty());
    }

    #[test]
    fn shares_sum_to_the_whole_and_are_those_of_the_glove_game() {
        // One left glove (player 0) and two right ones: a pair is worth 1. Shapley 1953: 2/3, 1/6, 1/6.
        let pair = |coalition: usize| f64::from(u8::from(coalition & 1 == 1 && coalition & 6 != 0));
        let shares: Vec<f64> = (0..3).map(|k| shapley(3, k, &pair)).collect();
        assert_relative_eq!(shares[0], 2.0 / 3.0, epsilon = 1e-12);
        assert_relative_eq!(shares[1], 1.0 / 6.0, epsilon = 1e-12);
        assert_relative_eq!(shares.iter().sum::<f64>(), 1.0, epsilon = 1e-12);
    }
}
