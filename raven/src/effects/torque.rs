//! What torque the drives must have delivered for the motors to move as recorded: inverse dynamics of motors, cables and links.
//!
//! ```text
//! N (I_m qdd_m + tau_c (1 + d e^-(v / v_s)^2) sign(qd_m) + tau_v qd_m - a sin(n q_m)) + r_mc gamma = clip(g tau_commanded)
//! gamma = (1 + C)'^-1 (M qdd + C(q, qd) + G(q) + friction) / r_l
//! ```
//!
//! Cables' tensions are those of links that are rolled out, or of links that the motors move rigidly. The latter is good to parts in a thousand
//! of the torque, but for the moments after a reversal in which the links rest and the cables are wound.

use nalgebra::Vector3;

use super::{Command, Drive, Model};
use crate::Result;
use crate::robot::{Arm, DryFriction, Motor};

/// Times that a cable's force and the friction that it causes are told each other; each adds a digit at a coefficient of a tenth.
const PASSES: usize = 4;

/// Motors at one time, smoothed, with the torque that was commanded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shaft {
    /// [s].
    pub time_s: f64,
    /// [rad].
    pub angle: Vector3<f64>,
    /// [rad/s], averaged over the window as the torque is.
    pub rate: Vector3<f64>,
    /// [rad/s^2], averaged as well.
    pub acceleration: Vector3<f64>,
    /// After the gear box [N m], as it acts, averaged with the weights `(1 - (t / h)^2)^3` within `h` of the time ([`Self::weight`]).
    pub commanded: Command,
    /// `2 h` [s]; 0 for values of an instant.
    pub window_s: f64,
}

impl Shaft {
    /// Weight, in the means over a window, of what is so many halves of it off its time [-1 to 1].
    #[must_use]
    pub fn weight(off: f64) -> f64 {
        (1.0 - off.powi(2)).max(0.0).powi(3)
    }
}

/// Motors and gear boxes.
pub(super) struct Shafts {
    motors: [Motor; 3],
    drives: [Drive; 3],
    gear_ratio: Vector3<f64>,
}

impl Shafts {
    /// Of a model's joints; those that a bench lacks rest.
    pub(super) fn new(model: &Model) -> Self {
        let joint = |j: usize| model.robot.joints.get(j);
        Self {
            motors: std::array::from_fn(|j| joint(j).and_then(|joint| joint.motor).unwrap_or_default()),
            drives: model.drives.clone(),
            gear_ratio: Vector3::from_fn(|j, _| joint(j).map_or(1.0, |joint| joint.gear_ratio)),
        }
    }

    /// What the drives deliver of a command [N m].
    pub(super) fn delivered(&self, commanded: &Command) -> Vector3<f64> {
        commanded.mean_of(|j, torque| {
            let &Drive { torque_gain, torque_limit, .. } = &self.drives[j];
            (torque * torque_gain).clamp(-torque_limit, torque_limit)
        })
    }

    /// Part of the window in which a drive clips its command.
    pub(super) fn clipped(&self, commanded: &Command) -> Vector3<f64> {
        let clips = |j: usize, torque: f64| (torque * self.drives[j].torque_gain).abs() > self.drives[j].torque_limit;
        commanded.mean_of(|j, torque| if clips(j, torque) { 1.0 } else { 0.0 })
    }

    /// What the motors themselves take of it [N m after the gear box]; `way` is the direction of their dry friction.
    pub(super) fn taken(&self, shaft: &Shaft, way: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|j, _| {
            let (motor, drive, rate) = (&self.motors[j], &self.drives[j], shaft.rate[j]);
            let slow: f64 = drive.stribeck.iter().map(|[depth, speed]| depth * (-(rate / speed).powi(2)).exp()).sum();
            let dry = motor.coulomb_friction * (1.0 + slow) * way[j];
            let wave = |&[amplitude, per_turn]: &[f64; 2]| {
                amplitude * (per_turn * shaft.angle[j]).sin() * averaged(0.5 * shaft.window_s * per_turn * rate)
            };
            let ripple: f64 = drive.ripples.iter().map(wave).sum();
            self.gear_ratio[j] * (motor.inertia * shaft.acceleration[j] + dry + motor.viscous_friction * rate - ripple)
        })
    }

    /// What cables under tension differences [N] take of it [N m after the gear box]; `cable_per_motor_m` is `r_mc / N`.
    pub(super) fn passed_on(&self, tension_n: &Vector3<f64>, cable_per_motor_m: &Vector3<f64>) -> Vector3<f64> {
        tension_n.component_mul(cable_per_motor_m).component_mul(&self.gear_ratio)
    }
}

/// What is left of a wave of `phase` radians per half window when it is averaged as [`Shaft::commanded`] is: `105 j_3(z) / z^3`, `j_3` the
/// spherical Bessel function.
fn averaged(phase: f64) -> f64 {
    let square = phase * phase;
    if square < 0.1 {
        return 1.0 - square / 18.0 * (1.0 - square / 44.0);
    }
    105.0 * ((15.0 - 6.0 * square) * phase.sin() - (15.0 - square) * phase * phase.cos()) / square.powi(3) / phase
}

/// A model of the drives.
pub struct TorqueModel {
    arm: Arm,
    shafts: Shafts,
    dry: DryFriction,
    /// See [`Arm::viscous_friction`].
    viscous: Vector3<f64>,
}

