//! Effects that no number of the robot file can say. They stand in its list `effects` as plain data; their laws are in [`crate::effects`].

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::Deserialize;

use super::friction::DryFriction;
use super::stiction::{Behind, LOAD_S};
use super::{Arm, MotorTrack, Transmission};

/// One entry of `effects:`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListedEffect {
    /// Identifier, as `raven-diagnose` names it.
    pub id: String,
    /// Joint; none where it belongs to the rig.
    #[serde(default)]
    pub joint: Option<String>,
    /// Its numbers by name, in SI units.
    pub values: BTreeMap<String, f64>,
}

/// How recorded motor angles become those that wind the cables: encoder faults and whatever the cable does at the capstan. It hears of the
/// cables with all their numbers and of the whole recording's motors [s, rad], and changes them in place.
pub type MotorLaw = Box<dyn Fn(&Cables, &mut MotorTrack) + Send + Sync>;

/// Tension differences of the cables [N] at a time [s], where the motors have wound them [rad]. As friction at rest remembers, it is asked of
/// one time after the other.
pub type TensionLaw<'a> = dyn Fn(f64, &Vector3<f64>) -> Vector3<f64> + 'a;

/// What a law of the motors' side hears of.
pub struct Cables<'a> {
    /// Pulleys.
    pub transmission: &'a Transmission,
    /// `k_e` of each [N].
    pub stiffness_n: [f64; 3],
    /// What they carry.
    pub tension_n: &'a TensionLaw<'a>,
}

/// What laws make of recorded motors on an arm, whose cables carry its weight, its friction and what moves it. Joints are taken to be where
/// the cables are wound to, to move as their motors do, and to be dragged by friction at rest as the last motion left them.
#[must_use]
pub fn wound<'a>(laws: &[MotorLaw], arm: &Arm, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
    let carried = RefCell::new(Carried::new(arm, recorded));
    let tension_n = |time_s: f64, wound: &Vector3<f64>| carried.borrow_mut().tension_n(time_s, wound);
    let (transmission, stiffness_n) = (&arm.transmission, arm.cables.map(|cable| cable.stiffness));
    wound_by(laws, &Cables { transmission, stiffness_n, tension_n: &tension_n }, recorded)
}

/// What the cables of an arm carry, from one time to the next.
struct Carried<'a> {
    arm: &'a Arm,
    recorded: &'a MotorTrack,
    dry: DryFriction,
    behind: Behind<'a>,
    last_s: f64,
    /// What weight, motion and viscous friction load the joints with, about the time that was asked for last.
    between: [Load; 2],
}

/// A load of the joints [N m, N m, N] at a time [s].
#[derive(Clone, Copy)]
struct Load {
    time_s: f64,
    joint_force: Vector3<f64>,
}

impl<'a> Carried<'a> {
    fn new(arm: &'a Arm, recorded: &'a MotorTrack) -> Self {
        let never = Load { time_s: f64::NEG_INFINITY, joint_force: Vector3::zeros() };
        let (dry, behind) = (arm.dry_friction(), Behind::friction(arm));
        Self { arm, recorded, dry, behind, last_s: f64::NEG_INFINITY, between: [never; 2] }
    }

    /// Tension differences [N] at a time [s], where the motors have wound the cables [rad].
    fn tension_n(&mut self, time_s: f64, wound: &Vector3<f64>) -> Vector3<f64> {
        // A law hears of one time after the other: another one begins anew.
        if time_s <= self.last_s {
            *self = Self::new(self.arm, self.recorded);
        }
        self.last_s = time_s;
        let Some(load) = self.load(time_s, wound) else { return Vector3::zeros() };
        self.behind.step(time_s, wound);
        let transmission = &self.arm.transmission;
        // Friction that grows with the cable's force goes by what it would be without.
        let dry = self.dry.under(&transmission.tension_n(&load)).component_mul(&self.behind.drag);
        transmission.tension_n(&(load + dry))
    }

    /// What the joints bear but for dry friction [N m, N m, N]: between two looks at it, which are [`LOAD_S`] apart. `None` where the motors are not
    /// known.
    fn load(&mut self, time_s: f64, wound: &Vector3<f64>) -> Option<Vector3<f64>> {
        if time_s > self.between[1].time_s {
            let before = self.between[1];
            let from = if time_s - before.time_s < LOAD_S { before } else { self.looked_at(time_s, wound)? };
            let ahead_s = from.time_s + LOAD_S;
            let winds_by = self.recorded.at(ahead_s).zip(self.recorded.at(time_s)).map(|((ahead, _), (now, _))| ahead - now);
            let ahead = winds_by.and_then(|by| self.looked_at(ahead_s, &(wound + by)));
            self.between = [from, ahead.unwrap_or(Load { time_s: ahead_s, ..from })];
        }
        let [from, to] = self.between;
        Some(from.joint_force.lerp(&to.joint_force, (time_s - from.time_s) / (to.time_s - from.time_s)))
    }

