//! When a camera that runs at its own steady pace took its frames, from stamps that scatter about it.
//!
//! A sensor exposes by its crystal; its stamps come late by what the bus and the computer took. With `n` the number of a frame and `T` the
//! interval,
//!
//! ```text
//! stamp_n = phase_n + n T + e_n,   phase_n = phase_n-1 + w_n,   e ~ N(0, r),  w ~ N(0, q)
//! ```
//!
//! Steps over `m` frames tell the two apart, for they scatter by `2 r + m q`. The phase is then smoothed by Rauch, Tung and Striebel's
//! recursion (1965): a steady camera's frames are known to a seventh of the stamps' scatter, while one whose interval truly varies (`q` large)
//! keeps its stamps. At 50 mm/s and 0.35 m a scatter of 1 ms is 0.1 px, as much as the marker's centre is uncertain by.

use raven::stats::{median, median_step, robust_std};

/// When the frames of one camera were taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Pace {
    /// Times of the frames [s].
    pub time_s: Vec<f64>,
    /// Their standard deviation [s].
    pub std_s: f64,
    /// Standard deviation of the stamps about these times [s].
    pub jitter_s: f64,
}

/// Steps over so many frames, beside those over one, tell scatter of stamps from wander of the camera.
const FAR: usize = 20;
/// Squared scatter over far steps that much above that over single ones may be chance, in a minute at 15 Hz.
const BY_CHANCE: f64 = 1.15;
/// Fewest frames without a long gap that are smoothed.
const FEWEST: usize = 2 * FAR;
/// After a gap of so many intervals the numbering starts anew: a clock that is off by 1e-3 is then out by a twentieth of an interval.
const LONGEST_GAP: f64 = 50.0;
/// Wander that no camera is free of, as part of the scatter's variance: temperature moves a crystal over minutes.
const LEAST_WANDER: f64 = 1e-3;
/// A stamp farther than this from where the frames before put it, in standard deviations, is late for a reason of its own.
const GATE_SIGMAS: f64 = 5.0;
/// More such stamps than this part, and the camera has no pace.
const MOST_LATE: f64 = 0.1;
/// So many frames to either side of one tell whether the camera has its pace there.
const ABOUT: usize = 10;
/// It has not where more of them than this are late: three come at once after a delay of three intervals, but every other one where a
/// camera that saw too little light went on at two thirds of its rate.
const MOST_LATE_ABOUT: usize = 5;
/// Part of the distance between a stamp and its frame by which the next ones are expected elsewhere, and the most that counts of it
/// [interval].
const FOLLOWED: f64 = 0.2;
const FOLLOWED_MAX: f64 = 0.25;

/// The pace behind increasing stamps [s]; the stamps as they are, where there are too few or no pace shows.
#[must_use]
pub fn pace(stamps_s: &[f64]) -> Pace {
    let jitter_s = step_scatter(stamps_s, 1).map_or(0.0, |scatter| scatter / std::f64::consts::SQRT_2);
    let as_they_are = Pace { time_s: stamps_s.to_vec(), std_s: jitter_s, jitter_s };
    let (Some(near), Some(far)) = (step_scatter(stamps_s, 1), step_scatter(stamps_s, FAR)) else { return as_they_are };
    let count = FAR as f64;
    let wanders = far * far > BY_CHANCE * near * near;
    let wander = if wanders { (far * far - near * near) / (count - 1.0) } else { 0.0 };
    let scatter = 0.5 * (near * near - wander);
    if scatter <= wander {
        // Steps that scatter as a random walk does: the stamps follow the frames, and neighbours say nothing.
        let scatter_s = scatter.max(0.0).sqrt();
        return Pace { std_s: scatter_s, jitter_s: scatter_s, ..as_they_are };
    }
    let noise = Noise { scatter, wander: wander.max(LEAST_WANDER * scatter) };
    let interval_s = median_step(stamps_s).unwrap_or(0.0);
    let (mut time_s, mut variance, mut late) = (Vec::with_capacity(stamps_s.len()), 0.0, 0);
    for run in stamps_s.chunk_by(|a, b| b - a < LONGEST_GAP * interval_s) {
        let smoothed = smooth(run, interval_s, noise);
        time_s.extend(smoothed.time_s);
        variance += smoothed.variance * run.len() as f64;
        late += smoothed.late;
    }
    if late as f64 > MOST_LATE * stamps_s.len() as f64 {
        return as_they_are;
    }
    Pace { time_s, std_s: (variance / stamps_s.len() as f64).sqrt(), jitter_s: scatter.sqrt() }
}