impl TorqueModel {
    /// Of a model.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(model: &Model) -> Result<Self> {
        let arm = model.robot.arm()?;
        Ok(Self { dry: arm.dry_friction(), viscous: arm.viscous_friction(), arm, shafts: Shafts::new(model) })
    }

    /// What the drives deliver of a command [N m].
    #[must_use]
    pub fn delivered(&self, commanded: &Command) -> Vector3<f64> {
        self.shafts.delivered(commanded)
    }

    /// Part of the window in which a drive clips its command.
    #[must_use]
    pub fn clipped(&self, commanded: &Command) -> Vector3<f64> {
        self.shafts.clipped(commanded)
    }

    /// Tension differences of the cables [N] if they move the links without stretch.
    #[must_use]
    pub fn rigid_n(&self, shaft: &Shaft) -> Vector3<f64> {
        self.dragged_n(shaft, &self.arm.rubbing(&self.arm.transmission.joint_rate_from_motor(&shaft.rate)))
    }

    /// The same with such parts of the links' dry friction [-1 to 1] dragging at them.
    #[must_use]
    pub fn dragged_n(&self, shaft: &Shaft, drag: &Vector3<f64>) -> Vector3<f64> {
        let transmission = &self.arm.transmission;
        let rate = transmission.joint_rate_from_motor(&shaft.rate);
        let (mass, bias) = self.arm.dynamics.mass_and_bias(&transmission.joint_from_motor(&shaft.angle), &rate);
        let load = mass * transmission.joint_rate_from_motor(&shaft.acceleration) + bias;
        let viscous = self.viscous.component_mul(&rate);
        let rubbing = |tension: &Vector3<f64>| self.dry.under(tension).component_mul(drag) + viscous;
        let mut tension = transmission.tension_n(&load);
        // Friction that grows with the cable's force is part of what the cable bears.
        for _ in 0..if self.dry.grows() { PASSES } else { 1 } {
            tension = transmission.tension_n(&(load + rubbing(&tension)));
        }
        tension
    }

    /// What the drives delivered [N m] beyond what they must have while the cables pulled with such tension differences [N], or moved the links without
    /// stretch where these are not known.
    #[must_use]
    pub fn lacking(&self, shaft: &Shaft, tension_n: Option<&Vector3<f64>>) -> Vector3<f64> {
        let rigid_n = || self.rigid_n(shaft);
        self.delivered(&shaft.commanded) - self.needed(shaft, &tension_n.copied().unwrap_or_else(rigid_n))
    }

    /// What the drives must have delivered [N m] while the cables pulled with such tension differences [N].
    #[must_use]
    pub fn needed(&self, shaft: &Shaft, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.shafts.taken(shaft, &shaft.rate.map(f64::signum)) + self.shafts.passed_on(tension_n, &self.arm.transmission.cable_per_motor_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::Sited;
    use crate::robot::nominal;

    #[test]
    fn what_a_drive_does_comes_on_top_of_what_the_file_has_of_the_same_kind() {
        let robot = nominal::gold();
        let of = |id: &str| Sited::all(&robot).into_iter().find(|sited| sited.effect.id == id && sited.place.first == 1).unwrap();
        let rate = Vector3::repeat(2.0);
        let [angle, acceleration] = [Vector3::repeat(0.3), Vector3::zeros()];
        let commanded = Command::steady(Vector3::repeat(1.0));
        let shaft = Shaft { time_s: 0.0, angle, rate, acceleration, commanded, window_s: 0.0 };
        let of_effects = |effects: &[(&str, [f64; 2])]| {
            let bare = Model::new(&robot, None).unwrap();
            let model = effects.iter().fold(bare, |model, (id, values)| model.with_values(&of(id), values));
            let torque = TorqueModel::new(&model).unwrap();
            [torque.needed(&shaft, &Vector3::zeros())[1], torque.delivered(&shaft.commanded)[1]]
        };
        let [bare, _] = of_effects(&[]);
        for pair in [
            [("torque-ripple", [2e-3, 5.0]), ("torque-ripple", [1e-3, 8.0])],
            [("stribeck-friction", [0.5, 4.0]), ("stribeck-friction", [0.3, 9.0])],
        ] {
            let apart: f64 = pair.iter().map(|one| of_effects(&[*one])[0] - bare).sum();
            assert!(apart.abs() > 1e-4);
            approx::assert_relative_eq!(of_effects(&pair)[0] - bare, apart, max_relative = 1e-9);
        }
        // What one limit lets through another one may not.
        for limits in [[0.2, 0.4], [0.4, 0.2]] {
            let [_, delivered] = of_effects(&limits.map(|limit| ("torque-saturation", [limit, 0.0])));
            approx::assert_relative_eq!(delivered, 0.2, max_relative = 1e-9);
        }
    }

    #[test]
    fn a_wave_is_averaged_as_a_window_weighs_it() {
        const PARTS: i32 = 1000;
        for phase in [0.0, 0.05, 0.3, 0.33, 1.0, 3.0, 12.0_f64] {
            let offs = (-PARTS..=PARTS).map(|i| f64::from(i) / f64::from(PARTS));
            let [mut left, mut whole] = [0.0; 2];
            for off in offs {
                left += Shaft::weight(off) * (phase * off).cos();
                whole += Shaft::weight(off);
            }
            approx::assert_abs_diff_eq!(averaged(phase), left / whole, epsilon = 1e-7);
        }
    }
}
