//! Whether a motion is fast enough for a cable's damping to show.
//!
//! Damping moves a joint by `b_e / k_e` times the rate of its load, as if the motion were seen later by `b_e / k_e`. The speed that the
//! joint gains in that time must exceed the speed below which nobody knows how friction fades, or the damping stands in for friction at
//! reversals:
//!
//! ```text
//! (b_e / k_e) rms(qdd) > v_s
//! ```
//!
//! A slow sinusoid fails this, and would give a damping of several times the true one with a small deviation.

use nalgebra::Vector3;
use raven::Result;
use raven::robot::Robot;

use crate::motion::Motion;
use crate::parameters::Quantity;
use crate::priors::Unknown;
use crate::session::Session;

/// Time between the speeds that make an acceleration [s].
const STEP_S: f64 = 0.02;

/// Takes those dampings out of `unknowns` that no session shows, and says so in a sentence each.
///
/// # Errors
/// If the robot is no arm.
pub fn leave_out_hidden(unknowns: &mut Vec<Unknown>, robot: &Robot, sessions: &[Session]) -> Result<Vec<String>> {
    let arm = robot.arm()?;
    let mut sentences = Vec::new();
    unknowns.retain(|unknown| {
        let Quantity::Damping(j) = unknown.quantity else { return true };
        let time_s = unknown.prior / arm.cables[j].stiffness;
        let fastest = sessions.iter().map(|s| acceleration(&s.motion, robot).map_or(0.0, |a| a[j])).fold(0.0, f64::max);
        let shows = time_s * fastest > arm.stiction_speed(j);
        if !shows {
            sentences.push(format!(
                "{} was left out: the motion is too slow for it, and friction at reversals would pass for damping; record what \
                 `raven-identify excite` proposes.",
                unknown.quantity.name()
            ));
        }
        shows
    });
    Ok(sentences)
}

/// Root mean square acceleration of the joints [rad/s^2, rad/s^2, m/s^2], gaps aside.
fn acceleration(motion: &Motion, robot: &Robot) -> Option<Vector3<f64>> {
    let transmission = robot.arm().ok()?.transmission;
    let squares: Vec<Vector3<f64>> = motion
        .times_every(STEP_S)
        .filter(|t| motion.covers(t - 2.0 * STEP_S, t + 2.0 * STEP_S))
        .map(|t| (motion.rate_rad_s(t + 0.5 * STEP_S) - motion.rate_rad_s(t - 0.5 * STEP_S)) / STEP_S)
        .map(|a| transmission.joint_rate_from_motor(&a).map(|v| v * v))
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<Vector3<f64>>() / squares.len() as f64).map(f64::sqrt))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excite::candidates::Candidate;
    use crate::excite::motion::{motors, speed_max};
    use crate::parameters::Selection;
    use crate::priors;
    use raven::camera::Quality;
    use raven::robot::nominal;

    fn kept(candidate: Candidate) -> (Vec<String>, usize) {
        let robot = nominal::gold();
        let arm = robot.arm().unwrap();
        let segment = candidate.segment(30.0, &arm.limits, &speed_max(&robot));
        let motion = Motion::new(motors(&arm.transmission, 30.0, |t| segment.at(t)), 0.02).unwrap();
        let sessions = [Session { name: String::new(), sha256: String::new(), motion, sightings: Vec::new() }];
        let names = ["k_e2".to_owned(), "b_e1".to_owned(), "b_e2".to_owned()];
        let mut unknowns = priors::unknowns(&robot, &Selection::named(&names).unwrap(), &Quality::default()).unwrap();
        let sentences = leave_out_hidden(&mut unknowns, &robot, &sessions).unwrap();
        (unknowns.iter().filter(|u| u.named).map(|u| u.quantity.name()).collect(), sentences.len())
    }

    #[test]
    fn a_sinusoid_hides_what_a_multisine_shows() {
        assert_eq!(kept(Candidate::Sinusoid), (vec!["k_e2".to_owned()], 2));
        assert_eq!(kept(Candidate::Multisine([0.5; 3])), (vec!["k_e2".to_owned(), "b_e1".to_owned(), "b_e2".to_owned()], 0));
    }
}
