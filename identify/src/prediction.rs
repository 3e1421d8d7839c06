//! Where the cameras should have seen the tip, for a robot file and what it says about the observation.
//!
//! A tip stamped `t` is where the robot had it at `t - latency`. There the joints rest where the cables hold them,
//!
//! ```text
//! q = q_rigid(w) - (1 + C)^-1 x / r_l,   gamma(x) = (1 + C)'^-1 (G(q) + F_c clip(qd / v_s)) / r_l
//! ```
//!
//! with `w` the motors' motion behind the [hysteresis](raven::robot::Arm::driving) of each cable, and its direction for the friction's. At
//! reversals friction holds a joint back while its cable winds up, and inertia and damping move it too: 1e-4 rad rms and 6 um on motions
//! of 0.8 rad/s, and more the softer the cables. The [`lag`](Predictor::lag) of a rollout behind that rest is added, in which friction that
//! holds [grips](LinkModel::rollout_gripped) the joints: links that swing behind its play would not come to rest. The prediction is then
//! moved as the registration is off, so that it meets the sighting, and the sighting's covariance, in the frame in which they were recorded.

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};
use raven::Result;
use raven::observation::TipCorrection;
use raven::robot::stiction::has_play;
use raven::robot::{LinkModel, LinkState, Robot};
use rayon::prelude::*;

use crate::motion::Motion;
use crate::session::{Session, Sighting};

/// Sightings whose rollout is one piece of work.
const PART: usize = 300;
/// Time after which a joint has forgotten how it started [s]: ten times the slowest of its time constants, 0.2 s while friction holds it.
const WARM_UP_S: f64 = 2.0;

/// Predicts sightings from motors.
#[derive(Debug, Clone)]
pub struct Predictor {
    model: LinkModel,
    correction: TipCorrection,
}

impl Predictor {
    /// For a robot file.
    ///
    /// # Errors
    /// If it describes no arm.
    pub fn new(robot: &Robot) -> Result<Self> {
        let arm = robot.arm()?;
        Ok(Self { correction: TipCorrection::of(robot, &arm)?, model: LinkModel::new(arm) })
    }

