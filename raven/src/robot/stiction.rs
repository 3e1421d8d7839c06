//! Friction on a soft cable is play: the joint rests until its cable has been wound by enough to pull it free.
//!
//! ```text
//! h = F_c / (2 k_e r_l^2)      turn of the joint by which its cable stretches to overcome Coulomb friction [rad or m]
//! q follows where the cables would have it, q_e, with play h:  q_e - h <= q <= q_e + h
//! ```
//!
//! Friction that gives way below a speed `v_s` lets the joint creep back within that play: its lag `q - q_e` decays at the rate `v_s / h`,
//! down to the part of `h` that holds. A damper beside the spring lets a cable stretch no faster than at the rate `k_e / b_e`: a hundredth of a
//! second as a rule, most of a second where the cable is soft.
//!
//! At the speeds of surgery the links' inertia does not matter, so a joint behind a spring with Coulomb friction is where a free joint
//! would be if the motors had wound no more than that. The play is the joint's and not the cable's: a motor that makes up for another
//! joint's motion moves nothing, and a load that changes has to overcome friction too. Unlike friction that is smoothed around rest, play
//! does not creep while the robot holds still. It serves filters, whose state has no place for where friction has hold of a joint, and
//! slopes; rollouts of a diagnosis have bristles instead. Source of the operator: Prandtl; see Krasnosel'skii, Pokrovskii, Systems with Hysteresis, 1989, chapter 1.

use nalgebra::Vector3;

use super::{Arm, MotorTrack, PAUSE_MAX_S};

/// Time between two looks at the load [s]: no motion here changes it within.
pub(super) const LOAD_S: f64 = 0.01;
/// The same where slopes are all that is wanted.
const LOAD_AT_REST_S: f64 = 0.05;

/// Whether holding Coulomb friction makes a play of any joint.
#[must_use]
pub fn has_play(arm: &Arm) -> bool {
    arm.link_friction.iter().any(|friction| friction.held_part > 0.0 && (friction.coulomb > 0.0 || friction.per_load > 0.0))
}

/// The motors that would move free joints as these motors move joints with play. It starts where the file has it, and after a pause in its
/// middle.
#[must_use]
pub fn behind_play(arm: &Arm, motor: &MotorTrack) -> MotorTrack {
    Behind::play(arm).along(motor).motors
}

/// Joints without inertia, behind all their friction.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Dragged {
    /// The motors that would move free joints in the same way.
    pub motors: MotorTrack,
    /// How much of their dry friction drags at the joints then, and which way [-1 to 1]: by their cables' stretch, which changes smoothly.
    pub drag: Vec<Vector3<f64>>,
}

impl Dragged {
    /// The drag about a time, averaged with the weights `(1 - (t / h)^2)^2` within `h` [s] of it; `None` where nothing is known of it.
    #[must_use]
    pub fn drag_about(&self, time_s: f64, h_s: f64) -> Option<Vector3<f64>> {
        let from = self.motors.time_s.partition_point(|&t| t <= time_s - h_s);
        let to = self.motors.time_s.partition_point(|&t| t < time_s + h_s);
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for (t, drag) in self.motors.time_s.get(from..to)?.iter().zip(self.drag.get(from..to)?) {
            let weight = (1.0 - ((t - time_s) / h_s).powi(2)).powi(2);
            sum += drag * weight;
            weights += weight;
        }
        (weights > 0.0).then(|| sum / weights)
    }
}

/// Joints without inertia as these motors move them against all their friction, held or giving way, behind cables that stretch no faster than
/// they are damped.
#[must_use]
pub fn behind_friction(arm: &Arm, motor: &MotorTrack) -> Dragged {
    Behind::friction(arm).along(motor)
}

/// When each joint has moved so far from its start that friction of `times` what it should be no longer keeps it where the past left it [s];
/// `None` for a joint that never does.
#[must_use]
pub fn stirred_s(arm: &Arm, motor: &MotorTrack, times: f64) -> [Option<f64>; 3] {
    let Some(start) = motor.angle.first().map(|angle| arm.transmission.joint_from_motor(angle)) else { return [None; 3] };
    let whole = Held::at(arm, &start, &|_| 1.0).half * 2.0 * times;
    let moved = |angle: &Vector3<f64>| arm.transmission.joint_from_motor(angle) - start;
    [0, 1, 2].map(|j| {
        let at = motor.angle.iter().position(|angle| moved(angle)[j].abs() > whole[j])?;
        motor.time_s.get(at).copied()
    })
}

