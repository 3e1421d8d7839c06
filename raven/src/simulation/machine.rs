//! The machine as it really is: the robot file's numbers with the hidden effects applied, and what no robot file can say.

use nalgebra::{Matrix3, Vector3};

use super::effect::{Effect, EffectKind};
use super::outside::{Bulge, Bump, Contact, Wander};
use crate::robot::{Cable, Hysteresis, JointType, Kinematics, KinematicsKind, LinkDynamics, Motor, Robot, ViscousCoulomb};
use crate::{Error, Result};

/// Drive of one joint: motor, capstan, cable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Motor turns per capstan turn.
    pub gear_ratio: f64,
    /// Capstan [m].
    pub capstan_m: f64,
    /// Pulley at the link [m]; 1 on a prismatic joint.
    pub pulley_m: f64,
    /// `k_e` [N].
    pub stiffness_n: f64,
    /// `b_e` [N s/m].
    pub damping: f64,
    /// Length over which the cable stiffens [m].
    pub stiffening_m: f64,
    /// The hysteresis that the robot file has [m of cable]. What the motion before left of it follows from the session.
    pub hysteresis_m: Hysteresis,
    /// Half the play between capstan and cable that is hidden [m of cable].
    pub play_half_m: f64,
    /// Half the dead zone [m of cable].
    pub backlash_half_m: f64,
    /// Delayed stretch over the immediate one, and its time constant [s].
    pub creep: Option<[f64; 2]>,
    /// Force above which the capstan slips [N], and the part of its travel that is lost.
    pub slip: Option<[f64; 2]>,
    /// Eccentricity of the capstan [m] and its phase [rad].
    pub eccentricity: [f64; 2],
    /// Motor on its shaft.
    pub motor: Motor,
    /// Additional Coulomb friction at low speed: relative depth, speed of the motor [rad/s].
    pub stribeck: Option<[f64; 2]>,
    /// Torque delivered over torque commanded.
    pub torque_gain: f64,
    /// What the drive can deliver, after the gear box [N m].
    pub torque_limit: f64,
    /// Amplitude on the shaft [N m], periods per turn.
    pub ripple: Option<[f64; 2]>,
    /// Friction at the joint.
    pub link_friction: ViscousCoulomb,
    /// Friction at the joint per force at the joint.
    pub load_friction: f64,
    /// Miscounted encoder: counts, moment as a part of the recording.
    pub missed_counts: Option<[f64; 2]>,
    /// A place where the joint rubs.
    pub bump: Option<Bump>,
    /// A pulley that is not round.
    pub bulge: Option<Bulge>,
    /// An encoder whose zero wanders.
    pub wander: Option<Wander>,
}

/// What the cables move.
#[derive(Debug, Clone)]
pub enum Load {
    /// The links of an arm.
    Arm {
        /// Geometry, as it is.
        kinematics: Kinematics,
        /// Inertia and gravity, payload included.
        dynamics: Box<LinkDynamics>,
        /// What the tip may touch.
        contact: Option<Contact>,
    },
    /// A carriage per joint: its mass or inertia.
    Bench(Vector3<f64>),
}

/// Everything the plant needs to know.
#[derive(Debug, Clone)]
pub struct Machine {
    /// One per joint; a bench with fewer joints has drives that rest.
    pub drives: [Drive; 3],
    /// What they move.
    pub load: Load,
    /// Mass or inertia that only resists acceleration, on the diagonal of the mass matrix.
    pub extra_inertia: Vector3<f64>,
    /// Cable travel, at the joint, per joint motion: `1 + C`.
    pub travel_from_joint: Matrix3<f64>,
    /// Where the encoders are set [rad, rad, m].
    pub hard_stop: Vector3<f64>,
    /// What the motors' encoders are set to there [rad].
    pub motor_at_hard_stop: Vector3<f64>,
}

/// A bench without a cable in its file gets one so stiff that it resonates here [rad/s] and hardly stretches.
const BENCH_RESONANCE: f64 = 2000.0;
/// Mass at the joint of such a bench, as a part of what the motor feels.
const BENCH_JOINT_MASS: f64 = 0.01;

impl Machine {
    /// The machine behind `robot` once the effects are applied.
    ///
    /// # Errors
    /// If the file lacks what a plant needs, or an effect names a joint that is not there.
    pub fn new(robot: &Robot, effects: &[Effect]) -> Result<Self> {
        for effect in effects {
            effect.check_target(robot)?;
        }
        let actual = actual_robot(robot, effects)?;
        let mut machine = match &robot.kinematics {
            KinematicsKind::Raven(_) => Self::arm(robot, &actual, effects)?,
            KinematicsKind::Bench => Self::bench(robot, &actual)?,
        };
        for effect in effects {
            if let Some(joint) = effect.target.as_deref().and_then(|name| robot.joint_index(name).ok()) {
                machine.apply(effect, joint, robot.joints[joint].kind);
            }
        }
        Ok(machine)
    }

