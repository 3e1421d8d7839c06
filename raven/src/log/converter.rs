//! What the robot's converters were given of the torque its controller asked for.
//!
//! `raven_state` holds the torque before clipping (`tau`) and the converters' steps after it (`dac_val`). Which torque a step stands for
//! depends on the controller's build; the log itself says it.

use crate::stats::median;

/// Fewest steps of a sample that says what a step stands for: rounding is then below one per cent.
const STEPS_MIN: f64 = 50.0;
/// Steps below this part of the most were not clipped, also where converters give a step more to one side.
const BELOW: f64 = 0.98;
/// A torque is clipped if it is this many times what its steps stand for.
const BEYOND: f64 = 1.02;

/// Torques of three joints with the steps that went with them.
#[derive(Debug, Default)]
pub(super) struct Converters {
    samples: [Vec<[f64; 2]>; 3],
}

impl Converters {
    /// Adds a sample: torques [N m] and steps.
    pub(super) fn push(&mut self, torque: &[f64; 3], steps: &[i32; 3]) {
        for ((samples, &torque), &steps) in self.samples.iter_mut().zip(torque).zip(steps) {
            if torque.is_finite() {
                samples.push([torque, f64::from(steps)]);
            }
        }
    }

    /// Clips torques as the converters did, one list per joint.
    pub(super) fn clip(&self, torques: &mut [Vec<f64>]) {
        for (torques, samples) in torques.iter_mut().zip(&self.samples) {
            if let Some(limit) = limit(samples) {
                torques.iter_mut().for_each(|torque| *torque = torque.clamp(-limit, limit));
            }
        }
    }
}

/// The largest torque that went through [N m]; `None` where none was clipped.
fn limit(samples: &[[f64; 2]]) -> Option<f64> {
    let per_step = |[torque, steps]: &[f64; 2]| (torque / steps).abs();
    let most_steps = samples.iter().map(|[_, steps]| steps.abs()).fold(0.0, f64::max);
    let telling = |[_, steps]: &&[f64; 2]| (STEPS_MIN..BELOW * most_steps).contains(&steps.abs());
    let most = most_steps * median(&samples.iter().filter(telling).map(per_step).collect::<Vec<_>>())?;
    samples.iter().any(|[torque, _]| torque.abs() > BEYOND * most).then_some(most).filter(|most| *most > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torques_are_clipped_where_the_steps_are() {
        let per_step = -2.7e-4;
        let asked: Vec<f64> = (-60..=60).map(|k| 0.02 * f64::from(k)).collect();
        let mut converters = Converters::default();
        for &torque in &asked {
            let steps = (torque / per_step).round();
            converters.push(&[torque; 3], &[steps as i32, steps.clamp(-3000.0, 3000.0) as i32, 0]);
        }
        let mut torques = vec![asked.clone(); 3];
        converters.clip(&mut torques);
        assert_eq!(torques[0], asked, "nothing was clipped");
        let largest = torques[1].iter().copied().fold(0.0, f64::max);
        approx::assert_relative_eq!(largest, 3000.0 * 2.7e-4, max_relative = 2e-3);
        assert_eq!(torques[2], asked, "converters that were not recorded say nothing");
    }

    #[test]
    fn a_drive_that_clips_most_of_the_time_is_seen() {
        let asked: Vec<f64> = (-100..=100).map(|k| 0.02 * f64::from(k)).collect();
        let mut converters = Converters::default();
        for &torque in &asked {
            converters.push(&[torque; 3], &[(torque / 2.7e-4).clamp(-1501.0, 1500.0).round() as i32; 3]);
        }
        let mut torques = vec![asked; 3];
        converters.clip(&mut torques);
        let largest = torques[0].iter().copied().fold(0.0, f64::max);
        approx::assert_relative_eq!(largest, 1501.0 * 2.7e-4, max_relative = 2e-3);
    }
}
