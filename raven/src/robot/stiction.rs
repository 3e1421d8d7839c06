//! Friction on a soft cable is play: the joint rests until the cable's end has moved by enough to pull it free.
//!
//! ```text
//! h = F_c / (2 k_e r_l)      stretch at which the cable overcomes the joint's Coulomb friction [m]
//! w follows the capstan's travel p with play h:  p - h <= w <= p + h
//! ```
//!
//! At the speeds of surgery the links' inertia does not matter, so a joint behind a spring with Coulomb friction is where a free joint
//! would be if `w` had been wound. Unlike friction that is smoothed around rest, play does not creep while the robot holds still. Play
//! between capstan and cable looks the same, so an `F_c` identified from tips stands for both. Source of the operator: Prandtl; see
//! Krasnosel'skii, Pokrovskii, Systems with Hysteresis, 1989, chapter 1.

use nalgebra::Vector3;

use super::{Arm, MotorTrack, PAUSE_MAX_S};

/// Half the play that Coulomb friction at the joint makes of each cable, as motor angles [rad].
#[must_use]
pub fn play_half_rad(arm: &Arm) -> Vector3<f64> {
    Vector3::from_fn(|j, _| {
        let pull_n = arm.link_friction[j].coulomb / arm.transmission.link_radius_m[j];
        let half_m = arm.cables[j].static_stretch_m(pull_n);
        if half_m.is_finite() { half_m / arm.transmission.cable_per_motor_m[j] } else { 0.0 }
    })
}

/// What the motors' motion does to the joints once the play is taken up. After a pause the play is in its middle, as at the start.
#[must_use]
pub fn behind_play(motor: &MotorTrack, half_rad: &Vector3<f64>) -> MotorTrack {
    let mut follower = Vector3::zeros();
    let mut last_s = f64::NEG_INFINITY;
    let angle = motor.time_s.iter().zip(&motor.angle).map(|(&time_s, angle)| {
        if time_s - last_s > PAUSE_MAX_S {
            follower = *angle;
        }
        last_s = time_s;
        follower = follower.zip_zip_map(angle, half_rad, |w: f64, p, h| w.clamp(p - h, p + h));
        follower
    });
    MotorTrack { angle: angle.collect(), time_s: motor.time_s.clone() }
}

/// The arm without the friction that [`behind_play`] stands for.
#[must_use]
pub fn without_coulomb_friction(mut arm: Arm) -> Arm {
    for friction in &mut arm.link_friction {
        friction.coulomb = 0.0;
    }
    arm
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
        let played = behind_play(&motor, &play_half_rad(&arm));
        let free = LinkModel::new(without_coulomb_friction(arm.clone())).rollout(&played, &times);
        let unaided = LinkModel::new(without_coulomb_friction(arm)).rollout(&motor, &times);
        let miss = |model: &[Option<crate::robot::LinkState>]| {
            let pairs = model.iter().zip(&rubbing).map(|(a, b)| a.unwrap().position[1] - b.unwrap().position[1]);
            crate::stats::rms(&pairs.collect::<Vec<_>>()).unwrap()
        };
        assert!(miss(&free) < 0.2 * miss(&unaided), "{} of {}", miss(&free), miss(&unaided));
    }

    #[test]
    fn nothing_moves_within_the_play_and_all_of_it_beyond() {
        let angles = [0.0, 0.9, 2.0, 1.5, 0.5, -1.0, -1.0].map(Vector3::repeat);
        let time_s = (0..7).map(|k| f64::from(k) * 0.1).collect();
        let played = behind_play(&MotorTrack { time_s, angle: angles.to_vec() }, &Vector3::repeat(1.0));
        assert_eq!(played.angle.iter().map(|a| a.x).collect::<Vec<_>>(), [0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]);
    }
}
