//! What samples of torque weigh: how good a model of them is, near rest and where drives clip.

use nalgebra::Vector3;
use raven::effects::Shaft;
use raven::robot::stiction::stirred_s;
use raven::robot::{Arm, MotorTrack, Robot};

use super::data::{STRIDE_S, WINDOW_S};

/// What a model of rigid links and dry friction is good for, as part of the torque commanded [1].
pub(crate) const TORQUE_MODEL: f64 = 0.01;
/// Time over which its errors are alike [s].
pub(super) const TORQUE_ALIKE_S: f64 = 0.2;
/// Slowest motor at which the direction of its friction is beyond doubt [rad/s]; slower, the torque that a model asks for is arbitrary.
pub(crate) const CREEP_RAD_S: f64 = 1.0;

/// Part of a joint's dry friction that is not known near rest, however it holds, and how slow that is in speeds below which friction fades. In
/// slow motion of the virtual lab's elbow a twentieth to an eighth of it stays unexplained.
const NEAR_REST: f64 = 0.15;
pub(super) const SLOW: f64 = 10.0;

/// Friction at the start, in times what it should be, and the part of a recording that may pass until it no longer matters.
const MORE_FRICTION_AT_START: f64 = 2.0;
const SPARED: f64 = 0.1;

/// When links have come loose from where friction held them before a recording: nobody saw how they came there, or which way it held them.
#[derive(Debug, Clone)]
pub(super) struct Loose {
    /// All of those that the recording can spare the time for [s]. Of one that stays where it is for longer nothing is known but that.
    pub(super) links_s: f64,
    /// Each [s]: until then its friction may pull either way. Never, for one that stays where it is.
    joints_s: Vector3<f64>,
}

impl Loose {
    pub(super) fn new(arm: &Arm, motors: &MotorTrack) -> Self {
        let start_s = motors.time_s.first().copied().unwrap_or_default();
        let spared_s = start_s + SPARED * (motors.time_s.last().map_or(0.0, |end_s| end_s - start_s));
        let stirred = stirred_s(arm, motors, MORE_FRICTION_AT_START);
        Self {
            links_s: stirred.into_iter().flatten().filter(|&at_s| at_s < spared_s).fold(start_s, f64::max),
            joints_s: Vector3::from(stirred.map(|at_s| at_s.unwrap_or(f64::INFINITY))),
        }
    }
}

/// A whitened error of torque, larger by the part of its window in which the drive clips: of a command that is clipped the model does not say
/// how large it is, so the command has the density of all commands instead of that of the model's errors, which are `TORQUE_MODEL` of them.
pub(super) fn with_clipping(whitened: f64, clipped: f64) -> f64 {
    if clipped == 0.0 || whitened == 0.0 {
        return whitened;
    }
    let information = clipped * 2.0 * TORQUE_MODEL.recip().ln() * STRIDE_S / TORQUE_ALIKE_S;
    whitened.signum() * whitened.hypot(information.sqrt())
}

/// What turns torques as delivered into torques as commanded, per joint: the ratio of their rms over samples that count. What was recorded
/// is the command; an error of the torque delivered would vanish in drives that deliver nothing.
pub(super) fn commanded_per_delivered(
    samples: impl Iterator<Item = (Vector3<f64>, Vector3<f64>)>,
    weights: &[Vector3<f64>],
) -> Vector3<f64> {
    let (mut commanded, mut delivered) = (Vector3::zeros(), Vector3::zeros());
    for ((asked, got), weight) in samples.zip(weights) {
        let counts = weight.map(|w| if w > 0.0 { 1.0 } else { 0.0 });
        commanded += asked.component_mul(&asked).component_mul(&counts);
        delivered += got.component_mul(&got).component_mul(&counts);
    }
    commanded.zip_map(&delivered, |asked: f64, got: f64| if got > 0.0 { (asked / got).sqrt() } else { 1.0 })
}

/// Dry friction of the joints at a pose [N m, N m, N].
pub(super) fn dry_friction(arm: &Arm, shaft: &Shaft) -> Vector3<f64> {
    let gravity = arm.dynamics.gravity(&arm.transmission.joint_from_motor(&shaft.angle));
    arm.dry_friction().under(&arm.transmission.tension_n(&gravity))
}

/// Whether a motor moves one way beyond doubt throughout a window, where that is in doubt below a speed of `creep` [rad/s or m/s].
pub(crate) fn surely_moving(shaft: &Shaft, j: usize, creep: f64) -> bool {
    shaft.rate[j].abs() > creep + 0.5 * WINDOW_S * shaft.acceleration[j].abs()
}

/// Inverse deviations with which torque samples count: the model's error, its likeness over time as fewer samples, and beside it what is
/// not known of the friction of `arm` near rest. Before links are loose they say nothing.
pub(super) fn torque_weights(robot: &Robot, arm: &Arm, shafts: &[Shaft], loose: &Loose) -> Vec<Vector3<f64>> {
    let mean_square = |j: usize| shafts.iter().map(|s| s.commanded.mean()[j].powi(2)).sum::<f64>() / shafts.len().max(1) as f64;
    let model = Vector3::from_fn(|j, _| TORQUE_MODEL * mean_square(j).sqrt());
    let stride_s = shafts.windows(2).map(|w| w[1].time_s - w[0].time_s).fold(f64::INFINITY, f64::min);
    let alike = (TORQUE_ALIKE_S / stride_s).max(1.0);
    let transmission = &arm.transmission;
    let weight = |shaft: &Shaft| {
        let rate = transmission.joint_rate_from_motor(&shaft.rate);
        let dry = dry_friction(arm, shaft);
        Vector3::from_fn(|j, _| {
            let is_loose = shaft.time_s >= loose.links_s.max(loose.joints_s[j]);
            if !surely_moving(shaft, j, CREEP_RAD_S) || !is_loose || model[j] == 0.0 {
                return 0.0;
            }
            let friction = dry[j] / transmission.link_radius_m[j] * transmission.cable_per_motor_m[j] * robot.joints[j].gear_ratio;
            let slow = 1.0 / (1.0 + (rate[j] / (SLOW * arm.stiction_speed(j))).powi(2));
            1.0 / (model[j].hypot(NEAR_REST * friction * slow) * alike.sqrt())
        })
    };
    shafts.iter().map(weight).collect()
}
