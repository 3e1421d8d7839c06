//! Whether cameras are those that a recording was tracked with, whose file it carries.

use std::path::Path;

use nalgebra::{Point3, Vector2, Vector3};

use super::{Cameras, Pinhole};
use crate::log::{CAMERAS_FILE, Recording};
use crate::robot::Robot;
use crate::{Error, Result};

/// Two calibrations of the same cameras put a point nearer than this in their images [px] and before the robot [m], and their images nearer in
/// time [s].
const SAME_PX: f64 = 1.0;
const SAME_M: f64 = 1e-3;
const SAME_S: f64 = 1e-3;
/// A latency that is no rest of another [s].
const LATENCY_S: f64 = 5e-3;
/// Where points are compared: at so many baselines before the left camera, and at parts of its image.
const BASELINES: f64 = 8.0;
const PARTS: [f64; 3] = [0.1, 0.5, 0.9];

impl Cameras {
    /// The cameras that a recording was tracked with, where it says so.
    #[must_use]
    pub fn of_tracked(recording: &Recording) -> Option<Self> {
        let text = std::str::from_utf8(recording.attachments.get(CAMERAS_FILE)?).ok()?;
        Self::parse(&recording.path, text).ok()
    }

    /// Sentences where a log says that it is of another robot, or was tracked with other cameras than those that came from a file.
    ///
    /// # Errors
    /// If it was tracked with cameras whose images have another size.
    pub fn doubts(cameras: Option<(&Self, &Path)>, robot: &Robot, recording: &Recording) -> Result<Vec<String>> {
        let others = match (cameras, Self::of_tracked(recording)) {
            (Some((cameras, path)), Some(tracked)) => cameras.compared_with(path, &tracked, &recording.path)?,
            _ => None,
        };
        Ok(recording.of_another_robot(robot).into_iter().chain(others).collect())
    }

    /// A sentence where a robot file takes a latency out of the tips of a log that the cameras it was tracked with have taken out already.
    #[must_use]
    pub fn latency_counts_twice(robot: &Robot, recording: &Recording) -> Option<String> {
        Self::of_tracked(recording).and_then(|tracked| tracked.latency_beside(robot, &recording.path))
    }

    /// A sentence where both these cameras, with which `log` was tracked, and a robot file have a latency of the same kind.
    fn latency_beside(&self, robot: &Robot, log: &Path) -> Option<String> {
        let [own, of_robot] = [self.latency_s, robot.observation.latency];
        (own.abs().min(of_robot.abs()) > LATENCY_S && own * of_robot > 0.0).then(|| {
            format!(
                "{} was tracked with a latency of {:.1} ms, and observation.latency of robot `{}` takes another {:.1} ms out of its tips. If both \
                 are the same, set the robot file's to 0 or identify it anew from this log.",
                log.display(),
                1e3 * own,
                robot.name,
                1e3 * of_robot
            )
        })
    }

    /// A sentence where these cameras, which came from `path`, see things elsewhere than those that `log` was tracked with.
    ///
    /// # Errors
    /// If their images have other sizes: they are not the same cameras.
    fn compared_with(&self, path: &Path, tracked: &Self, log: &Path) -> Result<Option<String>> {
        let [path_name, log_name] = [path, log].map(Path::display);
        for (side, own, theirs) in [("left", &self.left, &tracked.left), ("right", &self.right, &tracked.right)] {
            let size = |camera: &Pinhole| [camera.width, camera.height];
            if size(own) != size(theirs) {
                let ([width, height], [as_wide, as_high]) = (size(own), size(theirs));
                let message = format!(
                    "{side}.image_width and image_height are {width} x {height}, but {log_name} was tracked with cameras of {as_wide} x {as_high}, \
                     which it carries as {CAMERAS_FILE}; give the file it was tracked with, or track it anew."
                );
                return Err(Error::file(path, message));
            }
        }
        let (mut off_px, mut off_m) = (0.0_f64, 0.0_f64);
        for point in self.before_left() {
            if let (Some(own), Some(theirs)) = (self.project(&point), tracked.project(&point)) {
                off_px = own.iter().zip(&theirs).map(|(own, theirs)| (own - theirs).norm()).fold(off_px, f64::max);
            }
            if let (Some(own), Some(theirs)) = (self.base_from_left, tracked.base_from_left) {
                let point = Point3::from(point);
                off_m = off_m.max((own * point - theirs * point).norm());
            }
        }
        let late_s = [self.latency_s - tracked.latency_s, self.right_minus_left_s - tracked.right_minus_left_s];
        let late_s = late_s.iter().fold(0.0, |most: f64, late| most.max(late.abs()));
        let differences = [
            (off_px > SAME_PX, format!("{off_px:.1} px")),
            (off_m > SAME_M, format!("{:.1} mm in frame 0", 1e3 * off_m)),
            (late_s > SAME_S, format!("{:.1} ms", 1e3 * late_s)),
        ];
        let differences: Vec<String> = differences.into_iter().filter_map(|(is_material, words)| is_material.then_some(words)).collect();
        Ok((!differences.is_empty()).then(|| {
            format!(
                "{path_name} and the cameras that {log_name} was tracked with, which it carries as {CAMERAS_FILE}, differ by up to {}; give the file \
                 it was tracked with, or track it anew.",
                differences.join(" and ")
            )
        }))
    }

