//! From a log to what models and filters take in: motor angles, and tips at the robot's own times and in its own frame.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Matrix3x6, Matrix6, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::filter::TipAt;
use crate::log::{JointSeries, Recording};
use crate::robot::{Arm, KinematicsKind, MotorTrack, Observation, POSE_COVARIANCE, Robot};
use crate::{Error, Result};

impl Recording {
    /// Reads a log that a robot recorded.
    ///
    /// # Errors
    /// Those of [`Recording::read`], or if its tips are the other arm's.
    pub fn of_robot(path: &Path, robot: &Robot) -> Result<Self> {
        let recording = Self::read(path, &robot.into())?;
        if let KinematicsKind::Raven(kinematics) = &robot.kinematics {
            let (arm, other) = (kinematics.arm.name(), kinematics.arm.other());
            if recording.tip.iter().any(|tip| tip.frame_id == other.frame0()) {
                let message = format!(
                    "its tips are the {} arm's, in `{}`, and the robot file is the {arm} arm's; give the robot file with which it was tracked.",
                    other.name(),
                    other.frame0()
                );
                return Err(Error::file(path, message));
            }
        }
        Ok(recording)
    }

    /// Motor angles of the first three joints.
    ///
    /// # Errors
    /// If the log has no motor angles, or not of three joints.
    pub fn motor_track(&self) -> Result<MotorTrack> {
        let motor = self.require_motor()?;
        Ok(MotorTrack { time_s: motor.time_s.clone(), angle: three_joints(motor, self)? })
    }

    /// Tips that were seen, with latency, clock and registration as the robot file corrects them, sorted by time.
    ///
    /// # Errors
    /// If the log has no tips, or the robot is no arm.
    pub fn tips(&self, robot: &Robot) -> Result<Vec<TipAt>> {
        let correction = TipCorrection::of(robot, &robot.arm()?)?;
        self.require_tip()?;
        let mut tips: Vec<TipAt> = self
            .seen_tips()
            .map(|tip| {
                let time_s = tip.stamp.seconds_since(self.start);
                correction.apply(&TipAt { time_s, position: tip.position_m, covariance: tip.covariance_m2 })
            })
            .filter(|tip| tip.position.iter().chain(tip.covariance.iter()).all(|v| v.is_finite()))
            .collect();
        tips.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        Ok(tips)
    }
}

/// The first three joints of a series, sample by sample [rad, rad, m or rad].
///
/// # Errors
/// If the series has fewer joints.
pub fn three_joints(series: &JointSeries, recording: &Recording) -> Result<Vec<Vector3<f64>>> {
    let [first, second, third, ..] = series.position.as_slice() else {
        let message = format!("has {} joints in its joint messages, expected shoulder, elbow and insertion.", series.position.len());
        return Err(Error::file(&recording.path, message));
    };
    Ok((0..series.len()).map(|k| Vector3::new(first[k], second[k], third[k])).collect())
}

impl Observation {
    /// Covariance of what is left unknown of rotation about the tip at the hard stop and translation [rad^2, rad m, m^2], where the file says.
    #[must_use]
    pub fn pose_covariance(&self) -> Option<Matrix6<f64>> {
        let triangle = self.covariance?;
        Some(Matrix6::from_fn(|i, j| triangle[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)]))
    }

    /// Covariance that all tips near one share [m^2, frame 0], which is `from_hard_stop_m` away from the tip at the hard stop; `None` where the file says
    /// nothing of it.
    #[must_use]
    pub fn shared_covariance_m2(&self, from_hard_stop_m: &Vector3<f64>) -> Option<Matrix3<f64>> {
        self.pose_covariance().map(|pose| covariance_by_pose_m2(&pose, from_hard_stop_m))
    }

    /// Whether the registration was looked into, as against the latency alone.
    #[must_use]
    pub fn corrects_registration(&self) -> bool {
        Self { latency: 0.0, ..*self } != Self::default()
    }

    /// The same observation with such a covariance.
    #[must_use]
    pub fn with_pose_covariance(self, covariance: &Matrix6<f64>) -> Self {
        let triangle = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|at| covariance[at]);
        let mut numbers = [0.0; POSE_COVARIANCE];
        numbers.iter_mut().zip(triangle).for_each(|(number, of_triangle)| *number = of_triangle);
        Self { covariance: Some(numbers), ..self }
    }
}

/// How a small rotation about a pivot and a translation move a tip, `from_pivot_m` away from it: `[X 1]`, `X = -[from_pivot]x`.
#[must_use]
pub fn moved_by_pose(from_pivot_m: &Vector3<f64>) -> Matrix3x6<f64> {
    let mut slope = Matrix3x6::zeros();
    slope.fixed_view_mut::<3, 3>(0, 0).copy_from(&-from_pivot_m.cross_matrix());
    slope.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
    slope
}

