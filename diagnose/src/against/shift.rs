//! The clock of a simulation against that of a recording: the shift under which the motors' paths are the same.
//!
//! ```text
//! c_j(d) = 2 cov(a_j(t), b_j(t - d)) / (var a_j + var b_j),   d = argmax min_j  -n/2 sign(c_j) ln(1 - c_j^2)
//! ```
//!
//! `c` is Lin's concordance (1989) but for the means, which an encoder's zero shifts: 1 only where two paths have the same size as well as
//! the same shape. What follows is the information that one path has of the other at the joint where they agree least: joints that swing agree
//! under many a shift, and together under one. Of shifts that do equally well the one with the longest overlap wins.

use raven::log::JointSeries;
use raven::robot::Robot;

use crate::attribution;

/// Shortest time in which both have to have moved [s].
const OVERLAP_MIN_S: f64 = 5.0;
/// Least concordance of a joint that moves: the paths then differ by a fifth of their spread.
const AGREEMENT_MIN: f64 = 0.98;
/// Step of the search [s], and most samples of either path in it.
const STEP_S: f64 = 0.04;
const SAMPLES_MAX: f64 = 4096.0;
/// Best peaks of the search that are looked at more closely: between two steps of it the true one may look like another.
const REFINED: usize = 8;
/// The shift is found to this [s].
const RESOLUTION_S: f64 = 1e-6;
/// What is left of a disagreement in double precision.
const ROUNDING: f64 = 1e-12;

/// How a simulation's clock is set by a recording's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shift {
    /// Time since the recording's start less time since the simulation's [s].
    pub shift_s: f64,
    /// Smallest concordance of a joint that moves.
    pub agreement: f64,
    /// Time that both cover [s].
    pub overlap_s: f64,
}

/// Finds the shift; else says why there is none.
pub(super) fn shift(robot: &Robot, real: &JointSeries, simulated: &JointSeries) -> Result<Shift, String> {
    let span = |series: &JointSeries| series.time_s.first().copied().zip(series.time_s.last().copied()).unwrap_or_default();
    let (of_real, of_simulated) = (span(real), span(simulated));
    let longest_s = (of_real.1 - of_real.0).max(of_simulated.1 - of_simulated.0);
    let shortest_s = (of_real.1 - of_real.0).min(of_simulated.1 - of_simulated.0);
    if shortest_s < OVERLAP_MIN_S {
        return Err(format!("one of them lasts {shortest_s:.1} s, and {OVERLAP_MIN_S} s are needed to lay one over the other"));
    }
    let moving: Vec<usize> = (0..robot.joints.len().min(3)).filter(|&j| moves(robot, real, j) || moves(robot, simulated, j)).collect();
    if moving.is_empty() {
        return Err("no motor moves in either, and there is nothing to lay one over the other by".to_owned());
    }
    let step_s = STEP_S.max(longest_s / SAMPLES_MAX);
    let [a, b] = [(real, of_real), (simulated, of_simulated)].map(|(series, span)| Path::of(series, &moving, span, step_s));
    let least = (OVERLAP_MIN_S / step_s).ceil() as isize;
    let lags = (least - b.count as isize)..=(a.count as isize - least);
    let information: Vec<(isize, f64)> = lags.map(|lag| (lag, a.information(&b, lag))).collect();
    let peaks = information.windows(3).filter(|w| w[1].1 >= w[0].1 && w[1].1 >= w[2].1).map(|w| w[1]);
    let ends = information.first().into_iter().chain(information.last()).copied();
    let mut peaks: Vec<(isize, f64)> = peaks.chain(ends).collect();
    peaks.sort_by(|x, y| y.1.total_cmp(&x.1));
    let told = |shift_s: &f64| Told::by(&a.sums(|j, t| simulated.interpolate(j, t - shift_s)));
    let refined = |(lag, _): &(isize, f64)| {
        let coarse_s = of_real.0 - of_simulated.0 + *lag as f64 * step_s;
        least_between(coarse_s - step_s, coarse_s + step_s, |shift_s| -told(&shift_s).information)
    };
    let shifts = peaks.iter().take(REFINED).map(refined);
    let best = shifts.map(|shift_s| (shift_s, told(&shift_s))).max_by(|x, y| x.1.information.total_cmp(&y.1.information));
    let Some((shift_s, Told { agreements, .. })) = best else { return Err("their motors' paths do not overlap".to_owned()) };
    let overlap_s = (of_real.1.min(of_simulated.1 + shift_s) - of_real.0.max(of_simulated.0 + shift_s)).max(0.0);
    let worst = agreements.iter().copied().zip(&moving).min_by(|x, y| x.0.total_cmp(&y.0));
    match worst {
        Some((agreement, _)) if agreement >= AGREEMENT_MIN => Ok(Shift { shift_s, agreement, overlap_s }),
        Some((agreement, &j)) => Err(format!(
            "their motors do not follow the same path: at the best shift of their clocks the {} agrees to {agreement:.3} (1 is the same \
             path), at least {AGREEMENT_MIN} is needed; drive the simulation with the recorded motion",
            robot.joints[j].name
        )),
        None => Err("their motors' paths do not overlap".to_owned()),
    }
}

