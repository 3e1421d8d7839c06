//! A recording as the hypotheses see it: tips, and drives with their torque.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use raven::Result;
use raven::camera::Cameras;
use raven::effects::{Command, Shaft, Sight};
use raven::log::Recording;
use raven::observation::three_joints;
use raven::robot::{MotorTrack, PAUSE_MAX_S};

/// Window of the motors' smoothing [s]: a quadratic through it has the acceleration to 1 rad/s^2 beside encoder counts, and follows 4 Hz.
pub const WINDOW_S: f64 = 0.07;
/// Time between the motor samples that drive the links [s], and those without inertia.
const MOTORS_S: f64 = 0.002;
const MOTORS_AT_REST_S: f64 = 0.008;
/// Most tips of a recording that are looked at: a tracker may see a hundred a second, and neighbours share what no model explains.
const SIGHTS_MAX: usize = 3000;
/// Period of the robot's controller [s]. A drive is half of it late: 0.5 ms of a fast motion are 1 % of its inertia's torque.
const CONTROL_S: f64 = 1e-3;
/// Time between two torque samples [s].
pub(crate) const STRIDE_S: f64 = 0.02;

/// An encoder that turns so far [rad] from one sample to the next beyond twice what it does elsewhere in a window has miscounted: no motor
/// starts as fast, and its torque did not do it.
const JUMP_RAD: f64 = 0.3;
/// Samples of a window in which one is looked for where all of a track is.
const JUMP_SAMPLES: usize = 20;

/// What one recording offers.
pub struct Data {
    /// Motors.
    pub motors: MotorTrack,
    /// The same as links without inertia need them: of fewer samples.
    pub motors_at_rest: MotorTrack,
    /// Tips that were seen; of more than some thousand, evenly spaced ones.
    pub sights: Vec<Sight>,
    /// Drives; empty without torque.
    pub shafts: Vec<Shaft>,
}

impl Data {
    /// Of a recording; `cameras` tell at which row an image shows the tip.
    ///
    /// # Errors
    /// If the log has no motor angles of three joints.
    pub fn new(recording: &Recording, cameras: Option<&Cameras>) -> Result<Self> {
        let motors = recording.motor_track()?;
        let sights = recording.seen_tips().map(|tip| Sight {
            stamp_s: tip.stamp.seconds_since(recording.start),
            position_m: tip.position_m,
            covariance_m2: tip.covariance_m2,
            rows: cameras.map_or([0.0; 2], |c| {
                let row =
                    |pixel: [f64; 2], height: u32| if pixel[1].is_finite() { (pixel[1] + 0.5) / f64::from(height) - 0.5 } else { 0.0 };
                [row(tip.left_px, c.left.height), row(tip.right_px, c.right.height)]
            }),
        });
        let finite = |sight: &Sight| sight.position_m.iter().chain(&sight.covariance_m2).all(|v| v.is_finite());
        let sights: Vec<Sight> = sights.filter(finite).collect();
        let stride = sights.len().div_ceil(SIGHTS_MAX).max(1);
        let sights = sights.into_iter().step_by(stride).collect();
        let shafts = match recording.require_motor()?.effort.as_ref() {
            Some(effort) if effort.len() >= 3 => {
                let series = recording.require_motor()?;
                three_joints(series, recording)?;
                let torque = (0..series.len()).map(|k| Vector3::from_fn(|j, _| effort[j][k])).collect::<Vec<_>>();
                shafts(&motors, &torque)
            }
            _ => Vec::new(),
        };
        Ok(Self::of(&motors, sights, shafts))
    }

    /// Without tips of which nobody says how well they are known: they weigh nothing.
    #[must_use]
    pub fn weighed(mut self) -> Self {
        self.sights.retain(|sight| sight.covariance_m2.cholesky().is_some());
        self
    }

    /// Of motors as they were recorded.
    pub(super) fn of(motors: &MotorTrack, sights: Vec<Sight>, shafts: Vec<Shaft>) -> Self {
        let [motors, motors_at_rest] = [MOTORS_S, MOTORS_AT_REST_S].map(|apart_s| motors.thinned(apart_s));
        Self { motors, motors_at_rest, sights, shafts }
    }
}

