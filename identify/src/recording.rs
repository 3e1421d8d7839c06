//! From log files to sessions: what can be used of them, and a sentence where that is nothing.

use std::path::Path;

use nalgebra::Vector3;
use raven::camera::Cameras;
use raven::log::{Moments, Recording, TipObservation};
use raven::observation::TipCorrection;
use raven::robot::{JointType, Robot};
use raven::{Error, Result, files};

use crate::motion::Motion;
use crate::session::{Session, Sighting};

/// Fewest sightings to estimate from: two seconds of a slow webcam.
const SIGHTINGS_MIN: usize = 30;
/// How far around the time that a sighting shows by what is known so far the motion must be known [s]: what the latency may still turn out
/// to be.
const MARGIN_S: f64 = 0.1;
/// Motion [rad, m] below which a radius that is off by a tenth moves the tip by less than a camera sees.
const MOVED: [f64; 2] = [0.0175, 0.002];
/// Distance [rad, m] within which a joint is at its hard stop.
const AT_HARD_STOP: [f64; 2] = [0.035, 0.005];

/// What was read of one or more logs.
#[derive(Debug, Clone, Default)]
pub struct Recordings {
    /// One per log, in the order given.
    pub sessions: Vec<Session>,
    /// Length of all logs together [s].
    pub duration_s: f64,
    /// Sentences about what could not be used.
    pub lost: Vec<String>,
    /// Sentences about logs that may not belong to the robot or the cameras.
    pub doubts: Vec<String>,
    /// The cameras that each log was tracked with, where it says so.
    pub tracked: Vec<Option<Cameras>>,
}

impl Recordings {
    /// Reads logs of one robot, which are held against its cameras and the file that those came from.
    ///
    /// # Errors
    /// If a log cannot be read, has no motors or no tip, or was tracked with cameras of another size, if the two clocks disagree, if too few
    /// sightings are left, or if the robot did not move away from its hard stop in any of them.
    pub fn read(paths: &[impl AsRef<Path>], robot: &Robot, cameras: Option<(&Cameras, &Path)>) -> Result<Self> {
        let mut all = Self::default();
        let mut moments = Moments::default();
        for path in paths {
            let recording = Recording::of_robot(path.as_ref(), robot)?;
            moments = moments.with(&recording)?;
            all.add(&recording, robot, cameras)?;
        }
        let sightings: usize = all.sessions.iter().map(|s| s.sightings.len()).sum();
        if sightings < SIGHTINGS_MIN {
            return Err(Error::Data(format!(
                "{}: {sightings} usable sightings of the tip, fewer than the {SIGHTINGS_MIN} that an estimate needs; record longer.",
                all.names()
            )));
        }
        all.require_motion(robot)?;
        Ok(all)
    }

    /// File names in one line.
    fn names(&self) -> String {
        self.sessions.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ")
    }

    fn add(&mut self, recording: &Recording, robot: &Robot, cameras: Option<(&Cameras, &Path)>) -> Result<()> {
        let path = recording.path.as_path();
        self.doubts.extend(Cameras::doubts(cameras, robot, recording)?);
        let motion = Motion::new(recording.motor_track()?, recording.require_motor()?.longest_joined_s())
            .ok_or_else(|| Error::file(path, "the log has a single robot message; an estimate needs a motion."))?;
        recording.require_tip()?;
        let seen: Vec<(f64, &TipObservation)> = recording.seen_tips().map(|tip| (tip.stamp.seconds_since(recording.start), tip)).collect();
        if seen.is_empty() {
            let count = recording.tip.len();
            return Err(Error::file(path, format!("the tip was not seen in any of {count} observations; see what `raven-track` says.")));
        }
        require_one_clock(path, &motion, &seen)?;
        let correction = TipCorrection::of(robot, &robot.arm()?)?;

        let name = recording.name();
        self.lost.extend(recording.unusable());
        let (start, end) = (motion.span_s()[0], motion.span_s()[1]);
        let (mut in_gaps, mut without_covariance) = (0, 0);
        let mut sightings = Vec::with_capacity(seen.len());
        for (time_s, tip) in seen {
            let at = correction.shown_at_s(time_s);
            if !motion.covers(at - MARGIN_S, at + MARGIN_S) {
                // At the ends the motion is unknown in every recording, which loses nothing worth a word.
                in_gaps += usize::from(at - MARGIN_S >= start && at + MARGIN_S <= end);
                continue;
            }
            match Sighting::new(time_s, tip.position_m, &tip.covariance_m2) {
                Some(sighting) => sightings.push(sighting),
                None => without_covariance += 1,
            }
        }
        sightings.sort_by(|a: &Sighting, b| a.time_s.total_cmp(&b.time_s));
        if in_gaps > 0 {
            let gaps = motion.gaps();
            self.lost.push(format!("{name}: {in_gaps} sightings next to {gaps} gaps in the robot's messages were left out."));
        }
        if without_covariance > 0 {
            self.lost.push(format!("{name}: {without_covariance} sightings whose covariance is none were left out."));
        }
        self.duration_s += recording.duration_s;
        self.tracked.push(Cameras::of_tracked(recording));
        self.sessions.push(Session { name, sha256: files::sha256(path)?, motion, sightings });
        Ok(())
    }

    fn require_motion(&self, robot: &Robot) -> Result<()> {
        let arm = robot.arm()?;
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for motor in self.sessions.iter().flat_map(|s| &s.motion.track().angle) {
            let joint = arm.transmission.joint_from_motor(motor);
            (low, high) = (low.inf(&joint), high.sup(&joint));
        }
        let within = |limits: [f64; 2], distance: &dyn Fn(usize) -> f64| {
            robot.joints.iter().take(3).enumerate().all(|(j, joint)| distance(j) <= limits[usize::from(joint.kind == JointType::Prismatic)])
        };
        let from_stop = |j: usize| (high[j] - arm.hard_stop[j]).max(arm.hard_stop[j] - low[j]);
        let names = self.names();
        if within(AT_HARD_STOP, &from_stop) {
            return Err(Error::Data(format!(
                "{names}: the robot never left its hard stop, where no radius shows; `raven-calibrate register` is for this recording."
            )));
        }
        if within(MOVED, &|j| high[j] - low[j]) {
            return Err(Error::Data(format!("{names}: no joint moved by more than 1 deg or 2 mm; record a motion through the workspace.")));
        }
        Ok(())
    }
}

/// Most sightings must lie within the robot's messages, or the two were stamped by different clocks.
fn require_one_clock(path: &Path, motion: &Motion, seen: &[(f64, &TipObservation)]) -> Result<()> {
    let [start, end] = motion.span_s();
    let inside = seen.iter().filter(|(time_s, _)| (start..=end).contains(time_s)).count();
    if 2 * inside >= seen.len() {
        return Ok(());
    }
    let (Some(&(first, _)), Some(&(last, _))) = (seen.first(), seen.last()) else { return Ok(()) };
    Err(Error::file(
        path,
        format!(
            "the tip was seen from {first:.3} to {last:.3} s and the robot spoke from {start:.3} to {end:.3} s: the clocks disagree; map \
             the cameras' stamps to the robot's clock first."
        ),
    ))
}
