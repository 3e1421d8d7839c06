//! The robot model over a recorded motion: where the joints are, by the parameter file in hand, when the motors move as they did.

use nalgebra::Vector3;

use super::link_model::Shared;
use super::stiction::has_play;
use super::{LinkModel, LinkState};

/// Motor angles over time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotorTrack {
    /// [s], strictly increasing.
    pub time_s: Vec<f64>,
    /// [rad].
    pub angle: Vec<Vector3<f64>>,
}

/// How motors move at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyMotion {
    /// [rad].
    pub angle: Vector3<f64>,
    /// [rad/s].
    pub rate: Vector3<f64>,
    /// [rad/s^2].
    pub acceleration: Vector3<f64>,
}

/// Longest pause between motor samples that is bridged [s]; beyond it whatever follows the motion starts anew.
pub const PAUSE_MAX_S: f64 = 0.5;

/// Half of the window over which a motor's motion is steady [s]: a count of the encoder is then 1e-3 of the slowest speed that matters.
pub const HALF_WINDOW_S: f64 = 0.02;

/// Samples next to where one would be that are looked at first.
const NEAR: usize = 8;

impl MotorTrack {
    /// Times within the track that are `stride_s` apart as counted from its start, but for those in pauses: as many as there are samples to
    /// stand for, however far off a stamp is.
    pub fn times_every(&self, stride_s: f64) -> impl Iterator<Item = f64> + '_ {
        let start_s = self.time_s.first().copied().unwrap_or(0.0);
        let strides = move |time_s: f64| ((time_s - start_s) / stride_s).floor() as u64;
        let joined = self.time_s.windows(2).filter(|pair| pair[1] - pair[0] <= PAUSE_MAX_S);
        joined.flat_map(move |pair| strides(pair[0]) + 1..=strides(pair[1])).map(move |k| start_s + k as f64 * stride_s)
    }

    /// Samples at least so far apart, less a tenth for stamps that come early, and the last one.
    #[must_use]
    pub fn thinned(&self, apart_s: f64) -> Self {
        let mut thin = Self::default();
        for (k, (&time_s, angle)) in self.time_s.iter().zip(&self.angle).enumerate() {
            let due = thin.time_s.last().is_none_or(|last| time_s - last > 0.9 * apart_s);
            if due || k + 1 == self.time_s.len() {
                thin.time_s.push(time_s);
                thin.angle.push(*angle);
            }
        }
        thin
    }

    /// The sample interval that holds `time_s`: index of its start; `None` outside the track and in pauses.
    #[must_use]
    pub fn interval(&self, time_s: f64) -> Option<usize> {
        let after = self.samples_until(time_s);
        let start = after.min(self.time_s.len().checked_sub(1)?).checked_sub(1)?;
        let inside = time_s >= self.time_s[start] && time_s <= self.time_s[start + 1];
        (inside && self.time_s[start + 1] - self.time_s[start] <= PAUSE_MAX_S).then_some(start)
    }

    /// How many samples there are up to a time. Samples come evenly as a rule: it is looked for from where it would then be.
    #[must_use]
    pub fn samples_until(&self, time_s: f64) -> usize {
        let is_until = |&t: &f64| t <= time_s;
        let all = self.time_s.as_slice();
        let &[first_s, .., last_s] = all else { return all.partition_point(is_until) };
        let guess = ((time_s - first_s) / (last_s - first_s) * (all.len() - 1) as f64) as usize;
        let mut until = guess.saturating_add(1).min(all.len());
        for _ in 0..NEAR {
            if all.get(until).is_some_and(is_until) {
                until += 1;
            } else if !is_until(&all[until - 1]) {
                until -= 1;
                if until == 0 {
                    break;
                }
            } else {
                return until;
            }
        }
        all.partition_point(is_until)
    }

    /// Angle [rad] and velocity [rad/s] at a time; `None` outside the track and in pauses.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let k = self.interval(time_s)?;
        let rate = self.rate(k);
        Some((self.angle[k] + rate * (time_s - self.time_s[k]), rate))
    }

    /// Motion over 20 ms on either side of a time, where an encoder's steps do not count; at the ends and beside pauses that of the interval.
    /// `None` outside the track and in pauses.
    #[must_use]
    pub fn steady(&self, time_s: f64) -> Option<SteadyMotion> {
        let (angle, rate) = self.at(time_s)?;
        let ends = [self.at(time_s - HALF_WINDOW_S), self.at(time_s + HALF_WINDOW_S)];
        let [Some((before, _)), Some((after, _))] = ends else {
            return Some(SteadyMotion { angle, rate, acceleration: Vector3::zeros() });
        };
        let acceleration = (after - 2.0 * angle + before) / HALF_WINDOW_S.powi(2);
        Some(SteadyMotion { angle, rate: (after - before) / (2.0 * HALF_WINDOW_S), acceleration })
    }

    /// First sample of the stretch without pauses that holds interval `k`.
    fn segment_start(&self, k: usize) -> usize {
        (1..=k).rev().find(|&i| self.time_s[i] - self.time_s[i - 1] > PAUSE_MAX_S).unwrap_or(0)
    }

    /// Motion at sample `k`, with which a stretch without pauses begins: on the parabola through what it comes to after 20 ms and twice that; at
    /// rest where it is shorter.
    fn first(&self, k: usize) -> SteadyMotion {
        let angle = self.angle[k];
        let [after, later] = [1.0, 2.0].map(|h| self.at(self.time_s[k] + h * HALF_WINDOW_S).map(|(angle, _)| angle - self.angle[k]));
        let (Some(after), Some(later)) = (after, later) else {
            return SteadyMotion { angle, rate: Vector3::zeros(), acceleration: Vector3::zeros() };
        };
        let rate = (4.0 * after - later) / (2.0 * HALF_WINDOW_S);
        SteadyMotion { angle, rate, acceleration: (later - 2.0 * after) / HALF_WINDOW_S.powi(2) }
    }

    fn rate(&self, k: usize) -> Vector3<f64> {
        (self.angle[k + 1] - self.angle[k]) / (self.time_s[k + 1] - self.time_s[k])
    }
}