    /// The motors' motion as the cables have it; what all predictions are made of.
    #[must_use]
    pub fn driving<'a>(&self, motors: &'a Motion) -> Cow<'a, Motion> {
        match self.model.arm().driving(motors.track()) {
            Cow::Borrowed(_) => Cow::Borrowed(motors),
            Cow::Owned(track) => Cow::Owned(motors.with_track(track)),
        }
    }

    /// Joint positions [rad, rad, m] at a time of the robot, at rest.
    #[must_use]
    pub fn joints(&self, driving: &Motion, time_s: f64) -> Vector3<f64> {
        let rate = self.model.arm().transmission.joint_rate_from_motor(&driving.rate_rad_s(time_s));
        let direction = self.model.arm().rubbing(&rate);
        self.model.settled(&driving.angle_rad(time_s), &direction)
    }

    /// Where the tip with stamp `time_s` should have been seen [m], the joints at rest.
    #[must_use]
    pub fn seen_m(&self, driving: &Motion, time_s: f64) -> Vector3<f64> {
        self.seen_lagging_m(driving, time_s, &Vector3::zeros())
    }

    /// Where the tip with stamp `time_s` should have been seen [m], the joints at `lag` [rad, rad, m] from rest.
    #[must_use]
    pub fn seen_lagging_m(&self, driving: &Motion, time_s: f64, lag: &Vector3<f64>) -> Vector3<f64> {
        let joints = self.joints(driving, self.correction.shown_at_s(time_s)) + lag;
        self.correction.seen_m(&self.model.arm().kinematics.forward(&joints))
    }

    /// Where all tips of a session should have been seen [m], the joints at `lag` [rad, rad, m] from rest, per sighting; at rest without.
    #[must_use]
    pub fn session_m(&self, session: &Session, lag: Option<&[Vector3<f64>]>) -> Vec<Vector3<f64>> {
        let driving = self.driving(&session.motion);
        let lag_of = |i: usize| lag.map_or_else(Vector3::zeros, |lag| lag[i]);
        let seen_m = |(i, sighting): (usize, &Sighting)| self.seen_lagging_m(&driving, sighting.time_s, &lag_of(i));
        session.sightings.iter().enumerate().map(seen_m).collect()
    }

    /// The [`lag`](Self::lag) at the sightings of a session.
    #[must_use]
    pub fn session_lag(&self, session: &Session) -> Vec<Vector3<f64>> {
        let times_s: Vec<f64> = session.sightings.iter().map(|sighting| sighting.time_s).collect();
        self.lag(&session.motion, &times_s)
    }

    /// How that moves with the joints, 3x3 [m/rad, m/rad, 1].
    #[must_use]
    pub fn seen_from_joints(&self, driving: &Motion, time_s: f64) -> Matrix3<f64> {
        let joints = self.joints(driving, self.correction.shown_at_s(time_s));
        self.correction.seen_from_true() * self.model.arm().kinematics.jacobian(&joints)
    }

    /// How far from rest inertia, damping and friction that holds keep the joints [rad, rad, m] at the stamps `times_s` (sorted), by rollouts.
    /// Nothing where the motion is not known.
    #[must_use]
    pub fn lag(&self, motors: &Motion, times_s: &[f64]) -> Vec<Vector3<f64>> {
        let driving = &self.driving(motors);
        let of_robot: Vec<f64> = times_s.iter().map(|&t| self.correction.shown_at_s(t)).collect();
        let lag = |(state, &time_s): (Option<LinkState>, &f64)| {
            state.map_or_else(Vector3::zeros, |state| state.position - self.joints(driving, time_s))
        };
        // Where friction that holds has hold of a joint may have been settled long before any warm-up.
        if has_play(self.model.arm()) {
            let winding = self.model.arm().winding(motors.track());
            return self.model.rollout_gripped(&winding, &of_robot).into_iter().zip(&of_robot).map(lag).collect();
        }
        let of_part = |times_s: &[f64]| {
            let track = driving.part(times_s[0] - WARM_UP_S, times_s[times_s.len() - 1]);
            let begins = track.time_s.first() == driving.track().time_s.first();
            self.model.rollout_of_part(&track, times_s, begins).into_iter().zip(times_s).map(lag).collect::<Vec<_>>()
        };
        of_robot.par_chunks(PART).flat_map_iter(of_part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raven::robot::{MotorTrack, nominal};

    /// The motors of a fast swing of the elbow, 3 Hz.
    fn swing() -> Motion {
        let transmission = nominal::gold().arm().unwrap().transmission;
        let time_s: Vec<f64> = (0..3000).map(|i| f64::from(i) * 1e-3).collect();
        let joint = |t: f64| Vector3::new(0.8, 1.6 + 0.03 * (18.8 * t).sin(), 0.33);
        let angle = time_s.iter().map(|&t| transmission.motor_from_joint(&joint(t))).collect();
        Motion::new(MotorTrack { time_s, angle }, 0.02).unwrap()
    }

    #[test]
    fn the_lag_is_what_inertia_and_damping_make_of_a_swing() {
        let robot = nominal::gold();
        let predictor = Predictor::new(&robot).unwrap();
        let times_s: Vec<f64> = (0..40).map(|i| 1.0 + f64::from(i) / 20.0).collect();
        let lag = predictor.lag(&swing(), &times_s);
        // Inertia swings a spring of 558 N m/rad by m w^2 a / k, a spring that gives way by as much more.
        let arm = robot.arm().unwrap();
        let inertia = arm.dynamics.mass_matrix(&Vector3::new(0.8, 1.6, 0.33))[(1, 1)];
        let expected = inertia * 18.8_f64.powi(2) * 0.03 / (2.0 * arm.cables[1].stiffness * arm.transmission.link_radius_m[1].powi(2));
        let most = lag.iter().map(|l| l[1].abs()).fold(0.0, f64::max);
        assert!((0.8..1.4).contains(&(most / expected)), "{most} rad, expected {expected}");
    }

    #[test]
    fn rollouts_in_parts_are_one_rollout() {
        let predictor = Predictor::new(&nominal::gold()).unwrap();
        let times_s: Vec<f64> = (0..1450).map(|i| 0.05 + f64::from(i) / 500.0).collect();
        let motion = swing();
        let whole = predictor.model.rollout(motion.track(), &times_s);
        // Steps share what links weigh from where a part begins.
        let counts = predictor.model.arm().transmission.ratio * 4000.0 / std::f64::consts::TAU;
        for ((lag, state), &time_s) in predictor.lag(&motion, &times_s).iter().zip(whole).zip(&times_s) {
            let rest = predictor.joints(&motion, time_s);
            let off_counts = (state.unwrap().position - rest - lag).component_mul(&counts);
            assert!(off_counts.amax() < 0.01, "{off_counts} encoder counts at {time_s} s");
        }
    }

    #[test]
    fn a_cable_is_fresh_as_the_recording_begins_and_not_as_a_part_of_it_does() {
        let times_s: Vec<f64> = (0..1450).map(|i| 0.05 + f64::from(i) / 500.0).collect();
        let lag = |fresh_part: f64| {
            let mut robot = nominal::gold();
            // Its stretch comes with a time constant of half a second.
            robot.joints[2].cable = Some(raven::robot::Cable { fresh_part, ..raven::robot::Cable::new(9250.0, 4600.0) });
            Predictor::new(&robot).unwrap().lag(&swing(), &times_s)
        };
        let (settled, fresh) = (lag(0.0), lag(1.0));
        let apart_m: Vec<f64> = settled.iter().zip(&fresh).map(|(settled, fresh)| (settled[2] - fresh[2]).abs()).collect();
        assert!(apart_m[0] > 1e-4, "{} m", apart_m[0]);
        // The fifth rollout sets out 2 s before its first sighting, at 0.45 s.
        assert_eq!(apart_m[1200..].iter().copied().fold(0.0, f64::max), 0.0);
    }

    #[test]
    fn outside_the_motion_there_is_no_lag() {
        let lag = Predictor::new(&nominal::gold()).unwrap().lag(&swing(), &[-1.0, 1.0, 9.0]);
        assert_eq!((lag[0], lag[2]), (Vector3::zeros(), Vector3::zeros()));
    }
}
