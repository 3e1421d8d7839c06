//! What drives were asked for over a window of time: a drive clips what it is asked for at an instant, not the mean of a window in which
//! feedback makes the command tremble.

use nalgebra::Vector3;

/// Parts of a window's weight. The one that a limit falls into is off by a hundredth of the command's spread at most.
const PARTS: usize = 8;

/// Torques that were commanded within a window [N m or N], per joint in rising order: the means over equal parts of the window's weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    parts: [Vector3<f64>; PARTS],
}

impl Command {
    /// The same all the time.
    #[must_use]
    pub fn steady(torque: Vector3<f64>) -> Self {
        Self { parts: [torque; PARTS] }
    }

    /// Of torques with their weights, some of which are positive.
    #[must_use]
    pub fn of(samples: &[(Vector3<f64>, f64)]) -> Self {
        let size = samples.iter().map(|(_, weight)| weight).sum::<f64>() / PARTS as f64;
        let mut parts = [Vector3::zeros(); PARTS];
        for j in 0..3 {
            let mut rising: Vec<(f64, f64)> = samples.iter().map(|(torque, weight)| (torque[j], *weight)).collect();
            rising.sort_by(|a, b| a.0.total_cmp(&b.0));
            let (mut part, mut room) = (0, size);
            for (torque, mut weight) in rising {
                while weight > 0.0 {
                    // What rounding leaves over is the last part's.
                    let taken = if part + 1 < PARTS { weight.min(room) } else { weight };
                    parts[part][j] += torque * taken / size;
                    (weight, room) = (weight - taken, room - taken);
                    if room <= 0.0 && part + 1 < PARTS {
                        (part, room) = (part + 1, size);
                    }
                }
            }
        }
        Self { parts }
    }

    /// Mean over the window.
    #[must_use]
    pub fn mean(&self) -> Vector3<f64> {
        self.mean_of(|_, torque| torque)
    }

    /// Mean over the window of what a drive, the j-th, makes of a torque.
    pub(super) fn mean_of(&self, drive: impl Fn(usize, f64) -> f64) -> Vector3<f64> {
        Vector3::from_fn(|j, _| self.parts.iter().map(|torque| drive(j, torque[j])).sum::<f64>() / PARTS as f64)
    }

    /// Between two windows: 0 is this one, 1 the other.
    #[must_use]
    pub fn lerp(&self, other: &Self, part: f64) -> Self {
        Self { parts: std::array::from_fn(|k| self.parts[k].lerp(&other.parts[k], part)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_trembles_about_a_limit_is_clipped_in_part() {
        // Evenly from -1 to 1, the middle of the window counting most.
        let samples: Vec<(Vector3<f64>, f64)> = (0..=400)
            .map(|i| {
                let off = f64::from(i) / 200.0 - 1.0;
                let shuffled = f64::from(i * 89 % 401) / 200.0 - 1.0;
                (Vector3::new(shuffled, 0.3 + 0.01 * shuffled, -2.0), (1.0 - off * off).powi(3))
            })
            .collect();
        let weights: f64 = samples.iter().map(|(_, weight)| weight).sum();
        let mean = |of: &dyn Fn(f64) -> f64, j: usize| samples.iter().map(|(torque, weight)| of(torque[j]) * weight).sum::<f64>() / weights;
        let command = Command::of(&samples);
        for limit in [0.1, 0.295, 0.5, 0.9, 5.0] {
            let clipped = command.mean_of(|_, torque| torque.clamp(-limit, limit));
            for (j, spread) in [0.58, 0.0058, 0.0].into_iter().enumerate() {
                approx::assert_abs_diff_eq!(clipped[j], mean(&|torque| torque.clamp(-limit, limit), j), epsilon = 0.01 * spread + 1e-12);
            }
        }
        approx::assert_abs_diff_eq!(command.mean(), Vector3::from_fn(|j, _| mean(&|torque| torque, j)), epsilon = 1e-12);
    }
}