/// How far a joint lags behind the middle of its play as the motion begins.
type Start = fn(&Arm, &Held, usize) -> f64;

/// Joints that lag behind their motors, step by step.
pub(super) struct Behind<'a> {
    arm: &'a Arm,
    /// Part of a joint's friction that makes its play.
    part: Box<dyn Fn(usize) -> f64 + 'a>,
    /// At first.
    start: Start,
    /// What becomes of that, with half a play, while the cable is wound; and how much of the joint's friction that takes [-1 to 1].
    follow: Box<dyn Fn(f64, f64, usize, Wound) -> [f64; 2] + 'a>,
    /// Time between two looks at the load [s].
    load_s: f64,
    held: Held,
    /// How far joints are behind where rigid cables would have them.
    behind_rigid: Vector3<f64>,
    /// How much of their dry friction drags at the joints, and which way [-1 to 1]: by all that their cables pull, dampers too.
    pub(super) drag: Vector3<f64>,
    rigid: Vector3<f64>,
    last_s: f64,
    weighed_s: f64,
}

impl<'a> Behind<'a> {
    fn new(
        arm: &'a Arm,
        load_s: f64,
        part: impl Fn(usize) -> f64 + 'a,
        start: Start,
        follow: impl Fn(f64, f64, usize, Wound) -> [f64; 2] + 'a,
    ) -> Self {
        let [behind_rigid, drag, rigid] = [Vector3::zeros(); 3];
        let [last_s, weighed_s] = [f64::NEG_INFINITY; 2];
        let (part, follow) = (Box::new(part), Box::new(follow));
        Self { arm, part, start, follow, load_s, held: Held::default(), behind_rigid, drag, rigid, last_s, weighed_s }
    }

    /// Behind the friction that holds alone.
    fn play(arm: &'a Arm) -> Self {
        let held = |j: usize| arm.link_friction[j].held_part;
        let start: Start = |arm, at, j| arm.link_friction[j].lag_at_start * at.half[j];
        let follow = |lag: f64, half: f64, _, wound: Wound| {
            let lag = (lag + wound.by).clamp(-half, half);
            [lag, part_of(lag, half)]
        };
        Self::new(arm, LOAD_S, held, start, follow)
    }

    /// Without inertia against all friction, held or giving way, behind cables that stretch no faster than they are damped.
    pub(super) fn friction(arm: &'a Arm) -> Self {
        let viscous = [0, 1, 2].map(|j| Viscous::of(arm, j));
        let follow = move |lag: f64, half: f64, j: usize, Wound { by, in_s }: Wound| {
            let Viscous { cable_s, joint_s } = viscous[j];
            // Of a joint that stays where it is.
            let held = lag + by;
            let pull = held + cable_s * by / in_s;
            let drag = part_of(pull, half);
            if pull.abs() > half {
                let sliding = pull.signum() * half + joint_s * by / in_s;
                return [sliding + (lag - sliding) * (-in_s / (cable_s + joint_s)).exp(), drag];
            }
            let most = arm.link_friction[j].held_part * half;
            if most >= half {
                return [held, drag];
            }
            let kept = (-in_s / (cable_s + (half - most) / arm.stiction_speed(j))).exp();
            let holding = held.clamp(-most, most);
            [holding + (held - holding) * kept, drag]
        };
        let start: Start = |arm, at, j| {
            let friction = &arm.link_friction[j];
            friction.lag_at_start * friction.held_part * at.half[j] - arm.cables[j].fresh_part * at.sag[j]
        };
        Self::new(arm, LOAD_AT_REST_S, |_| 1.0, start, follow)
    }