impl LinkModel {
    /// The links at `to_s`, the motors following `motor` from `from_s` on; `None` if that leaves the track or crosses a pause in it.
    #[must_use]
    pub fn follow(&self, mut state: LinkState, motor: &MotorTrack, from_s: f64, to_s: f64) -> Option<LinkState> {
        let (first, last) = (motor.interval(from_s)?, motor.interval(to_s)?);
        if (first..last).any(|k| motor.time_s[k + 1] - motor.time_s[k] > PAUSE_MAX_S) {
            return None;
        }
        let mut at = from_s;
        for k in first..=last {
            let end = if k < last { motor.time_s[k + 1] } else { to_s };
            if end > at {
                let rate = motor.rate(k);
                state = self.advance(state, &(motor.angle[k] + rate * (at - motor.time_s[k])), &rate, end - at);
                at = end;
            }
        }
        Some(state)
    }

    /// Link states at `times_s` (sorted), the motors following `driving`, behind the play of friction that holds; `None` at times outside the
    /// track and in its pauses.
    ///
    /// They start as the file has them, and after each pause where the cables hold them; in a motion, if that has begun.
    #[must_use]
    pub fn rollout(&self, driving: &MotorTrack, times_s: &[f64]) -> Vec<Option<LinkState>> {
        self.rolled(driving, times_s, false, true)
    }

    /// As [`Self::rollout`] over a part of a recording: only one that `begins` it starts as the file has it.
    #[must_use]
    pub fn rollout_of_part(&self, driving: &MotorTrack, times_s: &[f64], begins: bool) -> Vec<Option<LinkState>> {
        self.rolled(driving, times_s, false, begins)
    }

    /// As [`Self::rollout`], with motors as they wind the cables: friction that holds grips the joints, at first where the file has it.
    #[must_use]
    pub fn rollout_gripped(&self, winding: &MotorTrack, times_s: &[f64]) -> Vec<Option<LinkState>> {
        self.rolled(winding, times_s, has_play(self.arm()), true)
    }

    fn rolled(&self, motor: &MotorTrack, times_s: &[f64], gripped: bool, begins: bool) -> Vec<Option<LinkState>> {
        let mut rolling: Option<Rolling> = None;
        let state_at = |&time_s: &f64| {
            let interval = motor.interval(time_s)?;
            let goes_on = |rolling: &Rolling| (rolling.interval..interval).all(|k| motor.time_s[k + 1] - motor.time_s[k] <= PAUSE_MAX_S);
            let mut now = rolling.take().filter(goes_on).unwrap_or_else(|| {
                let start = motor.segment_start(interval);
                Rolling::from(start, motor.time_s[start], self.starting(&motor.first(start), begins && start == 0, gripped))
            });
            while now.end_s() < time_s {
                now.go_on(self, motor);
            }
            let state = now.at(time_s);
            rolling = Some(now);
            state
        };
        times_s.iter().map(state_at).collect()
    }
}