/// Covariance [m^2] that a tip `from_pivot_m` away from a pivot has of a rotation about that and a translation of such a covariance [rad^2, rad m, m^2].
#[must_use]
pub fn covariance_by_pose_m2(pose: &Matrix6<f64>, from_pivot_m: &Vector3<f64>) -> Matrix3<f64> {
    let by_pose = moved_by_pose(from_pivot_m);
    by_pose * pose * by_pose.transpose()
}

/// Takes latency and registration error out of observed tips, and puts them into predicted ones:
///
/// ```text
/// p_true(t - latency - drift t) = R (p_seen(t) - p_hs) + p_hs + translation
/// ```
#[derive(Debug, Clone, Copy)]
pub struct TipCorrection {
    latency_s: f64,
    drift: f64,
    rotation: Rotation3<f64>,
    translation: Vector3<f64>,
    pivot: Vector3<f64>,
}

impl TipCorrection {
    /// The correction that `observation` asks for; it turns about the tip at the hard stop.
    #[must_use]
    pub fn new(arm: &Arm, observation: &Observation) -> Self {
        Self {
            latency_s: observation.latency,
            drift: 0.0,
            rotation: Rotation3::new(Vector3::from(observation.rotation)),
            translation: Vector3::from(observation.translation),
            pivot: arm.kinematics.forward(&arm.hard_stop),
        }
    }

    /// The correction of a robot file, whose arm this is: the drift of the clocks, which its list of effects may hold, included.
    ///
    /// # Errors
    /// If the list makes no sense.
    pub fn of(robot: &Robot, arm: &Arm) -> Result<Self> {
        Ok(Self { drift: crate::effects::clock_drift(robot)?, ..Self::new(arm, &robot.observation) })
    }

    /// The tip as the robot had it.
    #[must_use]
    pub fn apply(&self, tip: &TipAt) -> TipAt {
        let turn = self.rotation.matrix();
        TipAt {
            time_s: self.shown_at_s(tip.time_s),
            position: turn * (tip.position - self.pivot) + self.pivot + self.translation,
            covariance: turn * tip.covariance * turn.transpose(),
        }
    }

    /// When the robot was where an image with this stamp shows it [s].
    #[must_use]
    pub fn shown_at_s(&self, stamp_s: f64) -> f64 {
        stamp_s - self.latency_s - self.drift * stamp_s
    }

    /// Where the cameras see a tip [m, frame 0] that the robot has at `tip_m`: the inverse of [`Self::apply`] for the position.
    #[must_use]
    pub fn seen_m(&self, tip_m: &Vector3<f64>) -> Vector3<f64> {
        self.seen_from_true() * (tip_m - self.pivot - self.translation) + self.pivot
    }

    /// Where the robot has a tip that the cameras see, as a motion in frame 0.
    #[must_use]
    pub fn true_from_seen(&self) -> Isometry3<f64> {
        let moved = self.pivot + self.translation - self.rotation * self.pivot;
        Isometry3::from_parts(Translation3::from(moved), UnitQuaternion::from_rotation_matrix(&self.rotation))
    }

    /// What turns a displacement of the tip into the one that the cameras see.
    #[must_use]
    pub fn seen_from_true(&self) -> Matrix3<f64> {
        self.rotation.matrix().transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::nominal;
    use approx::assert_relative_eq;

    #[test]
    fn what_is_put_in_is_taken_out() {
        let arm = nominal::gold().arm().unwrap();
        let [rotation, translation] = [[0.02, -0.01, 0.03], [1e-3, -2e-3, 3e-3]];
        let observation = Observation { latency: 0.06, rotation, translation, covariance: None };
        let correction = TipCorrection::new(&arm, &observation);
        let tip = Vector3::new(-0.06, -0.02, 0.01);
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-8, 2e-6, 1e-8));
        let turn = correction.seen_from_true();
        let seen = TipAt { time_s: 1.06, position: correction.seen_m(&tip), covariance: turn * covariance * turn.transpose() };
        let back = correction.apply(&seen);
        assert_relative_eq!(back.position, tip, epsilon = 1e-15);
        assert_relative_eq!(back.covariance, covariance, epsilon = 1e-18);
        assert_relative_eq!(back.time_s, 1.0, epsilon = 1e-15);
        let moved = correction.seen_m(&(tip + Vector3::new(0.0, 1e-3, 0.0))) - seen.position;
        assert_relative_eq!(moved, turn * Vector3::new(0.0, 1e-3, 0.0), epsilon = 1e-15);
    }
}