/// Motors smoothed by a local quadratic, with the torque of the same window.
fn shafts(motors: &MotorTrack, commanded: &[Vector3<f64>]) -> Vec<Shaft> {
    motors.times_every(STRIDE_S).filter_map(|time_s| shaft(motors, commanded, CONTROL_S, time_s)).collect()
}

/// Motors at one time, smoothed, and their torque, which is logged as it is asked for and then held for `held_s`; `None` where samples are
/// missing, an encoder jumps or there are fewer than five samples in the window.
pub(super) fn shaft(motors: &MotorTrack, torque: &[Vector3<f64>], held_s: f64, time_s: f64) -> Option<Shaft> {
    let half_s = 0.5 * WINDOW_S;
    let (start_s, end_s) = (*motors.time_s.first()?, *motors.time_s.last()?);
    if time_s - half_s < start_s || time_s + half_s > end_s {
        return None;
    }
    let from = motors.time_s.partition_point(|&t| t < time_s - half_s);
    let to = motors.time_s.partition_point(|&t| t <= time_s + half_s);
    let times = motors.time_s.get(from..to)?;
    let whole = times.len() >= 5 && times.windows(2).all(|pair| pair[1] - pair[0] <= PAUSE_MAX_S.min(half_s));
    let before = |k: usize| k.saturating_sub(1);
    if !whole || jumps(&motors.angle[from..to]) || torque[before(from)..to].iter().any(|t| !t.iter().all(|v| v.is_finite())) {
        return None;
    }
    // Least squares with weights (1 - (t / h)^2)^k, h half the window, find as the n-th derivative its mean with the power k + n. Torque,
    // velocity and acceleration are means with the same power, or a fast motion looks as if it took another friction or inertia.
    let (mut parabola, mut of_parabola) = (Matrix3::zeros(), Matrix3::zeros());
    let (mut line, mut of_line) = (Matrix2::zeros(), Matrix2x3::zeros());
    let mut commanded = Vec::with_capacity(2 * times.len());
    for k in from..to {
        let (t, angle) = (motors.time_s[k] - time_s, &motors.angle[k]);
        let weight = (1.0 - (t / half_s).powi(2)).max(0.0);
        let row = Vector3::new(1.0, t, 0.5 * t * t);
        parabola += row * row.transpose() * weight;
        of_parabola += row * angle.transpose() * weight;
        let row = Vector2::new(1.0, t);
        line += row * row.transpose() * weight.powi(2);
        of_line += row * angle.transpose() * weight.powi(2);
        let weight = Shaft::weight(t / half_s);
        // Half of what acts about a sample's time while it is held is what was asked for before, or itself where it is the first.
        let earlier = (0.5 * held_s / (motors.time_s[k] - motors.time_s[before(k)])).min(0.5);
        commanded.extend([(torque[k], weight * (1.0 - earlier)), (torque[before(k)], weight * earlier)]);
    }
    let (parabola, line) = (parabola.try_inverse()? * of_parabola, line.try_inverse()? * of_line);
    Some(Shaft {
        time_s,
        angle: parabola.row(0).transpose(),
        rate: line.row(1).transpose(),
        acceleration: parabola.row(2).transpose(),
        commanded: Command::of(&commanded),
        window_s: WINDOW_S,
    })
}

/// Whether any of the motors turns much farther between two samples than between any others.
fn jumps(angle: &[Vector3<f64>]) -> bool {
    (0..3).any(|j| jump(angle, j).is_some())
}

/// The sample before which a motor turns much farther than between any others, if any.
fn jump(angle: &[Vector3<f64>], j: usize) -> Option<usize> {
    let [mut largest, mut second] = [0.0_f64; 2];
    let mut at = 0;
    for (k, turned) in angle.windows(2).map(|pair| (pair[1][j] - pair[0][j]).abs()).enumerate() {
        second = second.max(turned.min(largest));
        if turned > largest {
            (largest, at) = (turned, k + 1);
        }
    }
    (largest > JUMP_RAD + 2.0 * second).then_some(at)
}