/// A rollout between two samples of the motors, whatever times are asked about.
struct Rolling {
    /// The sample that it goes on from.
    interval: usize,
    /// Where the links were at the sample before and every four milliseconds at most since, at times [s]; the last is at the one it goes on from.
    path: Vec<(f64, LinkState)>,
    shared: Shared,
}

impl Rolling {
    fn from(interval: usize, time_s: f64, state: LinkState) -> Self {
        Self { interval, path: vec![(time_s, state)], shared: Shared::over(f64::INFINITY) }
    }

    fn end_s(&self) -> f64 {
        self.path.last().map_or(f64::INFINITY, |(time_s, _)| *time_s)
    }

    fn go_on(&mut self, links: &LinkModel, motor: &MotorTrack) {
        let Self { interval, path, shared } = self;
        let Some((_, state)) = path.pop() else { return };
        let (start_s, end_s) = (motor.time_s[*interval], motor.time_s[*interval + 1]);
        links.advance_along(&state, &motor.angle[*interval], &motor.rate(*interval), end_s - start_s, shared, |since_s, state| {
            if since_s == 0.0 {
                path.clear();
            }
            path.push((start_s + since_s, *state));
        });
        if let Some((time_s, _)) = path.last_mut() {
            *time_s = end_s;
        }
        *interval += 1;
    }