/// Variances per frame [s^2].
#[derive(Debug, Clone, Copy)]
struct Noise {
    scatter: f64,
    wander: f64,
}

struct Smoothed {
    time_s: Vec<f64>,
    /// Mean over the frames [s^2].
    variance: f64,
    late: usize,
}

fn smooth(stamps_s: &[f64], median_interval_s: f64, noise: Noise) -> Smoothed {
    if stamps_s.len() < FEWEST {
        return Smoothed { time_s: stamps_s.to_vec(), variance: noise.scatter, late: 0 };
    }
    let number = numbers(stamps_s, median_interval_s);
    let interval_s = slope(&number, stamps_s);
    let phase: Vec<f64> = number.iter().zip(stamps_s).map(|(n, t)| t - stamps_s[0] - n * interval_s).collect();
    // Forwards: the phase and its variance before and after each stamp.
    let start = median(&phase[..FEWEST]).unwrap_or(0.0);
    let (mut mean, mut variance) = (start, noise.scatter);
    let (mut before, mut after, mut is_late) = (Vec::new(), Vec::new(), Vec::new());
    for (k, &seen) in phase.iter().enumerate() {
        let steps = if k == 0 { 0.0 } else { number[k] - number[k - 1] };
        variance += noise.wander * steps;
        before.push((mean, variance));
        let miss = seen - mean;
        let late = miss * miss > GATE_SIGMAS * GATE_SIGMAS * (variance + noise.scatter);
        is_late.push(late);
        if !late {
            let gain = variance / (variance + noise.scatter);
            mean += gain * miss;
            variance *= 1.0 - gain;
        }
        after.push((mean, variance));
    }
    // Backwards.
    let mut smoothed = after.clone();
    for k in (0..phase.len() - 1).rev() {
        let gain = after[k].1 / before[k + 1].1;
        smoothed[k] =
            (after[k].0 + gain * (smoothed[k + 1].0 - before[k + 1].0), after[k].1 + gain * gain * (smoothed[k + 1].1 - before[k + 1].1));
    }
    let late_about = |k: usize| is_late[k.saturating_sub(ABOUT)..is_late.len().min(k + ABOUT + 1)].iter().filter(|late| **late).count();
    let of_frame = |k: usize| {
        // Where the camera has lost its pace its stamps are all there is.
        if late_about(k) > MOST_LATE_ABOUT {
            return (stamps_s[k], noise.scatter);
        }
        (stamps_s[0] + number[k] * interval_s + smoothed[k].0, smoothed[k].1)
    };
    let (time_s, variances): (Vec<f64>, Vec<f64>) = (0..phase.len()).map(of_frame).unzip();
    let variance = variances.iter().sum::<f64>() / phase.len() as f64;
    Smoothed { time_s, variance, late: is_late.iter().filter(|late| **late).count() }
}