/// When an encoder miscounts, as parts of a track: the middle between the samples, the farthest jumps of so many at most first.
pub(super) fn miscounts(motors: &MotorTrack, j: usize, most: usize) -> Vec<f64> {
    let (Some(first_s), Some(last_s)) = (motors.time_s.first(), motors.time_s.last()) else { return Vec::new() };
    let far = |k: usize| (motors.angle[k][j] - motors.angle[k - 1][j]).abs();
    // Of a window that jumps in its middle, so that each jump is found once.
    let middle = |(from, angle): (usize, &[Vector3<f64>])| (jump(angle, j)? == JUMP_SAMPLES / 2).then_some(from + JUMP_SAMPLES / 2);
    let mut at: Vec<usize> = motors.angle.windows(JUMP_SAMPLES).enumerate().filter_map(middle).collect();
    at.sort_by(|&a, &b| far(b).total_cmp(&far(a)));
    at.truncate(most);
    at.into_iter().map(|k| (0.5 * (motors.time_s[k - 1] + motors.time_s[k]) - first_s) / (last_s - first_s)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest error of the torque that a motor's inertia and friction take, of its largest, in motion of 4 Hz under commands that are held
    /// for a millisecond and logged every so many.
    fn error_of_torque(logged_every: usize) -> f64 {
        const INERTIA: f64 = 3e-4;
        const VISCOUS: f64 = 2e-3;
        let (w, v) = (std::f64::consts::TAU * 4.0, std::f64::consts::TAU * 1.3);
        let angle = |t: f64| 4.0 * (w * t).sin() + 9.0 * (v * t).cos();
        let torque = |t: f64| {
            let rate = 4.0 * w * (w * t).cos() - 9.0 * v * (v * t).sin();
            INERTIA * (-4.0 * w * w * (w * t).sin() - 9.0 * v * v * (v * t).cos()) + VISCOUS * rate
        };
        let time_s: Vec<f64> = (0..2000).step_by(logged_every).map(|k| 1e-3 * k as f64).collect();
        let motors = MotorTrack { angle: time_s.iter().map(|&t| Vector3::repeat(angle(t))).collect(), time_s };
        let commanded: Vec<Vector3<f64>> = motors.time_s.iter().map(|t| Vector3::repeat(torque(t + 0.5e-3))).collect();
        let shafts = shafts(&motors, &commanded);
        let of = |f: &dyn Fn(&Shaft) -> f64| shafts.iter().map(|shaft| f(shaft).abs()).fold(0.0, f64::max);
        assert!(shafts.len() > 80);
        of(&|s| s.commanded.mean()[0] - INERTIA * s.acceleration[0] - VISCOUS * s.rate[0]) / of(&|s| s.commanded.mean()[0])
    }

    #[test]
    fn torque_motion_and_commands_that_are_held_agree() {
        let errors = [1, 5].map(error_of_torque);
        assert!(errors[0] < 2e-4 && errors[1] < 3e-3, "{errors:?}");
    }

    #[test]
    fn a_miscount_jumps_and_a_fast_start_does_not() {
        let starting = |rad_s2: f64, step_s: f64| {
            let angle = |k: usize| Vector3::new(0.5 * rad_s2 * ((k as f64 - 10.0).max(0.0) * step_s).powi(2), 0.0, 0.0);
            (0..30).map(angle).collect::<Vec<_>>()
        };
        assert!(!jumps(&starting(2e4, 1e-3)) && !jumps(&starting(2e4, 2e-3)));
        let mut miscounted = starting(2e3, 1e-3);
        miscounted[20..].iter_mut().for_each(|angle| angle[0] -= 0.8);
        assert!(jumps(&miscounted));
    }

    #[test]
    fn miscounts_are_found_where_they_are() {
        let time_s: Vec<f64> = (0..1001).map(|k| 2e-3 * f64::from(k)).collect();
        let read = |&t: &f64| {
            let miscounted = if t > 0.5 { 0.9 } else { 0.0 } - if t > 1.2 { 2.0 } else { 0.0 };
            Vector3::new(10.0 * (6.0 * t).sin(), 20.0 * (5.0 * t).cos() + miscounted, 0.0)
        };
        let motors = MotorTrack { angle: time_s.iter().map(read).collect(), time_s };
        let found = miscounts(&motors, 1, 5);
        assert_eq!(found.len(), 2, "{found:?}");
        for (found, at) in found.iter().zip([0.6005, 0.2505]) {
            assert!((found - at).abs() < 1e-9, "{found:?}");
        }
        assert_eq!(miscounts(&motors, 1, 1).len(), 1);
        assert!(miscounts(&motors, 0, 5).is_empty() && miscounts(&MotorTrack::default(), 0, 5).is_empty());
    }
}
