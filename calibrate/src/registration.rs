//! What a registration found, for people and for scripts.

use nalgebra::{Isometry3, Matrix3, Rotation3, Vector3};
use raven::Result;
use raven::robot::Robot;
use serde::Serialize;

use crate::from_motion::{Before, FromMotion};
use crate::hard_stop::AtHardStop;
use crate::mount::Mount;
use crate::moving::Moving;

/// The result as scripts read it.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// `x_0 = R x_left + t`.
    pub base_from_left: PoseReport,
    /// Standard deviation of the tip at the hard stop as the cameras see it [m].
    pub translation_std_m: [f64; 3],
    /// Standard deviation of the rotation about each axis of frame 0 [rad].
    pub rotation_std_rad: [f64; 3],
    /// By how much images show the past [s]; a robot at rest does not tell.
    pub latency_s: Option<f64>,
    /// Standard deviation of the latency [s].
    pub latency_std_s: Option<f64>,
    /// What a motion tells beside.
    pub motion: Option<MotionReport>,
    /// Marker at the hard stop in the left camera's frame [m], if the hard stop was recorded.
    pub marker_left_m: Option<[f64; 3]>,
    /// Frames in which the marker was seen there.
    pub frames_seen: Option<usize>,
    /// Pairs of frames at the hard stop.
    pub frames: Option<usize>,
}

/// What a motion tells.
#[derive(Debug, Clone, Serialize)]
pub struct MotionReport {
    /// How much later than a left image the nearest right one is taken in the first recording, median [s].
    pub right_minus_left_s: f64,
    /// Its standard deviation [s].
    pub right_minus_left_std_s: f64,
    /// The same by the stamps alone [s].
    pub stamps_apart_s: f64,
    /// By how much more a right image shows the past than a left one of the same stamp [s]: the difference.
    pub right_latency_beyond_left_s: f64,
    /// Standard deviation of the tip as the cameras see it in the middle of the motion [m].
    pub workspace_std_m: [f64; 3],
    /// By how much the motion moves the tip at the hard stop, in frame 0 [m], if that was recorded.
    pub hard_stop_moved_m: Option<[f64; 3]>,
    /// The same as joints [rad, rad, m], and its standard deviation if the hard stop were rigid.
    pub hard_stop_joints: Option<[[f64; 2]; 3]>,
    /// What each joint does beyond the model, one sigma [rad, rad, m].
    pub misfit: [f64; 3],
    /// The robot's numbers that were estimated along.
    pub robot: Vec<NumberReport>,
    /// Sightings of the tip used.
    pub sightings: usize,
    /// Left frames of the motion.
    pub frames: usize,
}

/// One number of the robot.
#[derive(Debug, Clone, Serialize)]
pub struct NumberReport {
    /// As `raven-identify` names it.
    pub name: String,
    /// Value, SI.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Value in the robot file.
    pub prior: f64,
}

/// A rotation and a shift.
#[derive(Debug, Clone, Serialize)]
pub struct PoseReport {
    /// Row by row.
    pub rotation: [f64; 9],
    /// [m].
    pub translation: [f64; 3],
}

/// Deviations by which a motion must contradict the hard stop to be worth a sentence.
const CONTRADICTS: f64 = 3.0;

impl Report {
    /// Of the registration before a motion; `stop` is what was seen at the hard stop, if that was recorded.
    #[must_use]
    pub fn new(stop: Option<&AtHardStop>, before: &Before) -> Self {
        Self {
            base_from_left: PoseReport::of(&before.base_from_left),
            translation_std_m: before.translation_std_m,
            rotation_std_rad: before.rotation_std_rad,
            latency_s: None,
            latency_std_s: None,
            motion: None,
            marker_left_m: stop.map(|stop| stop.place.point_left.into()),
            frames_seen: stop.map(|stop| stop.place.frames),
            frames: stop.map(|stop| stop.frames),
        }
    }