/// Numbers of the frames, missing ones counted, by where the frames before have each expected. A stamp may be late by any number of intervals:
/// its frame is then the one before that of the next stamp.
fn numbers(stamps_s: &[f64], median_interval_s: f64) -> Vec<f64> {
    // The median of single steps is a multiple of the clock's resolution.
    let far_s = median(&steps(stamps_s, FAR)).unwrap_or(median_interval_s);
    let interval_s = far_s / (far_s / median_interval_s).round().max(1.0);
    // Where in the interval stamps lie, of the first ones: on a circle, as any of them may be late.
    let turns = stamps_s[..FEWEST.min(stamps_s.len())].iter().map(|t| std::f64::consts::TAU * ((t - stamps_s[0]) / interval_s).fract());
    let (sine, cosine) = turns.fold((0.0, 0.0), |(sine, cosine), turn| (sine + turn.sin(), cosine + turn.cos()));
    let mut expected_s = stamps_s[0] + interval_s * f64::atan2(sine, cosine) / std::f64::consts::TAU;
    let nearest = |t: &f64| {
        let number = ((t - expected_s) / interval_s).round();
        let off_s = t - expected_s - number * interval_s;
        expected_s += FOLLOWED * off_s.clamp(-FOLLOWED_MAX * interval_s, FOLLOWED_MAX * interval_s);
        number
    };
    let mut number: Vec<f64> = stamps_s.iter().map(nearest).collect();
    for k in (1..number.len()).rev() {
        number[k - 1] = number[k - 1].min(number[k] - 1.0);
    }
    number
}

/// Interval by a line through the stamps; late ones hardly move it, for it is fitted again without them.
fn slope(number: &[f64], stamps_s: &[f64]) -> f64 {
    let line = |keep: &dyn Fn(usize) -> bool| {
        let kept: Vec<usize> = (0..number.len()).filter(|&k| keep(k)).collect();
        let count = kept.len() as f64;
        let mean = |values: &[f64]| kept.iter().map(|&k| values[k]).sum::<f64>() / count;
        let (n, t) = (mean(number), mean(stamps_s));
        let square: f64 = kept.iter().map(|&k| (number[k] - n).powi(2)).sum();
        let product: f64 = kept.iter().map(|&k| (number[k] - n) * (stamps_s[k] - t)).sum();
        (product / square, t - product / square * n)
    };
    let (first, offset) = line(&|_| true);
    let misses: Vec<f64> = number.iter().zip(stamps_s).map(|(n, t)| (t - offset - first * n).abs()).collect();
    let usual = median(&misses).unwrap_or(0.0);
    line(&|k| misses[k] <= GATE_SIGMAS * usual).0
}

/// Steps over `m` frames [s].
fn steps(stamps_s: &[f64], m: usize) -> Vec<f64> {
    stamps_s.windows(m + 1).map(|w| w[m] - w[0]).collect()
}