    /// On to a time [s] at which the motors are at `angle` [rad].
    pub(super) fn step(&mut self, time_s: f64, angle: &Vector3<f64>) {
        let rigid = self.arm.transmission.joint_from_motor(angle);
        if time_s - self.weighed_s > self.load_s {
            self.weighed_s = time_s;
            self.held = Held::at(self.arm, &rigid, &self.part);
        }
        let Held { middle, half, .. } = self.held;
        let (begins, in_s) = (self.last_s == f64::NEG_INFINITY, time_s - self.last_s);
        for j in 0..3 {
            let [lag, drag] = if in_s > PAUSE_MAX_S {
                let lag = if begins { (self.start)(self.arm, &self.held, j) } else { 0.0 };
                [lag, part_of(lag, half[j])]
            } else {
                (self.follow)(self.behind_rigid[j] - middle[j], half[j], j, Wound { by: rigid[j] - self.rigid[j], in_s })
            };
            (self.behind_rigid[j], self.drag[j]) = (middle[j] + lag, drag);
        }
        (self.rigid, self.last_s) = (rigid, time_s);
    }

    /// All of a motion.
    fn along(mut self, motor: &MotorTrack) -> Dragged {
        let mut dragged = Dragged::default();
        for (&time_s, angle) in motor.time_s.iter().zip(&motor.angle) {
            self.step(time_s, angle);
            dragged.motors.time_s.push(time_s);
            dragged.motors.angle.push(self.arm.transmission.motor_from_joint(&(self.rigid - self.behind_rigid + self.held.sag)));
            dragged.drag.push((self.behind_rigid - self.held.middle).zip_map(&self.held.half, part_of));
        }
        dragged
    }
}

/// Part of half a play that a lag takes [-1 to 1].
fn part_of(lag: f64, half: f64) -> f64 {
    if half > 0.0 { (lag / half).clamp(-1.0, 1.0) } else { 0.0 }
}

/// What a motor winds of a cable over a step, at the joint.
#[derive(Debug, Clone, Copy)]
struct Wound {
    /// [rad or m].
    by: f64,
    /// [s].
    in_s: f64,
}

/// Times over which a cable's stiffness makes up for what is viscous: damping over stiffness.
#[derive(Debug, Clone, Copy)]
struct Viscous {
    /// Of the cable [s].
    cable_s: f64,
    /// Of the joint behind it [s].
    joint_s: f64,
}

impl Viscous {
    fn of(arm: &Arm, j: usize) -> Self {
        let cable_s = 2.0 * arm.cables[j].damping / arm.cables[j].tangent_stiffness(0.0);
        Self { cable_s, joint_s: arm.link_friction[j].viscous / arm.joint_stiffness(j, 0.0) }
    }
}

/// Joints at rest in one pose.
#[derive(Debug, Clone, Copy, Default)]
struct Held {
    /// By how much gravity keeps free joints from where rigid cables would have them [rad, rad, m].
    sag: Vector3<f64>,
    /// The same in the middle of their play: another one where cables are slack or stiffen.
    middle: Vector3<f64>,
    /// Half the play of each joint [rad, rad, m].
    half: Vector3<f64>,
}