    /// Geometry of the arm; `None` on a bench.
    #[must_use]
    pub fn kinematics(&self) -> Option<&Kinematics> {
        match &self.load {
            Load::Arm { kinematics, .. } => Some(kinematics),
            Load::Bench(_) => None,
        }
    }

    fn arm(robot: &Robot, actual: &Robot, effects: &[Effect]) -> Result<Self> {
        let (nominal, arm) = (robot.arm()?, actual.arm()?);
        let payload_kg = robot.payload + effects.iter().filter(|e| e.kind == EffectKind::Payload).map(|e| e.values[0]).sum::<f64>();
        Ok(Self {
            drives: std::array::from_fn(|j| Drive::new(&actual.joints[j])),
            load: Load::Arm { kinematics: arm.kinematics, dynamics: Box::new(arm.dynamics.with_payload(payload_kg)), contact: None },
            extra_inertia: Vector3::zeros(),
            travel_from_joint: Matrix3::identity() + actual.cable_coupling_matrix()?,
            hard_stop: arm.hard_stop,
            motor_at_hard_stop: nominal.transmission.motor_at_hard_stop,
        })
    }

    fn bench(robot: &Robot, actual: &Robot) -> Result<Self> {
        let count = robot.joints.len();
        if count > 3 {
            return Err(Error::Argument(format!("robot `{}` has {count} joints; the simulator has drives for at most 3.", robot.name)));
        }
        let transmission = robot.bench_transmission()?;
        let mut drives = [Drive::new(&actual.joints[0]); 3];
        let mut mass = Vector3::repeat(1.0);
        for (j, joint) in actual.joints.iter().enumerate() {
            drives[j] = Drive::new(joint);
            let Some(motor) = joint.motor.filter(|m| m.inertia > 0.0) else {
                let key = format!("joints.{}.motor", joint.name);
                return Err(Error::Data(format!("robot `{}`: {key} is missing, but a simulated drive needs its inertia.", robot.name)));
            };
            let reflected = motor.inertia * joint.ratio() * joint.ratio();
            let given = actual.links.get(j).map(|link| if joint.kind == JointType::Prismatic { link.mass } else { link.inertia[2] });
            mass[j] = given.unwrap_or(BENCH_JOINT_MASS * reflected);
            if joint.cable.is_none() {
                let cable_mass = mass[j] / (joint.link_pulley_radius * joint.link_pulley_radius);
                drives[j].stiffness_n = 0.5 * cable_mass * BENCH_RESONANCE * BENCH_RESONANCE;
                drives[j].damping = 0.5 * cable_mass * BENCH_RESONANCE;
            }
            if given.is_none() && joint.cable.is_none() {
                drives[j].motor.inertia *= 1.0 - BENCH_JOINT_MASS;
            }
        }
        Ok(Self {
            drives,
            load: Load::Bench(mass),
            extra_inertia: Vector3::zeros(),
            travel_from_joint: Matrix3::identity(),
            hard_stop: Vector3::from_fn(|j, _| actual.joints.get(j).map_or(0.0, |joint| joint.hard_stop)),
            motor_at_hard_stop: transmission.motor_at_hard_stop,
        })
    }

    /// What no robot file can say.
    fn apply(&mut self, effect: &Effect, j: usize, kind: JointType) {
        let pulley_m = self.drives[j].pulley_m;
        let drive = &mut self.drives[j];
        let first = effect.values[0];
        let both = || [effect.values[0], effect.values[1]];
        match effect.kind {
            EffectKind::CableStiffening => drive.stiffening_m = first,
            EffectKind::Hysteresis => drive.play_half_m = first * pulley_m,
            EffectKind::Backlash => drive.backlash_half_m = 0.5 * first * pulley_m,
            EffectKind::Creep => drive.creep = Some(both()),
            EffectKind::CableSlip => drive.slip = Some(both()),
            EffectKind::PulleyEccentricity => drive.eccentricity = both(),
            EffectKind::StribeckFriction => drive.stribeck = Some(both()),
            EffectKind::TorqueConstant => drive.torque_gain *= first,
            EffectKind::TorqueSaturation => drive.torque_limit = first,
            EffectKind::TorqueRipple => drive.ripple = Some(both()),
            EffectKind::LoadDependentFriction => drive.load_friction = first,
            EffectKind::MissedCounts => drive.missed_counts = Some(both()),
            EffectKind::LinkInertia => match (&mut self.load, kind) {
                (Load::Bench(mass), _) => mass[j] *= first,
                (Load::Arm { dynamics, .. }, JointType::Prismatic) => {
                    let mass = dynamics.mass_matrix(&self.hard_stop)[(j, j)];
                    self.extra_inertia[j] += (first - 1.0) * mass;
                }
                // A rotational inertia is a number of the robot file: see `actual_robot`.
                (Load::Arm { .. }, JointType::Revolute) => {}
            },
            // The others are numbers of the robot file, of the rig or of its clock.
            _ => {}
        }
    }
}

