//! A drive on a bench: what its motor must have delivered, and where its joint is.
//!
//! ```text
//! tau = N (I_m qdd_m + tau_c (1 + d e^-(v / v_s)^2) sign(qd_m) + tau_v qd_m - a sin(n q_m)) + r_mc gamma
//! gamma = (f + m qdd + (F_c + mu |f + m qdd|) sign(qd) + F_v qd) / r_l,   q = q_hs + (q_m - q_m,hs) / ratio - x / r_l,   gamma = 2 k_e x + 2 b_e xdot
//! ```
//!
//! with `f` the force measured at the joint, 0 where it is free. Where the motor's torque was recorded, the cable's tension in the second
//! line is what the motor passes on: friction along the cable's way is in it, and no model of it is needed.

use nalgebra::Vector3;

use super::torque::Shafts;
use super::{Model, Shaft};
use crate::Result;
use crate::robot::{Cable, Hysteresis, Joint, JointType, MotorTrack, PAUSE_MAX_S, Transmission, ViscousCoulomb, behind_hysteresis};
use crate::robot::{Cables, wound_by};

/// How the links move about one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkMotion {
    /// [rad, rad, m].
    pub position: Vector3<f64>,
    /// [rad/s, rad/s, m/s].
    pub rate: Vector3<f64>,
    /// [rad/s^2, rad/s^2, m/s^2].
    pub acceleration: Vector3<f64>,
}

/// A drive at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Driven {
    /// Its motors, with their torque; 0 where that was not recorded.
    pub shaft: Shaft,
    /// Force measured at the joints against their motion [N m or N]; 0 where it was not.
    pub load: Vector3<f64>,
    /// How the joints move, where they were measured; else they are taken to follow rigidly.
    pub joint: Option<LinkMotion>,
}

/// A model of a bench.
pub struct BenchModel<'a> {
    model: &'a Model,
    transmission: Transmission,
    shafts: Shafts,
    cables: [Cable; 3],
    friction: [ViscousCoulomb; 3],
    hysteresis: [Hysteresis; 3],
    mass: Vector3<f64>,
    /// Speeds of the joints below which their dry friction fades [rad/s or m/s].
    rubbing_from: Vector3<f64>,
    /// Speeds of the motors below which the direction of their dry friction is in doubt.
    creep: Vector3<f64>,
}

impl<'a> BenchModel<'a> {
    /// Of a model; `creep` are the speeds of the motors [rad/s or m/s] below which the direction of their friction is in doubt.
    ///
    /// # Errors
    /// If the bench has no joints or more than three.
    pub fn new(model: &'a Model, creep: Vector3<f64>) -> Result<Self> {
        let robot = &model.robot;
        let joint = |j: usize| robot.joints.get(j);
        let mass = |j: usize| {
            let slides = joint(j).is_some_and(|joint| joint.kind == JointType::Prismatic);
            robot.links.get(j).map_or(0.0, |link| if slides { link.mass } else { link.inertia[2] })
        };
        let rubbing_from = |j: usize| joint(j).map_or(1.0, Joint::stiction_speed);
        Ok(Self {
            model,
            transmission: robot.bench_transmission()?,
            shafts: Shafts::new(model),
            cables: std::array::from_fn(|j| joint(j).and_then(|joint| joint.cable).unwrap_or(Cable::new(f64::INFINITY, 0.0))),
            friction: std::array::from_fn(|j| joint(j).and_then(|joint| joint.link_friction).unwrap_or_default()),
            hysteresis: std::array::from_fn(|j| joint(j).map(|joint| joint.hysteresis).unwrap_or_default()),
            mass: Vector3::from_fn(|j, _| mass(j)),
            rubbing_from: Vector3::from_fn(|j, _| rubbing_from(j)),
            creep,
        })
    }

    /// What the drives deliver of a command [N m or N].
    #[must_use]
    pub fn delivered(&self, driven: &Driven) -> Vector3<f64> {
        self.shafts.delivered(&driven.shaft.commanded)
    }

    /// Part of the window in which a drive clips its command.
    #[must_use]
    pub fn clipped(&self, driven: &Driven) -> Vector3<f64> {
        self.shafts.clipped(&driven.shaft.commanded)
    }

    /// What they must have delivered [N m or N].
    #[must_use]
    pub fn needed(&self, driven: &Driven) -> Vector3<f64> {
        let passed_on = self.shafts.passed_on(&self.pulled_n(driven), &self.transmission.cable_per_motor_m);
        self.shafts.taken(&driven.shaft, &driven.shaft.rate.map(f64::signum)) + passed_on
    }

    /// Tension differences of the cables [N] by what is known of the joints.
    #[must_use]
    pub fn pulled_n(&self, driven: &Driven) -> Vector3<f64> {
        let rigid = |motor: &Vector3<f64>| self.transmission.joint_rate_from_motor(motor);
        let (rate, acceleration) = driven
            .joint
            .map_or_else(|| (rigid(&driven.shaft.rate), rigid(&driven.shaft.acceleration)), |joint| (joint.rate, joint.acceleration));
        let force = Vector3::from_fn(|j, _| {
            let friction = &self.friction[j];
            let load = driven.load[j] + self.mass[j] * acceleration[j];
            let way = (rate[j] / self.rubbing_from[j]).clamp(-1.0, 1.0);
            load + (friction.coulomb + friction.per_load * load.abs()) * way + friction.viscous * rate[j]
        });
        force.component_div(&self.transmission.link_radius_m)
    }