fn moves(robot: &Robot, series: &JointSeries, j: usize) -> bool {
    let joint = &robot.joints[j];
    let finite = series.position.get(j).into_iter().flatten().copied().filter(|q| q.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(q), high.max(q)));
    attribution::moves(joint, (high - low) / joint.ratio().abs())
}

/// Motors at an even pace.
struct Path {
    joints: Vec<usize>,
    time_s: Vec<f64>,
    count: usize,
    /// By joint; NaN in pauses. Taken from the middle of the range, for sums of squares that keep their digits.
    angle: Vec<Vec<f64>>,
}

impl Path {
    fn of(series: &JointSeries, joints: &[usize], span: (f64, f64), step_s: f64) -> Self {
        let count = ((span.1 - span.0) / step_s).floor() as usize + 1;
        let time_s: Vec<f64> = (0..count).map(|k| span.0 + k as f64 * step_s).collect();
        let angle = |&j: &usize| -> Vec<f64> {
            let middle = raven::stats::median(series.position.get(j).map_or(&[], Vec::as_slice)).unwrap_or(0.0);
            time_s.iter().map(|&t| series.interpolate(j, t).map_or(f64::NAN, |q| q - middle)).collect()
        };
        let angle = joints.iter().map(angle).collect();
        Self { joints: joints.to_vec(), time_s, count, angle }
    }

    /// What the paths say of each other with `other` so many steps later [nat].
    fn information(&self, other: &Self, lag: isize) -> f64 {
        let from = lag.max(0);
        let to = (self.count as isize).min(other.count as isize + lag);
        let (mine, others) = (from as usize..to as usize, (from - lag) as usize..(to - lag) as usize);
        let of = |(a, b): (&Vec<f64>, &Vec<f64>)| Sums::of(a[mine.clone()].iter().copied().zip(b[others.clone()].iter().copied()));
        Told::by(&self.angle.iter().zip(&other.angle).map(of).collect::<Vec<_>>()).information
    }

    /// Sums of each joint with another path.
    fn sums(&self, other: impl Fn(usize, f64) -> Option<f64>) -> Vec<Sums> {
        let of = |(&j, angle): (&usize, &Vec<f64>)| {
            let reference = self.time_s.iter().find_map(|&t| other(j, t)).unwrap_or(0.0);
            let pairs = self.time_s.iter().zip(angle).map(|(&t, &a)| (a, other(j, t).map_or(f64::NAN, |b| b - reference)));
            Sums::of(pairs)
        };
        self.joints.iter().zip(&self.angle).map(of).collect()
    }
}

/// What two paths say of each other.
struct Told {
    /// At the joint where they agree least [nat]; one that moves the other way speaks against it.
    information: f64,
    /// Concordance of each joint.
    agreements: Vec<f64>,
}