impl Drive {
    fn new(joint: &crate::robot::Joint) -> Self {
        let cable = joint.cable.unwrap_or(Cable::new(0.0, 0.0));
        let link_friction = joint.link_friction.unwrap_or_default();
        Self {
            gear_ratio: joint.gear_ratio,
            capstan_m: joint.motor_capstan_radius,
            pulley_m: joint.link_pulley_radius,
            stiffness_n: cable.stiffness,
            damping: cable.damping,
            stiffening_m: cable.exponent_length,
            hysteresis_m: Hysteresis {
                half_loop: joint.hysteresis.half_loop * joint.link_pulley_radius,
                length: joint.hysteresis.length * joint.link_pulley_radius,
                ..joint.hysteresis
            },
            play_half_m: 0.0,
            backlash_half_m: 0.5 * cable.slack,
            creep: None,
            slip: None,
            eccentricity: [0.0; 2],
            motor: joint.motor.unwrap_or_default(),
            stribeck: None,
            torque_gain: 1.0,
            torque_limit: f64::INFINITY,
            ripple: None,
            link_friction,
            load_friction: link_friction.per_load,
            missed_counts: None,
            bump: None,
            bulge: None,
            wander: None,
        }
    }
}

/// The robot file with the numbers that the effects give it.
fn actual_robot(robot: &Robot, effects: &[Effect]) -> Result<Robot> {
    let mut actual = robot.clone();
    for effect in effects {
        let first = effect.values[0];
        match effect.kind {
            EffectKind::CableCoupling => {
                let (from, to) = effect.pair()?;
                match actual.cable_coupling.iter_mut().find(|c| c.from == from && c.to == to) {
                    Some(coupling) => coupling.coefficient += first,
                    None => {
                        let coupling = crate::robot::Coupling { from: from.to_owned(), to: to.to_owned(), coefficient: first };
                        actual.cable_coupling.push(coupling);
                    }
                }
                continue;
            }
            EffectKind::ToolLength | EffectKind::LinkAngleError => {
                let KinematicsKind::Raven(kinematics) = &mut actual.kinematics else { continue };
                match (effect.kind, effect.target.as_deref()) {
                    (EffectKind::ToolLength, _) => kinematics.wrist_offset += first,
                    (_, Some("12")) => kinematics.link_angle_12 += first,
                    _ => kinematics.link_angle_23 += first,
                }
                continue;
            }
            _ => {}
        }
        let Some(j) = effect.target.as_deref().and_then(|name| robot.joint_index(name).ok()) else { continue };
        let joint = &mut actual.joints[j];
        let name = joint.name.clone();
        let lacks = |key: &str| {
            Error::Argument(format!("--effect {effect}: joints.{name}.{key} is not in the robot file, so there is nothing to multiply."))
        };
        match effect.kind {
            EffectKind::PulleyRadius => joint.link_pulley_radius *= 1.0 + first,
            EffectKind::JointOffset => joint.hard_stop += first,
            EffectKind::CableStretch => joint.cable.as_mut().ok_or_else(|| lacks("cable"))?.stiffness *= first,
            EffectKind::CableDamping => joint.cable.as_mut().ok_or_else(|| lacks("cable"))?.damping *= first,
            EffectKind::LinkCoulombFriction => joint.link_friction.as_mut().ok_or_else(|| lacks("link_friction"))?.coulomb *= first,
            EffectKind::LinkViscousFriction => joint.link_friction.as_mut().ok_or_else(|| lacks("link_friction"))?.viscous *= first,
            EffectKind::MotorCoulombFriction => joint.motor.as_mut().ok_or_else(|| lacks("motor"))?.coulomb_friction *= first,
            EffectKind::MotorViscousFriction => joint.motor.as_mut().ok_or_else(|| lacks("motor"))?.viscous_friction *= first,
            EffectKind::MotorInertia => joint.motor.as_mut().ok_or_else(|| lacks("motor"))?.inertia *= first,
            EffectKind::LinkInertia => {
                if let Some(link) = actual.links.get_mut(j) {
                    link.inertia = link.inertia.map(|i| i * first);
                }
            }
            _ => {}
        }
    }
    Ok(actual)
}