impl Held {
    fn at(arm: &Arm, rigid: &Vector3<f64>, part: &dyn Fn(usize) -> f64) -> Self {
        let tension = arm.transmission.tension_n(&arm.dynamics.gravity(rigid));
        let dry_n = arm.dry_friction().under(&tension).component_div(&arm.transmission.link_radius_m);
        let friction = Vector3::from_fn(|j, _| part(j) * dry_n[j]);
        let stretch = |tension: Vector3<f64>| Vector3::from_fn(|j, _| arm.cables[j].static_stretch_m(tension[j]));
        let [free, ahead, behind] = [tension, tension + friction, tension - friction].map(stretch);
        let half_m = (ahead - behind) * 0.5;
        Self {
            sag: arm.transmission.joint_lag(&free),
            middle: arm.transmission.joint_lag(&((ahead + behind) * 0.5)),
            half: half_m.component_div(&arm.transmission.link_radius_m).map(|half| if half.is_finite() { half } else { 0.0 }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{LinkModel, nominal};

    /// The elbow driven slowly up, down and up again: the rubbing model against the frictionless one behind play.
    #[test]
    fn a_rubbing_joint_moves_as_a_free_one_behind_play() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.cables[1].stiffness = 14_000.0;
        let middle = Vector3::new(0.8, 1.5, 0.35);
        let time_s: Vec<f64> = (0..12_000).map(|k| f64::from(k) * 1e-3).collect();
        let wanted = |t: f64| middle + Vector3::y() * 0.3 * (t * 1.5).sin();
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&wanted(t))).collect(), time_s };
        let times: Vec<f64> = (2..119).map(|k| f64::from(k) * 0.1).collect();
        let rubbing = LinkModel::new(arm.clone()).rollout(&motor, &times);
        let mut holding = arm.clone();
        holding.link_friction.iter_mut().for_each(|friction| friction.held_part = 1.0);
        let free = LinkModel::new(holding.clone()).rollout(&holding.driving(&motor), &times);
        let unaided = LinkModel::new(holding).rollout(&motor, &times);
        let miss = |model: &[Option<crate::robot::LinkState>]| {
            let pairs = model.iter().zip(&rubbing).map(|(a, b)| a.unwrap().position[1] - b.unwrap().position[1]);
            crate::stats::rms(&pairs.collect::<Vec<_>>()).unwrap()
        };
        assert!(miss(&free) < 0.2 * miss(&unaided), "{} of {}", miss(&free), miss(&unaided));
    }

    #[test]
    fn a_joint_is_stirred_once_it_has_moved_through_its_friction() {
        let arm = nominal::gold().arm().unwrap();
        let start = Vector3::new(0.8, 1.5, 0.35);
        // The elbow rests for a second and then goes at 0.01 rad/s; the others stay.
        let time_s: Vec<f64> = (0..30_000).map(|k| f64::from(k) * 1e-3).collect();
        let joint = |t: f64| start + Vector3::y() * 0.01 * (t - 1.0).max(0.0);
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&joint(t))).collect(), time_s };
        let play = 2.0 * Held::at(&arm, &start, &|_| 1.0).half[1];
        for times in [1.0, 3.0] {
            let [shoulder, elbow, insertion] = stirred_s(&arm, &motor, times);
            approx::assert_relative_eq!(elbow.unwrap(), 1.0 + times * play / 0.01, epsilon = 2e-3);
            assert!(shoulder.is_none() && insertion.is_none());
        }
    }

    /// An arm whose elbow has a play of 0.1 rad on either side.
    fn with_play() -> Arm {
        let mut arm = nominal::gold().arm().unwrap();
        arm.link_friction[1].held_part = 1.0;
        arm.cables.iter_mut().for_each(|cable| cable.stiffness *= 1e6);
        let radius_m = arm.transmission.link_radius_m[1];
        arm.link_friction[1].coulomb = arm.cables[1].force(0.1 * radius_m, 0.0) * radius_m;
        arm
    }

    #[test]
    fn friction_holds_joints_at_first_where_the_file_says() {
        let mut arm = with_play();
        let wanted = Vector3::new(0.5, 1.2, 0.4);
        // Without a pause, which would bring joints to the middle of their play.
        let motor = MotorTrack { time_s: vec![0.0, 0.4, 0.8], angle: vec![arm.transmission.motor_from_joint(&wanted); 3] };
        for lag in [-1.0, 0.4] {
            arm.link_friction[1].lag_at_start = lag;
            let rolled = LinkModel::new(arm.clone()).rollout_gripped(&motor, &[0.0, 0.8]);
            let played = [behind_play(&arm, &motor), behind_friction(&arm, &motor).motors].map(|behind| behind.angle[2]);
            let played = played.map(|angle| arm.transmission.joint_from_motor(&angle)[1]);
            let rolled = rolled.iter().map(|state| state.unwrap().position[1]);
            for found in rolled.chain(played) {
                approx::assert_relative_eq!(found, 1.2 - 0.1 * lag, epsilon = 1e-3);
            }
        }
    }

    /// A cable of a twentieth of its stiffness, slopes of which were off where links without inertia followed at once.
    #[test]
    fn a_soft_cable_stretches_as_its_damper_lets_it() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.cables[1].stiffness *= 0.05;
        arm.link_friction[1].held_part = 1.0;
        let time_s: Vec<f64> = (0..10_000).map(|k| f64::from(k) * 1e-3).collect();
        let wanted = |t: f64| Vector3::new(0.8, 1.5 + 0.3 * (t * 1.5).sin(), 0.35);
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&wanted(t))).collect(), time_s };
        let times: Vec<f64> = (20..99).map(|k| f64::from(k) * 0.1).collect();
        let miss = |arm: &Arm, damped: &Arm| {
            let rolled = LinkModel::new(arm.clone()).rollout_gripped(&motor, &times);
            let (behind, links) = (behind_friction(damped, &motor).motors, LinkModel::new(arm.clone()));
            let settled = times.iter().map(|&t| links.settled(&behind.at(t).unwrap().0, &Vector3::zeros())[1]);
            let miss = settled.zip(rolled).map(|(settled, state)| settled - state.unwrap().position[1]);
            crate::stats::rms(&miss.collect::<Vec<_>>()).unwrap()
        };
        let mut undamped = arm.clone();
        undamped.cables[1].damping = 0.0;
        // Inertia remains, by a third of a degree per rad/s^2 on such a cable.
        assert!(miss(&arm, &arm) < 0.5 * miss(&arm, &undamped), "{} of {}", miss(&arm, &arm), miss(&arm, &undamped));
    }

    #[test]
    fn a_cable_found_unsettled_stretches_on_as_its_damper_lets_it() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.cables[2].stiffness *= 0.03;
        arm.cables[2].fresh_part = 0.6;
        // Too little friction to hold anything, for a grip that is there.
        arm.link_friction[2].coulomb = 1e-3;
        let time_s: Vec<f64> = (0..500).map(|k| f64::from(k) * 1e-2).collect();
        let wanted = Vector3::new(0.8, 1.5, 0.35);
        let motor = MotorTrack { angle: vec![arm.transmission.motor_from_joint(&wanted); time_s.len()], time_s };
        let times: Vec<f64> = (0..49).map(|k| f64::from(k) * 0.1).collect();
        let sag = 0.35 - LinkModel::new(arm.clone()).settled(&motor.angle[0], &Vector3::zeros())[2];
        let settles_s = arm.cables[2].damping / arm.cables[2].stiffness;
        assert!(sag.abs() > 2e-3 && settles_s > 1.0, "{sag} {settles_s}");
        for held_part in [0.0, 1.0] {
            arm.link_friction[2].held_part = held_part;
            let links = LinkModel::new(arm.clone());
            let rolled = links.rollout_gripped(&motor, &times).into_iter().map(|state| state.unwrap().position[2]);
            let behind = behind_friction(&arm, &motor).motors;
            let settled = times.iter().map(|&t| links.settled(&behind.at(t).unwrap().0, &Vector3::zeros())[2]);
            for (found, t) in rolled.zip(&times).chain(settled.zip(&times)) {
                approx::assert_abs_diff_eq!(found, 0.35 - sag * (1.0 - 0.6 * (-t / settles_s).exp()), epsilon = 0.02 * sag.abs());
            }
        }
    }

    fn joints_behind_play(arm: &Arm, wanted: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let transmission = &arm.transmission;
        let motor = MotorTrack {
            time_s: (0..wanted.len()).map(|k| k as f64 * 0.1).collect(),
            angle: wanted.iter().map(|joint| transmission.motor_from_joint(joint)).collect(),
        };
        behind_play(arm, &motor).angle.iter().map(|angle| transmission.joint_from_motor(angle)).collect()
    }

    #[test]
    fn nothing_moves_within_the_play_and_all_of_it_beyond() {
        let wanted = [1.0, 1.09, 1.2, 1.15, 1.05, 0.9, 0.9].map(|q| Vector3::new(0.5, q, 0.4));
        let played: Vec<f64> = joints_behind_play(&with_play(), &wanted).iter().map(|joint| joint[1]).collect();
        for (found, expected) in played.iter().zip([1.0, 1.0, 1.1, 1.1, 1.1, 1.0, 1.0]) {
            approx::assert_relative_eq!(*found, expected, epsilon = 1e-9);
        }
    }

    #[test]
    fn a_motor_that_makes_up_for_another_joint_moves_nothing() {
        // The elbow's motor turns by the coupling while the shoulder moves, and the elbow stays.
        let wanted: Vec<_> = (0..50).map(|k| Vector3::new(0.2 + 0.02 * f64::from(k), 1.5, 0.4)).collect();
        let played = joints_behind_play(&with_play(), &wanted);
        assert!(played.iter().all(|joint| (joint[1] - 1.5).abs() < 1e-9));
    }
}