impl Told {
    fn by(joints: &[Sums]) -> Self {
        let agreements: Vec<f64> = joints.iter().map(Sums::concordance).collect();
        let of = |(sums, c): (&Sums, &f64)| -0.5 * sums.count * c.signum() * (1.0 - c * c).max(ROUNDING).ln();
        Self { information: joints.iter().zip(&agreements).map(of).fold(f64::INFINITY, f64::min), agreements }
    }
}

/// Sums over pairs of finite numbers.
#[derive(Default)]
struct Sums {
    count: f64,
    a: f64,
    b: f64,
    squares: f64,
    products: f64,
}

impl Sums {
    fn of(pairs: impl Iterator<Item = (f64, f64)>) -> Self {
        pairs.filter(|(a, b)| a.is_finite() && b.is_finite()).fold(Self::default(), |s, (a, b)| Self {
            count: s.count + 1.0,
            a: s.a + a,
            b: s.b + b,
            squares: s.squares + a * a + b * b,
            products: s.products + a * b,
        })
    }

    fn concordance(&self) -> f64 {
        let spread = self.squares - (self.a * self.a + self.b * self.b) / self.count;
        let shared = 2.0 * (self.products - self.a * self.b / self.count);
        if self.count > 1.0 && spread > 0.0 { shared / spread } else { 0.0 }
    }
}

/// Where a function with one valley is least, by golden section.
fn least_between(mut low: f64, mut high: f64, of: impl Fn(f64) -> f64) -> f64 {
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut left, mut right) = (high - golden * (high - low), low + golden * (high - low));
    let (mut at_left, mut at_right) = (of(left), of(right));
    while high - low > RESOLUTION_S {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = high - golden * (high - low);
            at_left = of(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = low + golden * (high - low);
            at_right = of(right);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Motors of the gold arm on three swings, from `from_s` for `seconds`, with `gain` on the elbow.
    fn series(from_s: f64, seconds: f64, gain: f64) -> JointSeries {
        let robot = raven::robot::nominal::gold();
        let time_s: Vec<f64> = (0..(seconds * 500.0) as usize).map(|k| k as f64 / 500.0).collect();
        let swing = |j: usize| -> Vec<f64> {
            let size = robot.joints[j].ratio() * [0.3, 0.3, 0.05][j] * if j == 1 { gain } else { 1.0 };
            let at = |t: &f64| size * ((0.7 + 0.31 * j as f64) * (from_s + t)).sin() + 100.0 * j as f64;
            time_s.iter().map(at).collect()
        };
        JointSeries::new(vec![String::new(); 3], time_s.clone(), (0..3).map(swing).collect(), None)
    }

    #[test]
    fn a_shift_is_found_wherever_the_shorter_lies() {
        let robot = raven::robot::nominal::gold();
        let (long, cut, late) = (series(0.0, 60.0, 1.0), series(13.0217, 20.0, 1.0), series(40.5, 60.0, 1.0));
        for (real, simulated, expected_s, overlap_s) in
            [(&long, &cut, 13.0217, 20.0), (&cut, &long, -13.0217, 20.0), (&long, &late, 40.5, 19.5)]
        {
            let found = shift(&robot, real, simulated).unwrap();
            assert!((found.shift_s - expected_s).abs() < 1e-4, "{found:?}");
            assert!((found.overlap_s - overlap_s).abs() < 0.01 && found.agreement > 0.9999, "{found:?}");
        }
    }

    #[test]
    fn other_paths_are_refused_in_a_sentence() {
        let robot = raven::robot::nominal::gold();
        let real = series(0.0, 60.0, 1.0);
        let other = shift(&robot, &real, &series(0.0, 60.0, 1.5)).unwrap_err();
        assert!(other.contains("the elbow agrees to 0.9"), "{other}");
        assert!(shift(&robot, &real, &series(0.0, 3.0, 1.0)).unwrap_err().contains("lasts 3.0 s"));
        assert!(shift(&robot, &series(0.0, 60.0, -1.0), &real).unwrap_err().contains("do not follow the same path"));
    }
}
