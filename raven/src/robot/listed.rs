//! Effects that no number of the robot file can say. They stand in its list `effects` as plain data; their laws are in [`crate::effects`].

use std::borrow::Cow;
use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::Deserialize;

use super::rollout::HALF_WINDOW_S;
use super::stiction::behind_friction;
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

/// Tension differences of the cables [N] at a time [s], where the motors have wound them [rad].
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
    let transmission = &arm.transmission;
    let dragged = LazyCell::new(|| behind_friction(arm, recorded));
    let tension_n = |time_s: f64, wound: &Vector3<f64>| {
        let Some(motor) = recorded.steady(time_s) else { return Vector3::zeros() };
        let [joint, rate, acceleration] = [
            transmission.joint_from_motor(wound),
            transmission.joint_rate_from_motor(&motor.rate),
            transmission.joint_rate_from_motor(&motor.acceleration),
        ];
        let lifted = arm.dynamics.inverse(&joint, &rate, &acceleration);
        let (tension_n, way) = (transmission.tension_n(&lifted), dragged.drag_about(time_s, HALF_WINDOW_S).unwrap_or_default());
        let drag = |j: usize, _| arm.dry_friction_n(j, tension_n[j]) * way[j] + arm.link_friction[j].viscous * rate[j];
        transmission.tension_n(&(lifted + Vector3::from_fn(drag)))
    };
    wound_by(laws, &Cables { transmission, stiffness_n: arm.cables.map(|cable| cable.stiffness), tension_n: &tension_n }, recorded)
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

    #[test]
    fn cables_carry_weight_friction_and_what_moves_the_links() {
        let arm = nominal::gold().arm().unwrap();
        let (middle, reach) = (Vector3::new(0.5, 1.5, 0.4), Vector3::new(0.3, 0.3, 0.05));
        let omega = 4.0;
        let at = |time_s: f64| middle + reach * (omega * time_s).sin();
        let time_s: Vec<f64> = (0..2000).map(|k| f64::from(k) * 1e-3).collect();
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&at(t))).collect(), time_s };
        // Half way out, and shortly before the joints turn.
        let times_s = [std::f64::consts::FRAC_PI_6 / omega, 0.9 * std::f64::consts::FRAC_PI_2 / omega];
        let heard = Arc::new(Mutex::new(Vec::new()));
        let hears = heard.clone();
        let law: MotorLaw = Box::new(move |cables, track| {
            let tension_n = |time_s: f64| (cables.tension_n)(time_s, &track.at(time_s).unwrap().0);
            hears.lock().unwrap().extend(times_s.map(tension_n));
        });
        assert_eq!(*wound(&[law], &arm, &motor), motor);
        for (time_s, tension_n) in times_s.into_iter().zip(heard.lock().unwrap().iter()) {
            let rate = reach * omega * (omega * time_s).cos();
            let acceleration = -reach * omega * omega * (omega * time_s).sin();
            let lifted = arm.dynamics.inverse(&at(time_s), &rate, &acceleration);
            let drag = Vector3::from_fn(|j, _| arm.link_friction[j].coulomb + arm.link_friction[j].viscous * rate[j]);
            let expected = arm.transmission.tension_n(&(lifted + drag));
            approx::assert_relative_eq!(*tension_n, expected, max_relative = 0.01);
            assert!((expected - arm.transmission.tension_n(&arm.dynamics.gravity(&at(time_s)))).norm() > 0.5);
        }
    }

    #[test]
    fn friction_drags_on_after_a_motion_has_ended() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.link_friction.iter_mut().for_each(|friction| friction.held_part = 1.0);
        let (from, by) = (Vector3::new(0.5, 1.5, 0.4), Vector3::new(0.2, -0.2, 0.04));
        let time_s: Vec<f64> = (0..3000).map(|k| f64::from(k) * 1e-3).collect();
        let at = |time_s: f64| from + by * time_s.min(1.0);
        let motor = MotorTrack { angle: time_s.iter().map(|&t| arm.transmission.motor_from_joint(&at(t))).collect(), time_s };
        let heard = Arc::new(Mutex::new(Vector3::zeros()));
        let hears = heard.clone();
        let law: MotorLaw = Box::new(move |cables, track| *hears.lock().unwrap() = (cables.tension_n)(2.5, &track.at(2.5).unwrap().0));
        let _ = wound(&[law], &arm, &motor);
        let drag = Vector3::from_fn(|j, _| arm.link_friction[j].coulomb * by[j].signum());
        let expected = arm.transmission.tension_n(&(arm.dynamics.gravity(&at(2.5)) + drag));
        approx::assert_relative_eq!(*heard.lock().unwrap(), expected, max_relative = 0.01);
    }
}