    fn looked_at(&self, time_s: f64, wound: &Vector3<f64>) -> Option<Load> {
        let (motor, transmission) = (self.recorded.steady(time_s)?, &self.arm.transmission);
        let [rate, acceleration] = [motor.rate, motor.acceleration].map(|of_motor| transmission.joint_rate_from_motor(&of_motor));
        let lifted = self.arm.dynamics.inverse(&transmission.joint_from_motor(wound), &rate, &acceleration);
        Some(Load { time_s, joint_force: lifted + self.arm.viscous_friction().component_mul(&rate) })
    }
}

/// What laws make of recorded motors on cables.
#[must_use]
pub fn wound_by<'a>(laws: &[MotorLaw], cables: &Cables, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
    let mut track = Cow::Borrowed(recorded);
    laws.iter().for_each(|law| law(cables, track.to_mut()));
    track
}

/// Laws of the motors' side, applied in order.
#[derive(Clone, Default)]
pub struct MotorLaws(Arc<[MotorLaw]>);

impl MotorLaws {
    /// The motors' side as the cables of `arm` have it.
    #[must_use]
    pub fn applied<'a>(&self, arm: &Arm, recorded: &'a MotorTrack) -> Cow<'a, MotorTrack> {
        wound(&self.0, arm, recorded)
    }
}

impl From<Vec<MotorLaw>> for MotorLaws {
    fn from(laws: Vec<MotorLaw>) -> Self {
        Self(laws.into())
    }
}

impl fmt::Debug for MotorLaws {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} motor laws", self.0.len())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::robot::nominal;

    fn tensions_n(cables: &Cables, track: &MotorTrack) -> Vec<Vector3<f64>> {
        track.time_s.iter().zip(&track.angle).map(|(&time_s, wound)| (cables.tension_n)(time_s, wound)).collect()
    }

    #[test]
    fn cables_carry_weight_friction_and_what_moves_the_links() {
        let arm = nominal::gold().arm().unwrap();
        let (middle, reach) = (Vector3::new(0.5, 1.5, 0.4), Vector3::new(0.3, 0.3, 0.05));
        let omega = 4.0;
        let at = |time_s: f64| middle + reach * (omega * time_s).sin();
        let time_s: Vec<f64> = (0..2000).map(|k| f64::from(k) * 1e-3).collect();
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&at(t))).collect(), time_s };
        // Half way out, and shortly before the joints turn.
        let at_k = [131, 353];
        let heard = Arc::new(Mutex::new(Vec::new()));
        let hears = heard.clone();
        let law: MotorLaw = Box::new(move |cables, track| *hears.lock().unwrap() = tensions_n(cables, track));
        assert_eq!(*wound(&[law], &arm, &motor), motor);
        let heard = heard.lock().unwrap();
        for k in at_k {
            let (time_s, tension_n) = (motor.time_s[k], heard[k]);
            let rate = reach * omega * (omega * time_s).cos();
            let acceleration = -reach * omega * omega * (omega * time_s).sin();
            let lifted = arm.dynamics.inverse(&at(time_s), &rate, &acceleration);
            let drag = Vector3::from_fn(|j, _| arm.link_friction[j].coulomb + arm.link_friction[j].viscous * rate[j]);
            let expected = arm.transmission.tension_n(&(lifted + drag));
            approx::assert_relative_eq!(tension_n, expected, max_relative = 0.01);
            assert!((expected - arm.transmission.tension_n(&arm.dynamics.gravity(&at(time_s)))).norm() > 0.5);
        }
    }

    #[test]
    fn friction_drags_on_after_a_motion_has_ended_until_a_cable_gives_way() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.link_friction.iter_mut().for_each(|friction| friction.held_part = 1.0);
        let (from, by) = (Vector3::new(0.5, 1.5, 0.4), Vector3::new(0.2, -0.2, 0.04));
        let time_s: Vec<f64> = (0..3000).map(|k| f64::from(k) * 1e-3).collect();
        let at = |time_s: f64| from + by * time_s.min(1.0);
        let wound_to = |joint: &Vector3<f64>| arm.transmission.motor_from_joint(joint);
        let motor = MotorTrack { angle: time_s.iter().map(|&t| wound_to(&at(t))).collect(), time_s };
        // A tenth of the way is lost from two seconds on, in half a second.
        let lost = wound_to(&at(0.9)) - wound_to(&at(1.0));
        let heard = Arc::new(Mutex::new(Vec::new()));
        let hears = heard.clone();
        let law: MotorLaw = Box::new(move |cables, track| {
            let part = |time_s: f64| (2.0 * (time_s - 2.0)).clamp(0.0, 1.0);
            track.angle.iter_mut().zip(&track.time_s).for_each(|(angle, &time_s)| *angle += lost * part(time_s));
            *hears.lock().unwrap() = tensions_n(cables, track);
        });
        let _ = wound(&[law], &arm, &motor);
        for (k, way, pose) in [(1900, 1.0, at(1.0)), (2900, -1.0, at(0.9))] {
            let drag = Vector3::from_fn(|j, _| way * arm.link_friction[j].coulomb * by[j].signum());
            let expected = arm.transmission.tension_n(&(arm.dynamics.gravity(&pose) + drag));
            approx::assert_relative_eq!(heard.lock().unwrap()[k], expected, max_relative = 0.01);
        }
    }
}