    /// Tension differences of the cables [N] by what the motors pass on.
    #[must_use]
    pub fn passed_on_n(&self, driven: &Driven) -> Vector3<f64> {
        let way = driven.shaft.rate.zip_map(&self.creep, |rate, creep| (rate / creep).clamp(-1.0, 1.0));
        let on_cable = self.delivered(driven) - self.shafts.taken(&driven.shaft, &way);
        on_cable.component_div(&self.shafts.passed_on(&Vector3::repeat(1.0), &self.transmission.cable_per_motor_m))
    }

    /// Joint positions that their encoders show at `times_s` [rad or m]; `tension_n` are the cables' at times [s]. `None` where the motors
    /// are not known.
    #[must_use]
    pub fn shown(&self, motors: &MotorTrack, tension_n: &Tension, times_s: &[f64]) -> Vec<Option<Vector3<f64>>> {
        let transmission = &self.transmission;
        let at = |time_s: f64, _: &Vector3<f64>| tension_n.at(time_s);
        let cables = Cables { transmission, stiffness_n: self.cables.map(|cable| cable.stiffness), tension_n: &at };
        let wound = behind_hysteresis(&self.hysteresis, &transmission.ratio, &wound_by(&self.model.motors, &cables, motors));
        let stretched = self.stretch_m(tension_n);
        let shown = |&stamp_s: &f64| {
            let time_s = self.model.view.shown_at_s(stamp_s);
            let (angle, _) = wound.at(time_s)?;
            Some(transmission.joint_from_motor(&angle) - transmission.joint_lag(&stretched.at(time_s)))
        };
        times_s.iter().map(shown).collect()
    }

    /// Stretch of the cables [m]: at once, or behind their damping.
    fn stretch_m(&self, tension_n: &Tension) -> Tension {
        let still = |tension: &Vector3<f64>| Vector3::from_fn(|j, _| self.cables[j].static_stretch_m(tension[j]));
        let time_constant_s =
            Vector3::from_fn(|j, _| Some(self.cables[j]).filter(|cable| cable.damping > 0.0).map_or(0.0, |c| c.damping / c.stiffness));
        let mut before: Option<(f64, Vector3<f64>, Vector3<f64>)> = None;
        let stretched = |(&time_s, tension): (&f64, &Vector3<f64>)| {
            let target = still(tension);
            let now = match before.filter(|(t, ..)| time_s - t <= PAUSE_MAX_S) {
                // Behind a target that moves steadily, by as far as it moves within the time constant in the end.
                Some((t, last_target, last)) => Vector3::from_fn(|j, _| {
                    let in_time_constants = (time_s - t) / time_constant_s[j];
                    let kept = (-in_time_constants).exp();
                    let behind = (target[j] - last_target[j]) / in_time_constants;
                    target[j] - behind + (last[j] - last_target[j] + behind) * kept
                }),
                None => target,
            };
            before = Some((time_s, target, now));
            now
        };
        Tension { time_s: tension_n.time_s.clone(), value: tension_n.time_s.iter().zip(&tension_n.value).map(stretched).collect() }
    }
}

/// Tension differences of cables [N], or what follows from them, over time: linear between samples.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tension {
    /// [s], strictly increasing.
    pub time_s: Vec<f64>,
    /// Of each cable.
    pub value: Vec<Vector3<f64>>,
}

impl Tension {
    /// At a time, the nearest sample's before the first and after the last.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Vector3<f64> {
        held(&self.time_s, &self.value, time_s)
    }
}

/// A series at a time: linear between samples at rising times [s], the nearest sample before the first and after the last, zero of none.
#[must_use]
pub fn held(times_s: &[f64], values: &[Vector3<f64>], time_s: f64) -> Vector3<f64> {
    let after = times_s.partition_point(|&t| t < time_s);
    let sample = |k: usize| Some((*times_s.get(k)?, *values.get(k)?));
    match (after.checked_sub(1).and_then(sample), sample(after)) {
        (Some((t0, v0)), Some((t1, v1))) => v0 + (v1 - v0) * ((time_s - t0) / (t1 - t0)),
        (Some((_, v)), None) | (None, Some((_, v))) => v,
        (None, None) => Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Robot;

    #[test]
    fn a_damped_cable_stretches_later_by_its_time_constant_however_seldom_it_is_looked_at() {
        let gold = crate::robot::nominal::GOLD_YAML;
        let text = format!(
            "format: raven-robot/1\nname: slide\nkinematics: {{kind: bench}}\nsource: {{topic: /motor/joint_states, format: joint_state}}\n\
             joints:\n  - {{name: carriage, type: prismatic, gear_ratio: 1.0, motor_capstan_radius: 1.0, link_pulley_radius: 1.0, \
             cable: {{stiffness: 5000.0, damping: 30.0}}, motor: {{inertia: 5.0, coulomb_friction: 0.0, viscous_friction: 0.0}}}}\n{}",
            &gold[gold.find("tolerances:").unwrap()..]
        );
        let robot = Robot::parse(std::path::Path::new("slide.yaml"), &text).unwrap();
        let model = Model::new(&robot, None).unwrap();
        let bench = BenchModel::new(&model, Vector3::repeat(1e-3)).unwrap();
        for step_s in [0.001, 0.02] {
            let time_s: Vec<f64> = (0..).map(|k| f64::from(k) * step_s).take_while(|t| *t < 0.5).collect();
            let value = time_s.iter().map(|t| Vector3::x() * (100.0 * t)).collect();
            let stretched = bench.stretch_m(&Tension { time_s, value }).at(0.4)[0];
            // 100 N/s on 10 kN/m, six milliseconds behind.
            approx::assert_relative_eq!(stretched, 0.01 * (0.4 - 0.006), max_relative = 1e-3);
        }
    }
}