    /// Points all over the left image, where a tool may be.
    fn before_left(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let depth_m = BASELINES * self.baseline_m();
        let pixel = |u: f64, v: f64| Vector2::new(u * f64::from(self.left.width), v * f64::from(self.left.height));
        let pixels = PARTS.into_iter().flat_map(move |v| PARTS.map(|u| pixel(u, v)));
        pixels.filter_map(move |pixel| self.left.undistort(&pixel).map(|normal| normal.push(1.0) * depth_m))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Translation3;

    use super::super::tests::pair;
    use super::*;
    use crate::robot::nominal;

    #[test]
    fn other_cameras_are_told_from_the_same_calibrated_again() {
        let cameras = pair();
        let said = |other: &Cameras| cameras.compared_with(Path::new("c.yaml"), other, Path::new("a.mcap")).map_err(|e| e.to_string());
        assert_eq!(said(&cameras), Ok(None));
        let mut again = cameras.clone();
        (again.left.fx, again.right.cy) = (again.left.fx + 0.1, again.right.cy - 0.2);
        again.base_from_left = Some(Translation3::new(0.0, 2e-4, 0.0) * cameras.base_from_left.unwrap_or_default());
        assert_eq!(said(&again), Ok(None));

        let mut moved = cameras.clone();
        moved.right_from_left.translation.x *= 1.1;
        let sentence = said(&moved).unwrap().unwrap();
        assert!(["c.yaml", "a.mcap", " px;", "track it anew"].iter().all(|words| sentence.contains(words)), "{sentence}");
        let mut bumped = cameras.clone();
        bumped.base_from_left = cameras.base_from_left.map(|pose| Translation3::new(0.0, 0.0, 3e-3) * pose);
        let sentence = said(&bumped).unwrap().unwrap();
        assert!(sentence.contains("by up to 3.0 mm in frame 0;"), "{sentence}");
        let mut late = cameras.clone();
        late.latency_s += 0.0159;
        let sentence = said(&late).unwrap().unwrap();
        assert!(sentence.contains("by up to 15.9 ms;"), "{sentence}");
        let mut larger = cameras.clone();
        (larger.right.width, larger.right.height) = (1280, 720);
        let error = said(&larger).unwrap_err();
        assert!(["c.yaml", "right.image_width", "a.mcap", "of 1280 x 720"].iter().all(|words| error.contains(words)), "{error}");
    }

    #[test]
    fn a_latency_that_was_taken_out_already_is_told() {
        let (cameras, mut robot) = (pair(), nominal::gold());
        let mut said = |latency_s: f64| {
            robot.observation.latency = latency_s;
            cameras.latency_beside(&robot, Path::new("a.mcap"))
        };
        let sentence = said(0.0155).unwrap();
        assert!(["a.mcap", "20.0 ms", "15.5 ms", "observation.latency"].iter().all(|words| sentence.contains(words)), "{sentence}");
        // What the first has left, and none.
        assert_eq!([0.001, -0.001, 0.0].map(said), [None, None, None]);
    }
}