/// Robust standard deviation of the steps over `m` frames about whole multiples of the interval [s].
fn step_scatter(stamps_s: &[f64], m: usize) -> Option<f64> {
    let interval = median_step(stamps_s).filter(|&interval| interval > 0.0)?;
    let steps = steps(stamps_s, m);
    // The usual step over m frames; those with a missing frame in them are longer by whole intervals.
    let usual = median(&steps)?;
    let off: Vec<f64> = steps.iter().map(|step| step - usual - interval * ((step - usual) / interval).round()).collect();
    robust_std(&off)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// True times and stamps of a camera with scatter and wander [s]; one frame in a hundred is missing.
    fn camera(scatter_s: f64, wander_s: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut truth, mut stamps, mut phase) = (Vec::new(), Vec::new(), 0.013);
        for n in 0..600 {
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            phase += wander_s * normal();
            let stamp = phase + f64::from(n) / 15.0007 + scatter_s * normal();
            if random.random_bool(0.99) {
                truth.push(phase + f64::from(n) / 15.0007);
                stamps.push(stamp);
            }
        }
        (truth, stamps)
    }

    fn rms_s(a: &[f64], b: &[f64]) -> f64 {
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    }

    #[test]
    fn a_steady_cameras_frames_are_known_better_than_its_stamps_and_as_well_as_claimed() {
        let (mut squares, mut claimed) = (0.0, 0.0);
        for seed in 0..20 {
            let (truth, stamps) = camera(1e-3, 0.0, seed);
            let found = pace(&stamps);
            // The median of 594 steps, of which neighbours share a stamp, tells their scatter to 5.4 % (2000 simulated cameras): five of that.
            assert!((0.73e-3..1.27e-3).contains(&found.jitter_s), "{}", found.jitter_s);
            let off = rms_s(&found.time_s, &truth);
            assert!(off < 0.3e-3, "seed {seed}: {off}");
            (squares, claimed) = (squares + off * off, claimed + found.std_s * found.std_s);
        }
        // A camera without any wander is known better than claimed, as some wander is always allowed for: by half the variance with
        // `LEAST_WANDER`. Of 100 times 20 simulated cameras the ratio was 0.55 +- 0.04: five of that.
        assert!((0.35..0.75).contains(&(squares / claimed)), "squared error over variance {}", squares / claimed);
    }

    #[test]
    fn a_camera_that_wanders_keeps_its_stamps() {
        for seed in 0..10 {
            let (truth, stamps) = camera(0.1e-3, 2e-3, seed);
            let found = pace(&stamps);
            // The stamps' own 0.1 ms, of 594 samples to 3 %. The claim is the difference of two scatters of 2 ms, of which some thirty
            // independent far steps tell one: 1.05 ms was exceeded by one in a hundred simulated cameras, 1.3 ms by none of 2000.
            let off = rms_s(&found.time_s, &truth);
            assert!(off < 0.115e-3 && found.std_s < 1.3e-3, "{off} {}", found.std_s);
        }
    }

    #[test]
    fn a_late_stamp_is_put_right() {
        let (truth, mut stamps) = camera(0.3e-3, 0.0, 3);
        stamps[200] += 0.02;
        let found = pace(&stamps);
        assert!((found.time_s[200] - truth[200]).abs() < 0.2e-3, "{}", found.time_s[200] - truth[200]);
        assert!(found.time_s.windows(2).all(|w| w[1] > w[0]));
    }

    #[test]
    fn stamps_that_are_late_by_intervals_move_no_other_frame() {
        for late_frames in [0.5, 0.9, 1.5, 2.5, 3.0] {
            for at in [3, 45, 300, 550, 590] {
                let (truth, mut stamps) = camera(0.3e-3, 0.0, 5);
                let until = stamps[at] + late_frames / 15.0;
                // What was held up is delivered in a burst.
                let mut delivered = until;
                for stamp in stamps.iter_mut().skip(at).take_while(|stamp| **stamp < until) {
                    *stamp = delivered;
                    delivered += 1e-3;
                }
                stamps.sort_by(f64::total_cmp);
                let found = pace(&stamps);
                let worst = found.time_s.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-3, "late by {late_frames} frames from {at} on: {worst}");
            }
        }
    }

    #[test]
    fn frames_at_another_rate_keep_their_stamps() {
        let mut random = ChaCha8Rng::seed_from_u64(6);
        for slow in [0..100, 850..950, 1700..1800] {
            let (mut truth, mut at) = (Vec::new(), 0.0);
            for n in 0..1800 {
                at += if slow.contains(&n) { 1.0 / 20.0 } else { 1.0 / 30.0 };
                truth.push(at);
            }
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let stamps: Vec<f64> = truth.iter().map(|t| t + 0.3e-3 * normal()).collect();
            let found = pace(&stamps);
            let worst = found.time_s.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst < 2e-3, "slow in {slow:?}: {worst}");
        }
    }

    #[test]
    fn few_stamps_and_long_gaps_are_no_trouble() {
        assert_eq!(pace(&[]).time_s, Vec::<f64>::new());
        assert_eq!(pace(&[1.0, 1.1]).time_s, [1.0, 1.1]);
        let (_, stamps) = camera(0.5e-3, 0.0, 4);
        let gap: Vec<f64> =
            stamps.iter().copied().filter(|t| !(10.0..25.37).contains(t)).map(|t| if t > 20.0 { t + 0.021 } else { t }).collect();
        let found = pace(&gap);
        assert!(rms_s(&found.time_s, &gap) < 0.7e-3, "{}", rms_s(&found.time_s, &gap));
        // Exact stamps stay exact.
        let exact: Vec<f64> = (0..100).map(|n| f64::from(n) * 0.0625).collect();
        assert_eq!(pace(&exact), Pace { time_s: exact.clone(), std_s: 0.0, jitter_s: 0.0 });
    }
}