    /// On the cubic through positions and rates about a time.
    fn at(&self, time_s: f64) -> Option<LinkState> {
        let after = self.path.partition_point(|(at_s, _)| *at_s < time_s);
        let &(to_s, to) = self.path.get(after)?;
        let Some(&(from_s, from)) = after.checked_sub(1).and_then(|before| self.path.get(before)) else { return Some(to) };
        let length_s = to_s - from_s;
        let (u, moved) = ((time_s - from_s) / length_s, to.position - from.position);
        let (a, b) = (from.rate * length_s - moved, to.rate * length_s - moved);
        let position = from.position + (moved + (a * (1.0 - u) - b * u) * (1.0 - u)) * u;
        let rate = (moved + a * ((1.0 - u) * (1.0 - 3.0 * u)) + b * (u * (3.0 * u - 2.0))) / length_s;
        Some(LinkState { position, rate, ..to })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::nominal;

    /// The elbow of an arm that rubs and holds, driven up and down.
    fn driven() -> (LinkModel, MotorTrack) {
        let mut arm = nominal::gold().arm().unwrap();
        arm.link_friction[1].held_part = 0.5;
        let time_s: Vec<f64> = (0..2000).map(|k| f64::from(k) * 2e-3).collect();
        let wanted = |t: f64| Vector3::new(0.8, 1.5 + 0.3 * (t * 3.0).sin(), 0.35);
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&wanted(t))).collect(), time_s };
        (LinkModel::new(arm), motor)
    }

    #[test]
    fn links_take_the_same_path_whatever_times_are_asked_about() {
        let (links, motor) = driven();
        let often: Vec<f64> = (1..3900).map(|k| 1e-3 * f64::from(k) + 0.3e-3).collect();
        let seldom: Vec<f64> = often.iter().copied().step_by(37).collect();
        let path = links.rollout_gripped(&motor, &often);
        let same: Vec<_> = path.into_iter().step_by(37).collect();
        assert!(same.iter().all(Option::is_some));
        assert_eq!(links.rollout_gripped(&motor, &seldom), same);
    }

    #[test]
    fn between_motor_samples_links_are_where_shorter_steps_bring_them() {
        let (links, motor) = driven();
        let times: Vec<f64> = (1..3900).map(|k| 1e-3 * f64::from(k) + 0.3e-3).collect();
        let mut followed = links.starting(&motor.first(0), true, true);
        let mut before_s = 0.0;
        let misses: Vec<f64> = (links.rollout_gripped(&motor, &times).iter().zip(&times))
            .map(|(rolled, &time_s)| {
                followed = links.follow(followed, &motor, before_s, time_s).unwrap();
                before_s = time_s;
                rolled.unwrap().position[1] - followed.position[1]
            })
            .collect();
        let count = std::f64::consts::TAU / 4000.0 / links.arm().transmission.ratio[1];
        let worst = misses.iter().fold(0.0_f64, |worst, miss| worst.max(miss.abs())) / count;
        let rms = crate::stats::rms(&misses).unwrap() / count;
        assert!(worst < 0.02 && rms < 0.002, "{worst} and {rms} of an encoder's count");
    }

    #[test]
    fn links_that_are_first_seen_in_a_motion_are_as_if_they_had_been_seen_before() {
        let (links, motor) = driven();
        let elbow_n = |motor: &MotorTrack, state: &LinkState, time_s: f64| {
            let (angle, rate) = motor.at(time_s).unwrap();
            let transmission = &links.arm().transmission;
            let (stretch, stretch_rate) =
                (transmission.stretch_m(&angle, &state.position), transmission.stretch_rate_m_s(&rate, &state.rate));
            links.arm().cables[1].force(stretch[1], stretch_rate[1])
        };
        // Near the middle, up and down, and where the elbow is slowed down most while it moves.
        for first in [1050, 1570, 1200] {
            let seen = MotorTrack { time_s: motor.time_s[first..].to_vec(), angle: motor.angle[first..].to_vec() };
            let times: Vec<f64> = (1..50).map(|k| motor.time_s[first] + 1e-3 * f64::from(k)).collect();
            let tension_n = |motor: &MotorTrack| {
                let states = links.rollout_gripped(motor, &times);
                states.iter().zip(&times).map(|(state, &time_s)| elbow_n(motor, &state.unwrap(), time_s)).collect::<Vec<_>>()
            };
            let (before, now) = (tension_n(&motor), tension_n(&seen));
            let off: Vec<f64> = before.iter().zip(&now).map(|(before, now)| before - now).collect();
            let dry_n = links.arm().link_friction[1].coulomb / links.arm().transmission.link_radius_m[1];
            let rms_n = crate::stats::rms(&off).unwrap();
            assert!(rms_n < 0.02 * dry_n, "from sample {first} on {rms_n} N of a dry friction of {dry_n} N");
        }
    }

    #[test]
    fn intervals_are_found_where_samples_jitter_and_where_they_pause() {
        let mut time_s: Vec<f64> = (0..3000).map(|k| 1e-3 * (f64::from(k) + 0.4 * f64::from(k % 7) / 7.0)).collect();
        time_s.extend((0..50).map(|k| 3.3 + 5e-3 * f64::from(k)));
        let track = MotorTrack { angle: vec![Vector3::zeros(); time_s.len()], time_s };
        for k in 0..8000 {
            let time_s = -0.1 + 5e-4 * f64::from(k);
            let plain = track.time_s.windows(2).rposition(|pair| pair[0] <= time_s && time_s <= pair[1]);
            let of_last = (Some(&time_s) == track.time_s.last()).then(|| track.time_s.len() - 2);
            assert_eq!(track.interval(time_s), plain.or(of_last), "{time_s}");
        }
        assert_eq!(track.interval(f64::NAN), None);
        assert_eq!(MotorTrack::default().interval(0.0), None);
    }

    #[test]
    fn thinned_samples_are_as_far_apart_as_they_should_be_and_reach_as_far() {
        let time_s: Vec<f64> = (0..1000).map(|k| 1e-3 * (f64::from(k) + 0.3 * f64::from(k % 7) / 7.0)).collect();
        let angle = time_s.iter().map(|&t| Vector3::repeat(t)).collect();
        let all = MotorTrack { angle, time_s };
        let thin = all.thinned(4e-3);
        assert_eq!([thin.time_s.first(), thin.time_s.last()], [all.time_s.first(), all.time_s.last()]);
        assert!((245..=255).contains(&thin.time_s.len()), "{}", thin.time_s.len());
        let apart: Vec<f64> = thin.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(apart[..apart.len() - 1].iter().all(|apart| (3.6e-3..5e-3).contains(apart)), "{apart:?}");
        assert!(thin.time_s.iter().zip(&thin.angle).all(|(&time_s, angle)| *angle == Vector3::repeat(time_s)));
        assert_eq!(MotorTrack::default().thinned(4e-3), MotorTrack::default());
    }

    #[test]
    fn strides_stop_where_samples_do() {
        // A tenth of a second of samples, fifty years later another.
        let far_s = 1.6e9;
        let time_s: Vec<f64> = (0..=100).map(|i| 1e-3 * f64::from(i)).chain((0..=100).map(|i| far_s + 1e-3 * f64::from(i))).collect();
        let track = MotorTrack { angle: vec![Vector3::zeros(); time_s.len()], time_s };
        let times: Vec<f64> = track.times_every(0.02).collect();
        assert!((9..=11).contains(&times.len()), "{}", times.len());
        assert!(times[..5].iter().enumerate().all(|(k, t)| (t - 0.02 * (k + 1) as f64).abs() < 1e-12), "{times:?}");
        assert!(times[5..].iter().all(|t| (far_s..far_s + 0.101).contains(t)), "{times:?}");
    }
}