    /// Takes in what a motion said.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn take(&mut self, robot: &Robot, stop: Option<&AtHardStop>, found: &FromMotion, moving: &[Moving]) -> Result<()> {
        let arm = robot.arm()?;
        let tip = arm.kinematics.forward(&arm.hard_stop);
        self.base_from_left = PoseReport::of(&found.base_from_left);
        self.translation_std_m = found.std_at(&tip, &tip);
        self.rotation_std_rad = found.rotation_std_rad();
        (self.latency_s, self.latency_std_s) = (Some(found.latency_s[0]), Some(found.latency_s[1]));
        let at_stop = stop.map(|stop| {
            let into_joints = arm.kinematics.jacobian(&arm.hard_stop).try_inverse().unwrap_or_else(Matrix3::zeros);
            let moved = into_joints * found.moved_m;
            let covariance = into_joints * (stop.covariance_rigid + found.covariance.fixed_view::<3, 3>(3, 3)) * into_joints.transpose();
            (found.moved_m.into(), [0, 1, 2].map(|j| [moved[j], covariance[(j, j)].sqrt()]))
        });
        let number = |(name, value, std, prior): &(String, f64, f64, f64)| NumberReport {
            name: name.clone(),
            value: *value,
            std: *std,
            prior: *prior,
        };
        let stamps_apart_s = moving.first().map_or(f64::NAN, Moving::stamps_apart_s);
        self.motion = Some(MotionReport {
            right_minus_left_s: stamps_apart_s - found.right_minus_left_s[0],
            stamps_apart_s,
            right_latency_beyond_left_s: found.right_minus_left_s[0],
            right_minus_left_std_s: found.right_minus_left_s[1],
            workspace_std_m: found.std_at(&found.middle_m, &tip),
            hard_stop_moved_m: at_stop.map(|(moved, _)| moved),
            hard_stop_joints: at_stop.map(|(_, joints)| joints),
            misfit: found.misfit.into(),
            robot: found.robot.iter().map(number).collect(),
            sightings: found.sightings,
            frames: moving.iter().map(|moving| moving.frames).sum(),
        });
        Ok(())
    }

    /// The result as text; `mount` is the rotation that was given, if one was, and `mount_std_deg` how well it is set.
    #[must_use]
    pub fn text(&self, robot: &Robot, mount: Option<(&str, &Mount)>, mount_std_deg: f64) -> String {
        let row = |values: [f64; 3], scale: f64, digits: usize| values.map(|x| format!("{:.digits$}", scale * x)).join(", ");
        let mut text = String::new();
        if let (Some(marker), Some(seen), Some(frames)) = (self.marker_left_m, self.frames_seen, self.frames) {
            let marker = row(marker, 1e3, 2);
            text += &format!("marker seen in {seen} of {frames} pairs of frames at ({marker}) mm before the left camera\n");
        }
        if let Ok(arm) = robot.arm() {
            text += &format!("tip at the hard stop   ({}) mm in frame 0\n", row(arm.kinematics.forward(&arm.hard_stop).into(), 1e3, 2));
        }
        let [t, std] = [self.base_from_left.translation, self.translation_std_m].map(|v| row(v, 1e3, 2));
        text += &format!("base_from_left: t      ({t}) mm, one sigma ({std}) mm with the rotation as it is\n");
        match (&self.motion, mount) {
            (Some(motion), mount) => text + &self.of_motion(motion, mount),
            (None, Some((axes, _))) => text + &format!("rotation {axes}, one sigma {mount_std_deg} deg about the tip at the hard stop\n"),
            (None, None) => text,
        }
    }

    fn of_motion(&self, motion: &MotionReport, mount: Option<(&str, &Mount)>) -> String {
        let row = |values: [f64; 3], scale: f64, digits: usize| values.map(|x| format!("{:.digits$}", scale * x)).join(", ");
        let degrees = 180.0 / std::f64::consts::PI;
        let turn = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&self.base_from_left.rotation));
        let rotation = match mount {
            Some((axes, mount)) => {
                let turned: Vector3<f64> = (turn * mount.base_from_left.inverse()).scaled_axis();
                format!("{axes} and ({}) deg about the axes of frame 0", row(turned.into(), degrees, 3))
            }
            None => {
                [0, 1, 2].map(|i| format!("{}0=({})", ["x", "y", "z"][i], row(turn.matrix().row(i).transpose().into(), 1.0, 4))).join(" ")
            }
        };
        format!(
            "rotation               {rotation}, one sigma ({}) deg\n\
             seen in the motion     in {} of {} frames; one sigma of the tip in its middle ({}) mm\n\
             latency                {:.2} +- {:.2} ms\n\
             right minus left       {:.2} ms by the stamps, {:.2} +- {:.2} ms in truth\n",
            row(self.rotation_std_rad, degrees, 3),
            motion.sightings,
            motion.frames,
            row(motion.workspace_std_m, 1e3, 2),
            1e3 * self.latency_s.unwrap_or(f64::NAN),
            1e3 * self.latency_std_s.unwrap_or(f64::NAN),
            1e3 * motion.stamps_apart_s,
            1e3 * motion.right_minus_left_s,
            1e3 * motion.right_minus_left_std_s,
        )
    }
}

impl PoseReport {
    fn of(pose: &Isometry3<f64>) -> Self {
        let rotation = pose.rotation.to_rotation_matrix();
        Self { rotation: std::array::from_fn(|i| rotation[(i / 3, i % 3)]), translation: pose.translation.vector.into() }
    }
}

/// Standard deviation of a latency from which on it is worth nothing [s]: a tip at 50 mm/s is a millimetre off by it.
const LATENCY_TELLS_S: f64 = 0.02;

/// A sentence where a motion does not tell the latency.
#[must_use]
pub fn unknown_latency([latency_s, std_s]: [f64; 2]) -> Option<String> {
    (std_s > LATENCY_TELLS_S).then(|| {
        format!(
            "the latency came out at {:.0} +- {:.0} ms, which is no use: images and motors do not agree on one. A clock that steps or runs away during the \
             recording does that, as `raven-capture check` would show, and so does a robot that hardly moves; record the motion again.",
            1e3 * latency_s,
            1e3 * std_s
        )
    })
}

/// A sentence, if the motion puts the tip at the hard stop elsewhere than a rigid stop allows.
#[must_use]
pub fn contradiction(motion: &MotionReport, robot: &Robot) -> Option<String> {
    let shown = |(j, [moved, std]): (usize, &[f64; 2])| {
        let joint = robot.joints.get(j).filter(|_| moved.abs() > CONTRADICTS * std)?;
        let (scale, unit) = if j == 2 { (1e3, "mm") } else { (180.0 / std::f64::consts::PI, "deg") };
        Some(format!("{} by {:.2} {unit} +- {:.2}", joint.name, scale * moved, scale * std))
    };
    let all: Vec<String> = motion.hard_stop_joints.iter().flatten().enumerate().filter_map(shown).collect();
    (!all.is_empty()).then(|| {
        format!(
            "hard stop and motion disagree: seen from the motion, the hard stop is off in {}. A stop that gives way or cables that homing \
             stretches do that; the motion is believed.",
            all.join(" and ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latency_that_no_motion_tells_is_no_use() {
        let said = unknown_latency([0.199, 0.099]).unwrap();
        assert!(said.contains("199 +- 99 ms") && said.contains("raven-capture check"), "{said}");
        assert_eq!(unknown_latency([0.0158, 0.0005]), None);
    }
}
